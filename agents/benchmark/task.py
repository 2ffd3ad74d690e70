"""One run of a benchmark: an algorithm that learns, a scripted policy or a search, on one scene."""

from __future__ import annotations

import csv
import hashlib
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from importlib import import_module
from pathlib import Path

from agents.base.building import Built
from agents.base.run_files import CONFIG, PROGRESS, SUMMARY, is_finished
from agents.evaluation.one_scene import evaluate
from agents.sb3.presets import ALGORITHMS, Preset, preset
from agents.single.scripted import SCRIPTED
from agents.single.training import train
from domino_env.support.provenance import versions
from domino_env.support.reading import read_json
from optimize.evaluation.budget import Budget, Step
from optimize.searching.compiling import compile_for
from optimize.studies.task import Task, TaskResult, scene_of


@dataclass(frozen=True)
class BenchmarkTask(Task):
    """One run of a benchmark.

    `method` is an algorithm of `domino train`, a scripted policy, or a method of a search;
    `seconds` limit a search alone.  All times of its result are processor time [s].  Where it
    trains, `evaluations` of its result are dominoes placed, not rows.

    Attributes
    ----------
    steps
        Dominoes that a training may place at most; None for the preset's.
    home
        Folder in which trainings have a folder each.
    """

    steps: int | None = None
    home: str = "runs/benchmark"

    @property
    def trains(self) -> bool:
        """Whether an algorithm learns."""
        return self.method in ALGORITHMS

    @property
    def plan(self) -> Preset:
        """Preset of a training, with its steps."""
        plan = preset(self.method, scene_of(self.scene).count - 1)
        return plan if self.steps is None else replace(plan, steps=min(plan.steps, self.steps))

    @property
    def key(self) -> str:
        """A digest of all that decides the result; of a training, the preset too."""
        decisive = [self.scene, self.method, self.seed]
        if self.trains:
            defaults = {field.name: field.default for field in fields(Preset)}
            plan = self.plan.to_dict().items()
            decisive += [sorted((k, v) for k, v in plan if v != defaults[k])]
        elif self.method not in SCRIPTED:
            decisive += [self.seconds]
        return hashlib.sha256(json.dumps(["benchmark", *decisive]).encode()).hexdigest()[:32]

    @property
    def folder(self) -> Path:
        """Where a training is kept: another preset, another folder."""
        name = scene_of(self.scene).name
        return Path(self.home) / f"{name}-{self.method}-{self.seed}-{self.key[:6]}"

    def run(
        self, watch: Callable[[Budget], None] | None = None, *, progress: bool | None = False
    ) -> TaskResult:
        """Train and evaluate, build, or search; a training that was stopped goes on.

        Parameters
        ----------
        watch, progress
            As of `optimize.search`; of a search alone.

        Raises
        ------
        KeyboardInterrupt
            Where it is ended by hand.
        """
        compile_for(scene_of(self.scene), gradients=True, episodes=True)  # before any clock
        if self.trains:
            return self._trained()
        if self.method in SCRIPTED:
            began = time.process_time()
            built = evaluate(self.method, scene_of(self.scene))
            return self._result(built, 1, [(1, 1, time.process_time() - began, built.score)])
        return self.searched(time.process_time, watch, progress)

    def _trained(self) -> TaskResult:
        scene, folder = scene_of(self.scene), self.folder
        if not is_finished(folder):
            begun = (folder / CONFIG).exists()
            if begun and self.method == "ars":  # keeps nothing to go on from, and takes seconds
                shutil.rmtree(folder)
                begun = False
            import_module("torch._dynamo")  # as the first optimiser would, on the clock
            done = train(scene, self.method, None, self.seed, folder, resume=begun, plan=self.plan)
            if done.interrupted:
                raise KeyboardInterrupt
        steps = int(read_json(folder / SUMMARY)["steps"])
        return self._result(evaluate(folder, scene), steps, curve(folder))

    def _result(self, built: Built, evaluations: int, trace: list[Step]) -> TaskResult:
        return TaskResult(
            key=self.key,
            scene_name=built.scene.name,
            method=self.method,
            seed=self.seed,
            score=built.score,
            uniform_score=built.uniform.score,
            gain=built.gain,
            outcome=built.wave.outcome.name,
            mean_speed=built.wave.mean_speed,
            spacing=built.layout.spacing,
            thickness=built.layout.thickness,
            height=built.layout.height,
            evaluations=evaluations,
            falls=trace[-1][1],
            seconds=trace[-1][2],
            trace=trace,
            labels=self.labels,
            versions=versions(),
            scene=self.scene,
        )


def curve(folder: Path) -> list[Step]:
    """Read the learning curve of a training.

    Returns
    -------
    list of tuple
        (dominoes placed, falls simulated, processor seconds, best score), at every improvement and
        at the end: the trace of a search.
    """
    with (folder / PROGRESS).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    trace: list[Step] = []
    for row in rows:
        steps = int(float(row["steps"]))
        best, seconds = float(row["best_score"]), float(row["processor_seconds"])
        if not trace or best > trace[-1][3] or row is rows[-1]:
            trace.append((steps, steps, seconds, best))
    return trace
