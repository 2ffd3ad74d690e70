"""Report: one page that plays rows against each other, and shows why one wins.

The page needs no network and no server: data, scripts and styles are inside it.
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

from domino_env.files import write_text
from domino_env.layout import Layout
from domino_env.limits import RUN_BYTES, SHOWN_DOMINOES
from domino_env.look.race_data import Racer, race_data
from domino_env.physics import Physics
from domino_env.reading import decoded, one_line, read_bytes, read_json, shown, told_of
from domino_env.scene import Scene, load_scene
from domino_env.wave import simulate

MARK = "best uniform pitch"


def read_racers(
    paths: Sequence[Path], scene: Scene | None = None, physics: Physics | None = None
) -> tuple[list[Racer], str]:
    """The rows to race and a title, from layout files and folders of runs.

    A run brings its scene, its search curve and, if `domino verify --json` wrote one there, its
    verification.json.  Where there is a scene its best uniform row races too, last.
    Raises ValueError for a folder without a layout.csv, and for runs of different scenes.
    """
    found: list[tuple[str, Layout, Path | None]] = []
    for path in paths:
        if not path.is_dir():
            found.append((path.stem, _shown_layout(path), None))
            continue
        if not (path / "layout.csv").exists():
            raise ValueError(f"{path}: no layout.csv in this folder; give a run or a layout file")
        if (path / "scene.toml").exists():
            own = load_scene(path / "scene.toml")
            if scene is not None and scene.to_toml() != own.to_toml():
                raise ValueError(f"{path}: its scene differs from '{scene.name}'; race one scene")
            scene = own
        found.append((path.name, _shown_layout(path / "layout.csv"), path))
    physics = physics or (scene.physics if scene else Physics())
    racers = []
    for name, layout, folder in found:
        trace = _trace(folder / "trace.csv") if folder else None
        checked = folder / "verification.json" if folder else None
        verification = _verification(checked) if checked and checked.exists() else None
        name = one_line(name, 100)
        label = f"optimised ({name})" if scene and scene.name == name else name
        racers.append(Racer(label, simulate(layout, physics), trace, verification))
    if scene:
        racers.append(Racer(MARK, simulate(scene.uniform().layout, physics)))
    return racers, scene.name if scene else "race"


def write_report(racers: Sequence[Racer], title: str, path: Path) -> int:
    """Write the page whole; returns its size [bytes]."""
    assets = files("domino_env.look") / "assets"

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


def _shown_layout(path: Path) -> Layout:
    layout = Layout.read(path)
    with told_of(path):
        SHOWN_DOMINOES.require(layout.count, "it has")
    return layout


def _trace(path: Path) -> tuple[list[float], list[float]] | None:
    """Evaluations and best scores of a search."""
    if not path.exists():
        return None
    with told_of(path):
        text = decoded(read_bytes(path, RUN_BYTES))
        found: tuple[list[float], list[float]] = [], []
        reader = csv.DictReader(io.StringIO(text, newline=""))
        try:
            for line in reader:
                for key, values in zip(("evaluations", "best_score"), found, strict=True):
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


def _verification(path: Path) -> dict[str, str]:
    """What the page says of a check: no more of the file is passed on."""
    document = read_json(path, RUN_BYTES, 10 * SHOWN_DOMINOES.most + 100)
    with told_of(path):
        if not isinstance(document, dict):
            raise ValueError("expected an object with the keys engine and verdict")
        for key in ("engine", "verdict"):
            if not isinstance(document.get(key), str):
                raise ValueError(f"{key} = {shown(document.get(key))}: expected a line of text")
        return {key: one_line(document[key], 1000) for key in ("engine", "verdict")}
