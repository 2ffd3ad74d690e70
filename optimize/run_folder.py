"""Folder of a run: the result of a search, readable without the program.

scene.toml     the scene
layout.csv     the best layout, one line per domino; layout.json: the same data
trace.csv      evaluations, simulated intervals between hits, seconds and best score at every
               improvement and at the end
summary.json   the result, SI units
result.png     drawing of the layout, its wave and the progress of the search
journal.sqlite the evaluations of the search, from which it can resume; see `optimize.journal`
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from domino_env.core.files import require_unused, require_writable, write_text
from domino_env.core.models import Document, read_document
from domino_env.core.results import versions
from domino_env.core.tables import write_csv
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from optimize.result import SearchResult

SCENE, SUMMARY, PICTURE = "scene.toml", "summary.json", "result.png"
FILES = (SCENE, "layout.csv", "layout.json", "trace.csv", SUMMARY, PICTURE)
JOURNAL = "journal.sqlite"


class SummaryDocument(Document):
    """Part of the summary that identifies the search of a folder, and its evaluations."""

    method: str
    seed: int | None
    versions: dict[str, str]
    evaluations: Annotated[int, Meta(ge=0)] = 0


def begin_run(
    folder: Path, scene: Scene, method: str, seed: int | None, *, resume: bool = False
) -> int:
    """Prepare the folder of a run, which may hold other files.

    Parameters
    ----------
    folder
        Folder of the run; created if missing.
    scene, method, seed
        See `optimize.search`.
    resume
        True to continue a run in the folder.

    Returns
    -------
    int
        Number of evaluations of the run in the folder; 0 if the folder has no summary.

    Raises
    ------
    ValueError
        If the folder is a file or cannot be written, if it holds another search, or if it holds a
        run and `resume` is false.
    """
    require_writable(folder)
    if not resume:
        require_unused(folder, (*FILES, JOURNAL))
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / SUMMARY
    if not path.exists():
        return 0
    summary = read_document(SummaryDocument, path)
    identity = (method, seed, versions(), scene)
    if (summary.method, summary.seed, summary.versions, load_scene(folder / SCENE)) != identity:
        raise ValueError(
            f"{folder} holds another search, by {summary.method} with seed {summary.seed} (or its "
            "scene or versions differ): begin anew in another folder, without --resume"
        )
    return summary.evaluations


def write_run(folder: Path, result: SearchResult, evaluations_before: int) -> None:
    """Write the result of a search, the summary last.

    Each file is replaced in one step, so that no file is ever incomplete.

    Parameters
    ----------
    folder
        Folder prepared by `begin_run`.
    result
        Result of the search.
    evaluations_before
        Number of evaluations of the run in the folder, as returned by `begin_run`.

    Raises
    ------
    ValueError
        If writing fails, or if the run in the folder has more evaluations; in the second case no
        file is changed.
    KeyboardInterrupt
        If the search was interrupted with fewer evaluations than the run in the folder; no file is
        changed.
    """
    if result.evaluations < evaluations_before:
        error = KeyboardInterrupt if result.interrupted else ValueError
        raise error(
            f"{folder} holds {evaluations_before} evaluations of this search and stays as it is: "
            f"this run ended after {result.evaluations}; give it a larger budget or more seconds"
        )
    from domino_env.core.plot_style import write_png

    try:
        write_text(folder / SCENE, result.scene.to_toml())
        result.layout.to_csv(folder / "layout.csv")
        result.layout.to_json(folder / "layout.json")
        names = ("evaluations", "simulated_falls", "seconds", "best_score")
        lines = ((n, falls, f"{t:.6f}", score) for n, falls, t, score in result.trace)
        write_csv(folder / "trace.csv", names, lines)
        write_png(result.figure(), folder / PICTURE)
        document = {"finished": True} | result.summary()
        text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
        write_text(folder / SUMMARY, text + "\n")
    except OSError as error:
        raise ValueError(f"{error}; free disk space or allow writing, then use --resume") from None
