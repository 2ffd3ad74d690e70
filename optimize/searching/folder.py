"""A run's folder: everything a search found, readable without the program, written whole.

scene.toml     the scene
layout.csv     the best row, a line a domino; layout.json, the same
trace.csv      evaluations, simulated falls, seconds, best score and steepest slope left (where the
               method asks for gradients) at every improvement
summary.json   what came out, SI units
result.png     the picture
journal.sqlite what the search was told, so that it can go on; see
               `optimize.evaluation.journal`
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
from typing import Any

from domino_env.chain.layout import Layout
from domino_env.scenes.scene import Scene
from domino_env.support.files import require_room, write_text
from domino_env.support.provenance import versions
from domino_env.support.tables import write_csv
from optimize.evaluation.budget import Budget, Step
from optimize.evaluation.result import SearchResult

PAUSE = 2.0  # [s] between two savings of the best so far
SUMMARY = "summary.json"
FILES = ("scene.toml", "layout.csv", "layout.json", "trace.csv", SUMMARY, "result.png")
JOURNAL = "journal.sqlite"
OLD_JOURNAL = "journal.bin"  # of version 0.1.0
STAGE = ".new-"  # how the folder begins in which files wait for each other
# what other commands make of a run, and would be stale beside the next one
DERIVED = ("report.html", "verification.json", "layout.pdf", "layout.wav", OLD_JOURNAL)


class RunFolder:
    """The folder of one run.

    A new or empty folder, or that of an earlier run, whose files are replaced once this one has
    something to keep, all at once: a full disk leaves the earlier ones as they are.

    Parameters
    ----------
    path
        The folder.
    scene, method, seed
        Of the search, as of `optimize.search`.
    resume
        Go on with the run that is there, if there is one.

    Attributes
    ----------
    journal
        Path of the search's journal.

    Raises
    ------
    ValueError
        Before any time is spent: for a folder that holds anything else or that cannot be written,
        and, with `resume`, for the journal of version 0.1.0.
    """

    def __init__(
        self, path: Path, scene: Scene, method: str, seed: int, *, resume: bool = False
    ) -> None:
        self.path = path
        self.scene = scene
        self.method = method
        self.seed = seed
        self._saved = float("-inf")
        self._score = float("-inf")
        self._begun = False
        if path.exists() and not path.is_dir():
            raise ValueError(f"{path} is a file: name a folder for the run")
        if path.is_dir():
            _require_a_run(path)
        require_room(path)
        self.journal = path / JOURNAL
        if resume and (path / OLD_JOURNAL).exists() and not self.journal.exists():
            raise ValueError(
                f"{path / OLD_JOURNAL} was written by version 0.1.0, and only that can go on with "
                "its search: begin anew, without --resume"
            )

    def save(self, budget: Budget) -> None:
        """Keep the best so far, if there is a new one and the last saving is some seconds old.

        A run that is killed thus loses a few seconds.
        """
        if budget.best_score == self._score or time.monotonic() - self._saved < PAUSE:
            return
        if budget.replaying:  # what is here is better
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
            Where that cannot be; what was there before is intact then.
        """
        from optimize.searching.picture import draw

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

        The first time, all of an earlier run go: none of it passes for a file of this one.
        """
        stage = self.path / f"{STAGE}{os.getpid()}-{secrets.token_hex(4)}"
        try:
            stage.mkdir(parents=True)
            yield stage
            if not self._begun:
                write_text(stage / "scene.toml", self.scene.to_toml())
                for name in (*FILES, *DERIVED):
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

    def _summarise(self, stage: Path, document: dict[str, Any]) -> None:
        text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
        write_text(stage / SUMMARY, text + "\n")


def _require_a_run(path: Path) -> None:
    """Refuse a folder whose files are not all those of an earlier run."""
    names = sorted(f.name for f in path.iterdir() if not f.name.startswith("."))
    # with those that a kill leaves beside it
    journals = [name for name in names if name.startswith(JOURNAL) or name == OLD_JOURNAL]
    others = [name for name in names if name not in (*FILES, *DERIVED, *journals)]
    # one that was killed at its very beginning has nothing but a journal
    if names and (others or not (journals or SUMMARY in names)):
        raise ValueError(
            f"{path} holds {(others or names)[0]} and is no run's folder: name another one"
        )


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
        "error_estimate": wave.error_estimate,
        "converged": wave.converged,
        "lowest_stall_margin": float(min(m for m in wave.stall_margin if m == m)),
        "flushes": wave.flushes,
        "releases": wave.releases,
        "largest_flush_loss": wave.largest_flush_loss,
        "versions": versions(),
    }
