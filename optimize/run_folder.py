"""Folder of a run: the result of a search, readable without the program.

scene.toml     the scene
layout.csv     the best layout, one line per domino; layout.json, the same
trace.csv      evaluations, simulated falls, seconds, best score and largest derivative left (where
               the method uses gradients) at every improvement
summary.json   the result, SI units
result.png     the picture
journal.sqlite the evaluations of the search, from which it can resume; see `optimize.journal`
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from domino_env.core.files import naming, read_json, require_unused, require_writable, write_text
from domino_env.core.models import Document, model_of
from domino_env.core.progress import notice
from domino_env.core.results import versions
from domino_env.core.tables import write_csv
from domino_env.physics.layout import Layout
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from optimize.evaluator import Evaluator, Step
from optimize.result import SearchResult

PAUSE = 2.0  # [s] between two savings of the best so far
SCENE, SUMMARY, PICTURE = "scene.toml", "summary.json", "result.png"
FILES = (SCENE, "layout.csv", "layout.json", "trace.csv", SUMMARY, PICTURE)
JOURNAL = "journal.sqlite"
# Files that other commands make of a run, outdated once it has another layout.
DERIVED = ("report.html", "verification.json", "layout.pdf", "layout.wav")


class SummaryDocument(Document):
    """Part of the summary that identifies the search of a folder."""

    method: str
    seed: int
    versions: dict[str, str]
    evaluations: Annotated[int, Meta(ge=0)] = 0


class RunFolder:
    """The folder of one run.

    It may hold other files. The files of a run that resumes are replaced once it has come as far as
    before; each is replaced in one step, so that no reader finds a half-written file.

    Parameters
    ----------
    path
        The folder.
    scene, method, seed
        As of `optimize.search`.
    resume
        Continue with the run in the folder, if there is one.

    Raises
    ------
    ValueError
        For a file, a folder that cannot be written, one that holds a run (without `resume`) or
        another search.
    """

    def __init__(
        self, path: Path, scene: Scene, method: str, seed: int, *, resume: bool = False
    ) -> None:
        self.path = path
        self.scene = scene
        self.method = method
        self.seed = seed
        self._saved = self._score = float("-inf")
        self._resume = resume
        self._before = self._spent_before() if resume else 0
        require_writable(path)
        if not resume:
            require_unused(path, FILES)
        path.mkdir(parents=True, exist_ok=True)

    def save(self, evaluator: Evaluator) -> None:
        """Save the best so far, if it is new and the last save some seconds old."""
        if evaluator.best_score == self._score or time.monotonic() - self._saved < PAUSE:
            return
        if evaluator.evaluations < self._before:  # the files there are better
            return
        self._saved, self._score = time.monotonic(), evaluator.best_score
        layout = evaluator.problem.layout(evaluator.best)
        document = {
            "finished": False,
            "scene": self.scene.name,
            "method": self.method,
            "seed": self.seed,
            "score": evaluator.best_score,
            "evaluations": evaluator.evaluations,
            "simulated_falls": evaluator.falls,
            "seconds": evaluator.seconds,
            "versions": versions(),
        }
        with suppress(OSError):  # a disk that is full now may have room at the end
            self._write(layout, evaluator.trace, document)

    def finish(self, result: SearchResult) -> None:
        """Write the result, its picture and its summary.

        Raises
        ------
        ValueError
            Where that fails, or where the search has not come as far as the run in the folder,
            which then stays as it is.
        KeyboardInterrupt
            Where it was interrupted before it had come as far.
        """
        if result.evaluations < self._before:
            error = KeyboardInterrupt if result.interrupted else ValueError
            raise error(
                f"{self.path} holds more of this search, {self._before} evaluations, than "
                f"{result.evaluations} of them: what is there stays; give more to go on"
            )
        document = {"finished": True} | result.summary()
        try:
            self._write(result.layout, result.trace, document, result)
        except OSError as error:
            raise ValueError(f"{error}; make room, and continue with --resume") from None

    def _write(
        self,
        layout: Layout,
        trace: Sequence[Step],
        document: dict[str, Any],
        result: SearchResult | None = None,
    ) -> None:
        """Write all files, the summary, which says how far they are, last."""
        write_text(self.path / SCENE, self.scene.to_toml())
        if self._resume:
            self._remove_outdated(layout)
        layout.to_csv(self.path / "layout.csv")
        layout.to_json(self.path / "layout.json")
        names = ("evaluations", "simulated_falls", "seconds", "best_score")
        lines = ((n, falls, f"{t:.6f}", score) for n, falls, t, score in trace)
        write_csv(self.path / "trace.csv", names, lines)
        if result is not None:
            from domino_env.core.plot_style import write_png

            write_png(result.figure(), self.path / PICTURE)
        text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
        write_text(self.path / SUMMARY, text + "\n")

    def _remove_outdated(self, layout: Layout) -> None:
        """Remove files that other commands made of another layout, and log their names."""
        with suppress(OSError, ValueError):
            if Layout.read(self.path / "layout.json") == layout:
                return
        outdated = [name for name in DERIVED if (self.path / name).exists()]
        for name in (PICTURE, *outdated):
            (self.path / name).unlink(missing_ok=True)
        if outdated:
            notice(f"{self.path}: removed {', '.join(outdated)}, made of an earlier layout")

    def _spent_before(self) -> int:
        """Return the evaluations of the run in the folder; 0 where there is none."""
        path = self.path / SUMMARY
        if not path.exists():
            return 0
        with naming(path):
            known = model_of(SummaryDocument, read_json(path))
        here = (self.method, self.seed, versions(), self.scene)
        if (known.method, known.seed, known.versions, load_scene(self.path / SCENE)) != here:
            raise ValueError(
                f"{self.path} holds a search by {known.method} with seed {known.seed}, or of "
                "another scene or version of the software: begin anew in another folder, without "
                "--resume"
            )
        return known.evaluations
