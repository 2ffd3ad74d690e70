"""A run's folder: everything a search found, readable without the program, written whole.

scene.toml     the scene
layout.csv     the best row, a line a domino; layout.json, the same
trace.csv      evaluations, simulated falls, seconds, best score and steepest slope left (where the
               method asks for gradients) at every improvement
summary.json   what came out, SI units
result.png     the picture
journal.sqlite what the search was told, so that it can go on; see
               `optimize.journal`
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from domino_env.core.files import require_none, require_room, write_text
from domino_env.core.models import Document, model_of
from domino_env.core.reading import naming, read_json
from domino_env.core.results import versions
from domino_env.core.tables import write_csv
from domino_env.physics.layout import Layout
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from optimize.evaluator import Budget, Step
from optimize.result import SearchResult

PAUSE = 2.0  # [s] between two savings of the best so far
SCENE, SUMMARY = "scene.toml", "summary.json"
FILES = (SCENE, "layout.csv", "layout.json", "trace.csv", SUMMARY, "result.png")
JOURNAL = "journal.sqlite"
OLD_JOURNAL = "journal.bin"  # of version 0.1.0
STAGE = ".new-"  # how the folder begins in which files wait for each other
# what other commands make of a run, and would be stale once it has gone on
DERIVED = ("report.html", "verification.json", "layout.pdf", "layout.wav")


class SummaryDocument(Document):
    """What is read of the summary of a run that goes on."""

    method: str
    seed: int
    evaluations: Annotated[int, Meta(ge=0)] = 0


def require_place(path: Path, *, resume: bool) -> None:
    """Refuse what no run can be written into; the folder is made if need be.

    Parameters
    ----------
    path
        The folder.
    resume
        Whether it may hold a run.

    Raises
    ------
    ValueError
        For a file, a folder that cannot be written or, without `resume`, one that holds a run.
    """
    if path.exists() and not path.is_dir():
        raise ValueError(f"{path} is a file: name a folder for the run")
    if not resume:
        require_none(path, FILES)
    require_room(path)


class RunFolder:
    """The folder of one run.

    It may hold other files, but none by the name of one of a run's, unless that run goes on: then
    they are replaced once there is something to keep that has come as far, all at once. A full disk
    leaves the earlier ones as they are.

    Parameters
    ----------
    path
        The folder.
    scene, method, seed
        Of the search, as of `optimize.search`.
    resume
        Go on with the run that is there, if there is one.
    evaluations
        Budget of the search; None where there is no such limit.

    Attributes
    ----------
    journal
        Path of the search's journal.

    Raises
    ------
    ValueError
        Before any time is spent: for a folder that holds another run or that cannot be written,
        and, with `resume`, for a smaller budget than is spent, and the journal of version 0.1.0.
    """

    def __init__(
        self, path: Path, scene: Scene, method: str, seed: int, *, resume: bool = False,
        evaluations: int | None = None,
    ) -> None:  # fmt: skip
        self.path = path
        self.scene = scene
        self.method = method
        self.seed = seed
        self._saved = float("-inf")
        self._score = float("-inf")
        self._begun = False
        self.journal = path / JOURNAL
        self._resume = resume
        self._before = self._spent_before() if resume else 0
        require_place(path, resume=resume)
        if evaluations is not None and evaluations < self._before:
            raise ValueError(
                f"{path} holds a search that has spent {self._before} evaluations: give more than "
                f"{evaluations} to go on with it"
            )
        if resume and (path / OLD_JOURNAL).exists() and not self.journal.exists():
            raise ValueError(
                f"{path / OLD_JOURNAL} was written by version 0.1.0, and only that can go on with "
                "its search: begin anew in another folder, without --resume"
            )

    def save(self, budget: Budget) -> None:
        """Keep the best so far, if there is a new one and the last saving is some seconds old.

        A run that is killed thus loses a few seconds.
        """
        if budget.best_score == self._score or time.monotonic() - self._saved < PAUSE:
            return
        if budget.replaying or budget.spent < self._before:  # what is here is better
            return
        self._saved, self._score = time.monotonic(), budget.best_score
        # a full disk now may have room at the end, and must not cost the search
        with suppress(OSError), self._together() as stage:
            self._keep(stage, budget.problem.layout(budget.best), budget.trace, budget.slopes)
            self._summarise(
                stage,
                {
                    "finished": False,
                    "scene": self.scene.name,
                    "method": self.method,
                    "seed": self.seed,
                    "score": budget.best_score,
                    "evaluations": budget.spent,
                    "simulated_falls": budget.falls,
                    "seconds": budget.elapsed,
                    "versions": versions(),
                },
            )

    def finish(self, result: SearchResult) -> None:
        """Write the result, its picture and its summary.

        Raises
        ------
        ValueError
            Where that cannot be, or where the search did not come as far as the one that it went on
            with; what was there before is intact then.
        KeyboardInterrupt
            Where it was interrupted before it came as far.
        """
        from optimize.picture import draw

        if result.evaluations < self._before:
            said = (
                f"{self.path} holds more of this search, {self._before} evaluations, than "
                f"{result.evaluations} of them: what is there stays"
            )
            if result.interrupted:
                raise KeyboardInterrupt(f"interrupted: {said}")
            raise ValueError(f"{said}; give more time to go on")
        try:
            with self._together() as stage:
                self._keep(stage, result.layout, result.trace, result.slopes)
                draw(result, stage / "result.png")
                self._summarise(stage, {"finished": True} | summary(result))
        except OSError as error:
            raise ValueError(
                f"{self.path}: the result cannot be written: {error.strerror or error}; what was "
                "there is intact: make room, and go on with --resume"
            ) from None

    @contextmanager
    def _together(self) -> Iterator[Path]:
        """A folder to write into, all of whose files then replace those of the run.

        The first time, all that there was of the run goes: none of it passes for the newer.
        """
        stage = self.path / f"{STAGE}{os.getpid()}-{secrets.token_hex(4)}"
        try:
            stage.mkdir(parents=True)
            yield stage
            if not self._begun:
                write_text(stage / SCENE, self.scene.to_toml())
                for name in (*FILES, *DERIVED) if self._resume else ():
                    (self.path / name).unlink(missing_ok=True)
                for left in self.path.glob(f"{STAGE}*"):  # by a run that was killed
                    if left != stage:
                        shutil.rmtree(left, ignore_errors=True)
                self._begun = True
            for name in FILES:
                if (stage / name).exists():
                    (stage / name).replace(self.path / name)
        finally:
            shutil.rmtree(stage, ignore_errors=True)

    def _keep(
        self, stage: Path, layout: Layout, trace: Sequence[Step], slopes: Sequence[float | None]
    ) -> None:
        layout.to_csv(stage / "layout.csv")
        layout.to_json(stage / "layout.json")
        names = ("evaluations", "simulated_falls", "seconds", "best_score", "slope_left")
        rows = (
            (n, falls, f"{t:.6f}", score, None if slope is None else f"{slope:.3e}")
            for (n, falls, t, score), slope in zip(trace, slopes, strict=True)
        )
        write_csv(stage / "trace.csv", names, rows)

    def _spent_before(self) -> int:
        """The evaluations of the run that is there; 0 where there is none.

        A journal knows itself of which search it is.
        """
        path = self.path / SUMMARY
        if not path.exists():
            return 0
        with naming(path):
            found = model_of(SummaryDocument, read_json(path))
        if not self.journal.exists():
            ours = self.method, self.seed
            if (found.method, found.seed) != ours or load_scene(self.path / SCENE) != self.scene:
                raise ValueError(
                    f"{self.path} holds a run of another search ({found.method}, seed "
                    f"{found.seed}): name another folder"
                )
        return found.evaluations

    def _summarise(self, stage: Path, document: dict[str, Any]) -> None:
        text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
        write_text(stage / SUMMARY, text + "\n")


def summary(result: SearchResult) -> dict[str, Any]:
    """Give what summary.json holds of a result; SI units."""
    wave, mark = result.wave, result.uniform
    return {
        "scene": result.scene.name,
        "method": result.method,
        "seed": result.seed,
        "outcome": wave.outcome.name,
        "explanation": wave.explanation,
        "score": result.score,
        "score_in_words": result.scene.in_words(result.score, wave),
        "mean_speed": wave.mean_speed,
        "uniform_mean_speed": mark.wave.mean_speed,
        "gain": result.gain,
        "length": result.layout.length,
        "total_time": float(wave.arrival_times[-1]) if wave.mean_speed > 0.0 else None,
        "uniform_outcome": mark.wave.outcome.name,
        "uniform_score": mark.score,
        "uniform_spacing": float(mark.layout.spacing[0]),
        "uniform_thickness": float(mark.layout.thickness[-1]),
        "evaluations": result.evaluations,
        "simulated_falls": result.falls,
        "seconds": result.seconds,
        "interrupted": result.interrupted,
        "ended": result.ended,
        "error_estimate": wave.error_estimate,
        "converged": wave.converged,
        "lowest_stall_margin": float(min(m for m in wave.stall_margin if m == m)),
        "flushes": wave.flushes,
        "releases": wave.releases,
        "largest_flush_loss": wave.largest_flush_loss,
        "versions": versions(),
    }
