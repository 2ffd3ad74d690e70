"""Report: one page that plays rows against each other, and shows why one wins.

The page needs no network and no server: data, scripts and styles are inside it.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

from domino_env.files import write_text
from domino_env.layout import Layout
from domino_env.look.race_data import Racer, race_data
from domino_env.physics import Physics
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
            found.append((path.stem, Layout.read(path), None))
            continue
        if not (path / "layout.csv").exists():
            raise ValueError(f"{path}: no layout.csv in this folder; give a run or a layout file")
        if (path / "scene.toml").exists():
            own = load_scene(path / "scene.toml")
            if scene is not None and scene.to_toml() != own.to_toml():
                raise ValueError(f"{path}: its scene differs from '{scene.name}'; race one scene")
            scene = own
        found.append((path.name, Layout.read(path / "layout.csv"), path))
    physics = physics or (scene.physics if scene else Physics())
    racers = []
    for name, layout, folder in found:
        trace = _trace(folder / "trace.csv") if folder else None
        checked = folder / "verification.json" if folder else None
        verification = json.loads(checked.read_text()) if checked and checked.exists() else None
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
        # "</" would end the script early
        "data": data.replace("</", "<\\/"),
        "charts": read("uPlot.iife.min.js"),
        "race": read("race.js"),
    }
    page = read("report.html")
    for name, text in parts.items():
        page = page.replace("{{" + name + "}}", text)
    write_text(path, page)
    return len(page.encode())


def _trace(path: Path) -> tuple[list[float], list[float]] | None:
    if not path.exists():
        return None
    with path.open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    told = [(float(line["evaluations"]), float(line["best_score"])) for line in lines]
    return [n for n, _ in told], [score for _, score in told]
