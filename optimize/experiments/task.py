"""Task: one whole search as plain data that any process can run, and the result that is kept."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import lru_cache

import msgspec

from domino_env.core.results import versions
from domino_env.physics.layout import Layout
from domino_env.scenes.io.reading import parse_scene
from domino_env.scenes.scene import Scene
from optimize.evaluator import Evaluator, Step
from optimize.searching import search

Label = float | int | str
Sizes = tuple[float, ...]

SCENES_KEPT = 32  # in each process, with their uniform baselines: several tasks share a scene


class TaskResult(msgspec.Struct, frozen=True):
    """Result of a task: plain numbers, which JSON gives back bitwise.

    It is reproducible under a budget of evaluations, except `seconds`, those in `trace`, and
    `versions`.

    Attributes
    ----------
    key, method, seed, labels
        Those of the task.
    scene_name
        Name of its scene.
    score, uniform_score
        Scores of the best layout found, and of the uniform baseline.
    gain
        score / uniform_score - 1; None where one of the two waves stops.
    outcome
        Name of the `Outcome` of the best layout's wave.
    mean_speed
        Speed of that wave [m/s]; 0 where it stops.
    spacing, thickness, height
        (N-1,), (N,), (N,): the best layout [m].
    evaluations, falls, seconds
        Layouts, intervals between hits, and time [s] simulated.
    trace
        (evaluations, intervals, seconds, best score) at every improvement, and at the end.
    versions
        Versions of everything that the result may depend on.
    scene
        TOML text of the task's scene, so that the layout can be simulated again.
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
    spacing: Sizes
    thickness: Sizes
    height: Sizes
    evaluations: int
    falls: int
    seconds: float
    trace: list[Step]
    labels: dict[str, Label] = {}
    versions: dict[str, str] = {}
    scene: str = ""

    @property
    def layout(self) -> Layout:
        """The best layout."""
        scene = scene_of(self.scene)
        tall = None if scene.growth is None else self.height[1:]
        return scene.layout(self.spacing, self.thickness[1:], tall)


@dataclass(frozen=True)
class Task:
    """One search, as plain data.

    All randomness of a task comes from its own seed, so its result does not depend on who runs it,
    and when.

    Attributes
    ----------
    scene
        The scene as TOML text.
    method, seed
        As of `optimize.search`.
    budget, seconds
        Largest number of evaluations and largest time [s], or None; with a limit of seconds the
        result is not bitwise reproducible.
    labels
        Name of the task among others, such as {"physics.friction": 0.1}.
    """

    scene: str
    method: str
    seed: int
    budget: int | None = None
    seconds: float | None = None
    labels: dict[str, Label] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        scene: Scene,
        method: str,
        seed: int,
        budget: int | None = None,
        seconds: float | None = None,
        labels: dict[str, Label] | None = None,
    ) -> Task:
        """Make the task of searching a scene."""
        return cls(scene.to_toml(), method, seed, budget, seconds, labels or {})

    @property
    def key(self) -> str:
        """Digest of all that decides the result; labels do not."""
        return digest([self.scene, self.method, self.seed, self.budget, self.seconds])

    @property
    def name(self) -> str:
        """Words for a line: its labels, method and seed."""
        words = [f"{key} = {value}" for key, value in self.labels.items()]
        return ", ".join([*(words or [self.scene_name]), self.method, f"seed {self.seed}"])

    def run(
        self,
        callback: Callable[[Evaluator], None] | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> TaskResult:
        """Search, and return what an experiment keeps.

        Parameters
        ----------
        callback, clock
            As of `optimize.search`.

        Raises
        ------
        ValueError
            As of `optimize.search`.
        KeyboardInterrupt
            Where the search was interrupted: its result is not that of the task.
        """
        result = search(
            scene_of(self.scene), self.method, self.budget, self.seed, seconds=self.seconds,
            progress=False, callback=callback, clock=clock,
        )  # fmt: skip
        if result.interrupted:
            raise KeyboardInterrupt
        return self.result_of(
            result.layout, result.score, result.uniform.score, result.trace,
            gain=result.gain, outcome=result.wave.outcome.name, speed=result.wave.mean_speed,
        )  # fmt: skip

    def result_of(
        self,
        layout: Layout | None,
        score: float,
        uniform_score: float,
        trace: Iterable[Step],
        *,
        gain: float | None,
        outcome: str = "PROPAGATED",
        speed: float = 0.0,
    ) -> TaskResult:
        """Make the result of this task, whose spent budget is that at the end of the trace."""
        steps = [(int(n), int(f), float(t), float(s)) for n, f, t, s in trace]
        sizes = (
            (layout.spacing, layout.thickness, layout.height) if layout is not None else ((),) * 3
        )
        spacing, thickness, height = (tuple(map(float, values)) for values in sizes)
        return TaskResult(
            key=self.key,
            scene_name=self.scene_name,
            method=self.method,
            seed=self.seed,
            score=float(score),
            uniform_score=float(uniform_score),
            gain=None if gain is None else float(gain),
            outcome=outcome,
            mean_speed=float(speed),
            spacing=spacing,
            thickness=thickness,
            height=height,
            evaluations=steps[-1][0],
            falls=steps[-1][1],
            seconds=steps[-1][2],
            trace=steps,
            labels=self.labels,
            versions=versions(),
            scene=self.scene,
        )

    @property
    def scene_name(self) -> str:
        """Name of the scene."""
        return scene_of(self.scene).name


def digest(decisive: list[object]) -> str:
    """Return a short name of plain data."""
    return hashlib.sha256(json.dumps(decisive).encode()).hexdigest()[:32]


@lru_cache(SCENES_KEPT)
def scene_of(text: str) -> Scene:
    """Read the scene of a TOML text."""
    return parse_scene(text, "scene", "scene")
