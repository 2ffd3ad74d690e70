"""Task: one search as plain data that any process can run, and its result."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.checks import require
from domino_env.core.files import amount
from domino_env.core.results import versions
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.scenes.io.reading import parse_scene
from domino_env.scenes.objectives.base import Objective
from domino_env.scenes.scene import Scene
from optimize.evaluator import GRADIENT_COST, Evaluator
from optimize.searching import compile_simulations, search, with_baseline

Label = float | int | str
Sizes = tuple[float, ...]
Trace = dict[str, list[int | float]]

TRACE_COLUMNS = ("evaluations", "falls", "seconds", "score")  # of the trace of a search
CACHED_SCENES = 32  # of each process, with their uniform baselines: several tasks share a scene


STOPPED_GAIN = -1.0  # gain of a layout whose wave stops, and the least gain in a statistic


class TaskResult(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a task: plain data, which JSON restores bitwise.

    It is bitwise reproducible under a budget of evaluations, except `seconds`, those in `trace`,
    and `versions`.

    Attributes
    ----------
    key, scene_name, method, seed, labels
        See `Task`.
    score, uniform_score
        Scores of the best layout, and of the uniform baseline.
    gain
        Gain over the uniform baseline, see `Scene.gain`.
    outcome
        Name of the `Outcome` of the best layout's wave.
    mean_speed
        Speed of that wave [m/s]; 0 if it stops.
    spacing, thickness, height
        Gaps (N-1,), thicknesses (N,) and heights (N,) of the best layout [m]; empty if there is
        none.
    seconds
        Time [s].
    work
        Counts of the run by name, those that it has: "evaluations", scored layouts; "falls",
        simulated intervals between hits; "steps", placed dominoes; "simulations", simulated
        layouts; "gradients", those that were simulated with their gradient; "updates" of a policy.
    trace
        Columns of equal length by name: the best "score", and the clocks of the run at that time,
        "seconds" and counts of `work`, at every improvement and at the end.
    versions
        Version of each software that the result may depend on, by name.
    scene
        Scene of the task as TOML text, with which the layout can be simulated again.
    """

    key: str
    scene_name: str
    method: str
    seed: int
    score: float
    uniform_score: float
    gain: float | None
    outcome: str = "PROPAGATED"
    mean_speed: float = 0.0
    spacing: Sizes = ()
    thickness: Sizes = ()
    height: Sizes = ()
    seconds: float
    work: dict[str, int]
    trace: Trace
    labels: dict[str, Label] = {}
    versions: dict[str, str] = {}
    scene: str = ""

    @property
    def problem(self) -> str:
        """Name of the problem: the labels if there are any, else the name of the scene."""
        return describe_labels(self.labels) or self.scene_name

    @property
    def criterion(self) -> Objective:
        """Objective of the scene."""
        return read_scene(self.scene).criterion

    @property
    def layout(self) -> Layout:
        """Best layout."""
        return read_scene(self.scene).layout(self.spacing, self.thickness[1:], self.height[1:])


@dataclass(frozen=True)
class Task:
    """One search as plain data.

    All randomness of a task comes from its own seed, so its result does not depend on the process
    that runs it, nor on when it runs.

    Attributes
    ----------
    scene
        Scene as TOML text.
    method, seed, budget, seconds
        See `optimize.search`; under a limit of seconds the result is not bitwise reproducible.
    labels
        Settings of a point of a sweep, such as {"physics.friction": 0.1}; empty otherwise.

    Raises
    ------
    ValueError
        If `seed` is no whole number.
    """

    scene: str
    method: str
    seed: int
    budget: int | None = None
    seconds: float | None = None
    labels: dict[str, Label] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require("seed", self.seed, 0, whole=True)
        for name, value in vars(self).items():
            if hasattr(value, "item"):  # a number of NumPy, which JSON does not have
                vars(self)[name] = value.item()

    @property
    def key(self) -> str:
        """Digest of everything that determines the result, so not of the labels."""
        determinants = self.scene, self.method, self.seed, self.budget, self.seconds
        return digest([*determinants, installed_versions()])

    @property
    def name(self) -> str:
        """Name of the task: labels or scene, method and seed."""
        problem = describe_labels(self.labels) or self.scene_name
        return f"{problem}, {self.method}, seed {self.seed}"

    @property
    def scene_name(self) -> str:
        """Name of the scene."""
        return read_scene(self.scene).name

    @property
    def limit(self) -> str:
        """Limit of the search in words."""
        return f"{self.seconds:g} s" if self.budget is None else amount(self.budget, "layout")

    def run(self, clock: Callable[[], float] = time.perf_counter) -> TaskResult:
        """Search, and return the result that an experiment stores.

        Parameters
        ----------
        clock
            See `optimize.search`.

        Returns
        -------
        TaskResult
            Result of the complete search.

        Raises
        ------
        ValueError
            See `optimize.search`.
        KeyboardInterrupt
            If the search was interrupted, as its result is not that of the task.
        """
        scene, seconds_before = scene_with_baseline(self.scene, self.seconds, clock)
        gradients = 0

        def count(evaluator: Evaluator) -> None:
            nonlocal gradients  # each counts GRADIENT_COST in the effort
            gradients = (evaluator.effort - evaluator.evaluations) // (GRADIENT_COST - 1)

        result = search(
            scene, self.method, self.budget, self.seed, seconds=self.seconds,
            progress=False, callback=count, clock=clock, seconds_before=seconds_before,
        )  # fmt: skip
        if result.interrupted:
            raise KeyboardInterrupt
        trace = zip(TRACE_COLUMNS, zip(*result.trace, strict=True), strict=True)
        return self.make_result(
            dict(trace), result.score, result.uniform.score, result.gain, result.wave,
            simulations=result.evaluations, gradients=gradients,
        )  # fmt: skip

    def software_versions(self) -> dict[str, str]:
        """Return the version of each software that a result may depend on, by name."""
        return versions()

    def make_result(
        self,
        trace: Mapping[str, ArrayLike],
        score: float,
        uniform_score: float,
        gain: float | None,
        wave: Wave | None = None,
        **work: int,
    ) -> TaskResult:
        """Return the result of this task.

        Parameters
        ----------
        trace
            See `TaskResult`; its last entries are the totals of the run.
        score, uniform_score, gain
            See `TaskResult`.
        wave
            Wave of the best layout; None if there is no layout.
        **work
            Counts that the trace does not have, see `TaskResult`.
        """
        values: dict[str, Any] = {}
        if wave is not None:
            values |= {"outcome": wave.outcome.name, "mean_speed": float(wave.mean_speed)}
            for part in ("spacing", "thickness", "height"):
                values[part] = tuple(getattr(wave.layout, part).tolist())
        columns = {name: np.array(column).tolist() for name, column in trace.items()}
        totals = {name: column[-1] for name, column in columns.items()}
        seconds, _ = totals.pop("seconds"), totals.pop("score")
        return TaskResult(
            key=self.key, scene_name=self.scene_name, method=self.method, seed=self.seed,
            score=float(score), uniform_score=float(uniform_score),
            gain=None if gain is None else float(gain),
            seconds=seconds, work=totals | work, trace=columns,
            labels=self.labels, versions=self.software_versions(), scene=self.scene, **values,
        )  # fmt: skip


def describe_labels(labels: Mapping[str, Label]) -> str:
    """Return labels as text, "key = value" each; empty without labels."""
    return ", ".join(f"{key} = {value}" for key, value in labels.items())


def digest(values: list[object]) -> str:
    """Return 32 hexadecimal digits that identify plain data."""
    return hashlib.sha256(json.dumps(values).encode()).hexdigest()[:32]


@cache
def installed_versions() -> dict[str, str]:
    """Return `versions`, read once in this process, as reading them takes milliseconds."""
    return versions()


@lru_cache(CACHED_SCENES)
def scene_with_baseline(
    text: str, seconds: float | None, clock: Callable[[], float]
) -> tuple[Scene, float]:
    """Return a scene with its uniform baseline, and the time that the baseline took [s].

    The baseline is computed once for all runs in this process, and its time counts towards the
    limit of each.

    Parameters
    ----------
    text
        Scene as TOML text.
    seconds, clock
        See `optimize.search`.
    """
    scene = parse_scene(text, "scene", "scene")
    compile_simulations(scene, gradients=True)
    start = clock()
    scene = with_baseline(scene, seconds)
    return scene, clock() - start


@lru_cache(CACHED_SCENES)
def read_scene(text: str) -> Scene:
    """Return the scene of a TOML text, without its uniform baseline."""
    return parse_scene(text, "scene", "scene")
