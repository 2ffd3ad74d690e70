"""Report: one page that plays layouts against each other, and shows why one wins.

The page needs no network and no server: data, scripts and styles are inside it. Layouts come from
files and folders of runs, with what the folders hold of them.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from domino_env.core.files import (
    decoded,
    naming,
    one_line,
    read_bytes,
    read_json,
    shown,
    write_text,
)
from domino_env.core.models import Document, Number, model_of
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import simulate
from domino_env.rigid.known import known_verification
from domino_env.rigid.simulation import floor_name
from domino_env.scenes.io.reading import common_scene, read_layout
from domino_env.scenes.scene import Scene
from domino_env.view.animation import require_drawable
from domino_env.view.race import Racer, race_data

MARK = "best uniform row"

Times = tuple[Number | None, ...]


class SummaryDocument(Document):
    """What is read of a run's summary.json."""

    algorithm: str | None = None
    method: str | None = None


class FloorDocument(Document):
    """One floor of a run's verification.json."""

    arrivals: Times
    floor: Number | None = None
    difference: Number | None = None


class VerificationDocument(Document):
    """What is read of a run's verification.json; differences are judge over model - 1 [1]."""

    engine: str
    verdict: str
    model: Annotated[Times, Meta(description="when each domino is hit [s]")] = ()
    floors: tuple[FloorDocument, ...] = ()


def write_report(racers: Sequence[Racer], title: str, path: Path) -> int:
    """Write the page whole, and return its size [bytes]."""
    assets = files("domino_env.view") / "assets"

    def read(name: str) -> str:
        return (assets / name).read_text("utf-8")

    data = json.dumps(race_data(racers), allow_nan=False, separators=(",", ":"))
    parts = {
        "title": escape(title),
        "styles": read("uPlot.min.css") + read("report.css"),
        "licence": escape(read("uPlot.LICENSE")),
        # "</script" would end the script early, "<!--" could keep it from ending
        "data": data.replace("<", "\\u003c"),
        "charts": read("uPlot.iife.min.js"),
        "race": read("race.js"),
    }
    # in one go: a row may be called {{race}}
    page = re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], read("report.html"))
    write_text(path, page)
    return len(page.encode())


def read_racers(
    paths: Sequence[Path], scene: Scene | None = None, physics: Physics | None = None
) -> tuple[list[Racer], str]:
    """Read the rows to race, and a title, from layout files and folders of runs.

    A run, of a search or of a training, brings its curve and, if `domino verify --json`
    wrote one there, its verification.json; rows that ship bring the verification that is kept of
    them. Where there is a scene its best uniform row races too, last.

    Parameters
    ----------
    paths
        Files of layouts and folders of runs.
    scene
        The scene of all; None for the one in the runs' folders, or beside the layouts.
    physics
        Instead of the scene's.

    Raises
    ------
    ValueError
        For a folder without a layout.csv, and for runs of different scenes.
    """
    scene = scene or common_scene(paths)
    found: list[tuple[str, Layout, Path | None]] = []
    for path in paths:
        if not path.is_dir():
            found.append((one_line(path.stem, 100), _shown_layout(path, scene), None))
            continue
        if not (path / "layout.csv").exists():
            raise ValueError(f"{path}: no layout.csv in this folder; give a run or a layout file")
        row = _shown_layout(path / "layout.csv", scene)
        found.append((one_line(_called(path), 100), row, path))
    names = [name for name, _, _ in found]
    judged = scene is not None and physics is None  # another physics is another problem
    physics = physics or (scene.physics if scene else Physics())
    unit = scene.unit if scene and judged else "m/s"
    racers = []
    for (name, layout, folder), path in zip(found, paths, strict=True):
        wave = simulate(layout, physics)
        # two runs of one kind are told apart by their folders
        label = name if names.count(name) == 1 else f"{name} ({one_line(path.resolve().name, 100)})"
        score = worth = None
        if judged and scene and not scene.violations(layout):
            score = scene.score(wave)
            worth = scene.in_words(score, wave)
        racers.append(
            Racer(
                label,
                wave,
                _curve(folder, "trace.csv", "seconds", "best_score"),
                _curve(folder, "progress.csv", "steps", "score"),
                _verification(folder, layout, physics),
                score,
                worth,
                unit,
            )
        )
    if scene and judged:
        mark = scene.uniform()
        worth = scene.in_words(mark.score, mark.wave)
        racers.append(Racer(MARK, mark.wave, score=mark.score, worth=worth, unit=unit))
    elif scene:
        racers.append(Racer(MARK, simulate(scene.uniform().layout, physics)))
    return racers, scene.title if scene else "race"


def _shown_layout(path: Path, scene: Scene | None) -> Layout:
    layout = read_layout(path, scene)
    require_drawable(one_line(str(path)), layout.count)
    return layout


def _called(folder: Path) -> str:
    """What a run's row is called: by what made it, if the folder says so."""
    path = folder / "summary.json"
    if path.exists():
        with naming(path):
            told = model_of(SummaryDocument, read_json(path))
        if told.algorithm is not None:
            return f"{one_line(told.algorithm, 20).upper()} agent's row"
        if told.method is not None:
            return "optimised row"
    return folder.resolve().name


def _curve(
    folder: Path | None, name: str, across: str, up: str
) -> tuple[list[float], list[float]] | None:
    """Two columns of a CSV file in a run's folder; None where there is no such file."""
    if folder is None or not (folder / name).exists():
        return None
    path = folder / name
    with naming(path):
        text = decoded(read_bytes(path))
        found: tuple[list[float], list[float]] = [], []
        reader = csv.DictReader(io.StringIO(text, newline=""))
        try:
            for line in reader:
                for key, values in zip((across, up), found, strict=True):
                    values.append(_number(line.get(key), f"line {reader.line_num}, {key}"))
        except csv.Error as error:
            raise ValueError(f"line {reader.line_num}: not a table: {error}") from None
    return found


def _number(told: object, where: str) -> float:
    try:
        value = float(told) if isinstance(told, str) else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{where}: {shown(told)} is no finite number")
    return value


def _verification(folder: Path | None, layout: Layout, physics: Physics) -> dict[str, Any] | None:
    """Return what is known of a check of this row.

    Of the folder's file, else what is kept of rows that ship. No more of the file is passed on than
    the page shows.
    """
    path = folder / "verification.json" if folder else None
    if path is None or not path.exists():
        known = known_verification(layout, physics)
        if known is None:
            return None
        last = [(floor_name(check.floor), check.last) for check in known.floors]
        return {"judge": known.checks[0].simulator, "verdict": known.verdict, "last": last}
    with naming(path):
        check = model_of(VerificationDocument, read_json(path))
    told: dict[str, Any] = {
        "judge": one_line(check.engine, 1000),
        "verdict": one_line(check.verdict, 1000),
        "last": [(floor_name(one.floor), one.difference) for one in check.floors],
    }
    # of another row: the verdict alone
    if all(len(t) == layout.count for t in (check.model, *(one.arrivals for one in check.floors))):
        told["model"] = list(check.model)
        told["times"] = [(floor_name(one.floor), list(one.arrivals)) for one in check.floors]
    return told
