"""Report: one page that compares layouts in an animation, and shows why one is faster.

The page contains its data, scripts and styles, and needs neither network nor server. Layouts are
read from files and from run folders, with the curves in these folders.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from domino_env.core.checks import require
from domino_env.core.files import errors_with_path, layout_name, one_line, read_text, write_text
from domino_env.core.progress import notice
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import simulate
from domino_env.rigid.known import known_verification
from domino_env.rigid.simulation import floor_name
from domino_env.scenes.io.reading import common_scene, read_layout
from domino_env.scenes.scene import Scene
from domino_env.view.animation import require_drawable
from domino_env.view.comparison import ComparedLayout, comparison_data

MAX_NAME = 100  # characters of a layout's name


def write_report(compared: Sequence[ComparedLayout], title: str, path: Path) -> int:
    """Write the report page.

    Parameters
    ----------
    compared
        Layouts with their waves.
    title
        Title of the page.
    path
        Output file, HTML.

    Returns
    -------
    int
        Size of the page [bytes].

    Raises
    ------
    ValueError
        For a layout of one domino.
    """

    def read(name: str) -> str:
        return read_text(Path(__file__).with_name("assets") / name)

    data = json.dumps(comparison_data(compared), allow_nan=False, separators=(",", ":"))
    parts = {
        "title": escape(title),
        "styles": read("uPlot.min.css") + read("report.css"),
        "licence": escape(read("uPlot.LICENSE")),
        # "</script" would end the script early, "<!--" could prevent its end
        "data": data.replace("<", "\\u003c"),
        "charts": read("uPlot.iife.min.js"),
        "motion": read("motion.js"),
        "comparison": read("comparison.js"),
    }
    # in one pass, as data may contain {{comparison}} in the name of a layout
    page = re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], read("report.html"))
    write_text(path, page)
    return len(page.encode())


def read_compared(
    paths: Sequence[Path], scene: Scene | None = None, physics: Physics | None = None
) -> tuple[list[ComparedLayout], str]:
    """Read the compared layouts from files and run folders, and simulate them.

    The curve of a search or training is read from its folder; shipped layouts have a shipped
    verification. If there is a scene, and a layout has as many dominoes, its uniform baseline is
    the last entry. A layout that breaks the rules of the scene has no score, and a notice gives the
    reason.

    Parameters
    ----------
    paths
        Layout files and run folders.
    scene
        Scene of all layouts; None for the one in the folders, or beside the files.
    physics
        Physics instead of those of the scene; scores are then left out. None for those of the
        scene, or without a scene the defaults of `Physics`.

    Returns
    -------
    compared : list of ComparedLayout
        Layouts with their waves.
    title : str
        Title for the page.

    Raises
    ------
    ValueError
        For a folder without a layout.csv, runs of different scenes, a file with wrong content, and
        a chain of more than 5 000 dominoes.
    """
    scene = scene or common_scene(paths)
    scoring_scene = scene if physics is None else None  # other physics are another problem
    physics = physics or (scene.physics if scene else Physics())
    compared, has_baseline = [], False
    for path in paths:
        folder = path if path.is_dir() else None
        layout = read_layout(path, scene)
        require_drawable(one_line(str(path)), layout.count)
        entry = ComparedLayout(
            one_line(path.resolve().name, MAX_NAME) if folder else layout_name(path),
            simulate(scene.row(layout) if scene else layout, physics),
            _curve(folder, "trace.csv", "seconds", "best_score"),
            _curve(folder, "progress.csv", "steps", "score"),
            _verification(layout, physics),
        )
        if scene and (violations := scene.violations(layout)):
            notice(f"{one_line(str(path))}: not a layout of scene '{scene.name}': {violations[0]}")
        elif scoring_scene:
            entry = _with_score(entry, scoring_scene)
        has_baseline |= scene is not None and layout.count == scene.count
        compared.append(entry)
    if scene and has_baseline:
        baseline = scene.uniform()
        wave = baseline.wave if scoring_scene else simulate(scene.row(baseline.layout), physics)
        entry = ComparedLayout("uniform baseline", wave)
        compared.append(_with_score(entry, scene, baseline.score) if scoring_scene else entry)
    return compared, scene.title if scene else "layouts without a scene"


def _with_score(entry: ComparedLayout, scene: Scene, score: float | None = None) -> ComparedLayout:
    """Return a compared layout with its score in the scene, which is computed if None is given."""
    score = scene.score(entry.wave) if score is None else score
    text, criterion = scene.format_score(score, entry.wave), scene.criterion
    curves: dict[str, Any] = {}
    for name in ("trace", "learning"):
        if curve := getattr(entry, name):
            table = np.array([curve[0], criterion.displayed(curve[1])])
            curves[name] = tuple(table[:, np.isfinite(table[1])].tolist())
    quantity = criterion.quantity()
    return replace(entry, score=score, score_text=text, quantity=quantity, **curves)


def _curve(
    folder: Path | None, name: str, x_column: str, y_column: str
) -> tuple[list[float], list[float]] | None:
    """Return two columns of a CSV file in a run folder; None if there is no such file."""
    if folder is None or not (folder / name).exists():
        return None
    path = folder / name
    with errors_with_path(path):
        table = np.genfromtxt(io.StringIO(read_text(path)), delimiter=",", names=True, ndmin=1)
        for column in (x_column, y_column):
            if column not in (table.dtype.names or ()):
                raise ValueError(f"no column {column}: remove the file, or write that of the run")
            require(column, table[column], array=True)
        return table[x_column].tolist(), table[y_column].tolist()


def _verification(layout: Layout, physics: Physics) -> dict[str, Any] | None:
    """Return the shipped verification of a layout; None if there is none."""
    known = known_verification(layout, physics)
    if known is None:
        return None
    last = [(floor_name(check.floor), check.last) for check in known.floors]
    return {"simulator": known.checks[0].simulator, "verdict": known.verdict, "last": last}
