"""Task: one whole search as plain data, which any process can run, and what is kept of it."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from domino_env.core.results import versions
from domino_env.physics.layout import Layout
from domino_env.scenes.io.reading import parse_scene
from domino_env.scenes.scene import Scene
from optimize.evaluator import Budget, Step
from optimize.result import SearchResult
from optimize.searching import search

Floats = NDArray[np.float64]
Label = float | int | str

SCENES_KEPT = 32  # in each process, with their uniform marks: several tasks share a scene


@dataclass(frozen=True)
class Task:
    """One search, as plain data.

    All randomness of a task comes from its own seed, so that it does not matter who runs it, and
    when.

    Attributes
    ----------
    scene
        The scene as TOML text.
    method
        As of `optimize.search`.
    seed
        As of `optimize.search`.
    evaluations
        Its budget, or None.
    seconds
        Its budget, or None; a budget of seconds cannot be repeated to the bit.
    labels
        What the task is called among others, such as (("physics.friction", 0.1),).
    """

    scene: str
    method: str
    seed: int
    evaluations: int | None = None
    seconds: float | None = None
    labels: tuple[tuple[str, Label], ...] = ()

    @classmethod
    def of(
        cls,
        scene: Scene,
        method: str,
        seed: int,
        evaluations: int | None = None,
        seconds: float | None = None,
        labels: tuple[tuple[str, Label], ...] = (),
    ) -> Task:
        """Make the task of searching a scene.

        Raises
        ------
        ValueError
            For a scene that is not the same when it is written to a file and read back.
        """
        text = scene.to_toml()
        back = parse_scene(text, scene.name, scene.name)
        if any(getattr(back, f.name) != getattr(scene, f.name) for f in fields(scene)):
            raise ValueError(
                f"scene '{scene.name}' says what no scene file can say: it cannot be sent elsewhere"
            )
        return cls(text, method, seed, evaluations, seconds, labels)

    @property
    def key(self) -> str:
        """A digest of all that decides the result; labels do not."""
        decisive = [self.scene, self.method, self.seed, self.evaluations, self.seconds]
        return hashlib.sha256(json.dumps(decisive).encode()).hexdigest()[:32]

    @property
    def name(self) -> str:
        """What to call it in a line: its labels, method and seed."""
        told = [f"{key} = {value}" for key, value in self.labels]
        return ", ".join([*(told or [scene_of(self.scene).name]), self.method, f"seed {self.seed}"])

    def run(
        self, watch: Callable[[Budget], None] | None = None, *, progress: bool | None = False
    ) -> TaskResult:
        """Search, and keep what a study needs; the uniform baseline is found here too.

        Parameters
        ----------
        watch, progress
            As of `optimize.search`.

        Raises
        ------
        ValueError
            As of `optimize.search`.
        KeyboardInterrupt
            For a search that was ended by hand: half a search is no result of its task.
        """
        return self.searched(time.perf_counter, watch, progress)

    def searched(
        self,
        clock: Callable[[], float],
        watch: Callable[[Budget], None] | None = None,
        progress: bool | None = False,
    ) -> TaskResult:
        """Search by a clock, as `run` does by that on the wall; see `optimize.search`."""
        result = search(
            scene_of(self.scene),
            self.method,
            self.evaluations,
            self.seed,
            seconds=self.seconds,
            progress=progress,
            watch=watch,
            clock=clock,
        )
        if result.interrupted:
            raise KeyboardInterrupt
        return TaskResult(
            key=self.key,
            scene_name=result.scene.name,
            method=self.method,
            seed=self.seed,
            score=float(result.score),
            uniform_score=float(result.uniform.score),
            gain=None if result.gain is None else float(result.gain),
            outcome=result.wave.outcome.name,
            mean_speed=float(result.wave.mean_speed),
            spacing=result.layout.spacing,
            thickness=result.layout.thickness,
            height=result.layout.height,
            evaluations=int(result.evaluations),
            falls=int(result.falls),
            seconds=float(result.seconds),
            trace=[(int(n), int(f), float(t), float(s)) for n, f, t, s in result.trace],
            labels=self.labels,
            versions=versions(),
            scene=self.scene,
        )


@dataclass(frozen=True, eq=False)
class TaskResult:
    """What is kept of a search: plain numbers and arrays.

    It can be repeated to the bit under a budget of evaluations, but for `seconds`, those in
    `trace`, and `versions`.

    Attributes
    ----------
    key, method, seed, labels
        Of the task.
    scene_name
        Name of its scene.
    score, uniform_score
        Of the best row found, and of the best uniform row.
    gain
        score / uniform_score - 1; None where one of the two waves dies.
    outcome
        Name of the `Outcome` of the best row's wave.
    mean_speed
        Of that wave [m/s]; 0 where it dies.
    spacing, thickness, height
        (N-1,), (N,), (N,): the best row [m].
    evaluations, falls, seconds
        Spent.
    trace
        (evaluations, simulated falls, seconds, best score) at every improvement, and at the end.
    versions
        Of everything the result may depend on.
    scene
        TOML text of the task's scene, so that what is kept can be simulated again.
    """

    key: str
    scene_name: str
    method: str
    seed: int
    score: float
    uniform_score: float
    gain: float | None
    outcome: str
    mean_speed: float
    spacing: Floats
    thickness: Floats
    height: Floats
    evaluations: int
    falls: int
    seconds: float
    trace: list[Step]
    labels: tuple[tuple[str, Label], ...] = ()
    versions: dict[str, str] = field(default_factory=dict)
    scene: str = ""


def run_task(
    task: Task, watch: Callable[[Budget], None] | None = None, *, progress: bool | None = False
) -> TaskResult:
    """Do what a task asks, by `Task.run`."""
    return task.run(watch, progress=progress)


def layout_of(scene: Scene, kept: TaskResult) -> Layout:
    """Make the best row again from what was kept of it."""
    tall = None if scene.growth is None else kept.height[1:]
    return scene.layout(kept.spacing, kept.thickness[1:], tall)


def search_result(scene: Scene, kept: TaskResult) -> SearchResult:
    """Make the full result again from what was kept of it; its wave is simulated anew."""
    layout = layout_of(scene, kept)
    return SearchResult(
        scene=scene,
        method=kept.method,
        seed=kept.seed,
        layout=layout,
        wave=scene.simulate(layout),
        score=kept.score,
        uniform=scene.uniform(),
        trace=tuple(kept.trace),
        slopes=(None,) * len(kept.trace),
        evaluations=kept.evaluations,
        falls=kept.falls,
        seconds=kept.seconds,
        interrupted=False,
    )


@lru_cache(SCENES_KEPT)
def scene_of(text: str) -> Scene:
    """Read the scene of a TOML text."""
    return parse_scene(text, "scene", "scene")
