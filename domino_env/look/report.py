"""Report: one page that plays rows against each other, and shows why one wins.

The page needs no network and no server: data, scripts and styles are inside it.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from domino_env.files import write_text
from domino_env.layout import Layout
from domino_env.look.race_data import Racer, race_data
from domino_env.look.verified import known_verification
from domino_env.physics import Physics
from domino_env.scene import Scene, load_scene
from domino_env.wave import simulate

MARK = "best equal gaps"


@dataclass(frozen=True)
class Race:
    """The rows that race, what the page is called, and what counts."""

    racers: tuple[Racer, ...]
    title: str
    objective: str = "mean_speed"


def read_race(
    paths: Sequence[Path], scene: Scene | None = None, physics: Physics | None = None
) -> Race:
    """The rows to race, from layout files and folders of runs (of a search or of a training).

    A run brings its scene, its search or learning curve and, if `domino verify --json` wrote one
    there, its verification.json; rows that ship bring the verification that is kept of them.  Where
    there is a scene its best uniform row races too, last.
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
        found.append((_called(path), Layout.read(path / "layout.csv"), path))
    names = [name for name, _, _ in found]
    judged = scene is not None and physics is None  # another physics is another problem
    physics = physics or (scene.physics if scene else Physics())
    racers = []
    for (name, layout, folder), path in zip(found, paths, strict=True):
        wave = simulate(layout, physics)
        # two runs of one kind are told apart by their folders
        label = name if names.count(name) == 1 else f"{name} ({path.resolve().name})"
        score = worth = None
        if judged and scene and not scene.violations(layout):
            score = scene.score_wave(wave)
            worth = scene.in_words(score, wave)
        racers.append(
            Racer(
                label,
                wave,
                _curve(folder, "trace.csv", "evaluations", "best_score"),
                _curve(folder, "progress.csv", "steps", "score"),
                _verification(folder, layout, physics),
                score,
                worth,
            )
        )
    if scene and judged:
        mark = scene.uniform()
        worth = scene.in_words(mark.score, mark.wave)
        racers.append(Racer(MARK, mark.wave, score=mark.score, worth=worth))
    elif scene:
        racers.append(Racer(MARK, simulate(scene.uniform().layout, physics)))
    return Race(
        tuple(racers),
        scene.title if scene else "race",
        scene.objective if scene and judged else "mean_speed",
    )


def write_report(race: Race, path: Path) -> int:
    """Write the page whole; returns its size [bytes]."""
    assets = files("domino_env.look") / "assets"

    def read(name: str) -> str:
        return (assets / name).read_text("utf-8")

    data = json.dumps(
        race_data(race.racers, race.objective), allow_nan=False, separators=(",", ":")
    )
    parts = {
        "title": escape(race.title),
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


def _called(folder: Path) -> str:
    """What a run's row is called: by what made it, if the folder says so."""
    path = folder / "summary.json"
    told = json.loads(path.read_text("utf-8")) if path.exists() else {}
    if "algorithm" in told:
        return f"{str(told['algorithm']).upper()} agent's row"
    return "optimised row" if "method" in told else folder.resolve().name


def _curve(
    folder: Path | None, name: str, across: str, up: str
) -> tuple[list[float], list[float]] | None:
    """Two columns of a CSV file in a run's folder, of the lines that have both as finite numbers;
    None where there is no such file."""
    if folder is None or not (folder / name).exists():
        return None
    with (folder / name).open(encoding="utf-8", newline="") as file:
        lines = [line for line in csv.DictReader(file) if line.get(across) and line.get(up)]
    told = [(float(line[across]), float(line[up])) for line in lines]
    kept = [(x, y) for x, y in told if math.isfinite(x) and math.isfinite(y)]
    return [x for x, _ in kept], [y for _, y in kept]


def _verification(folder: Path | None, layout: Layout, physics: Physics) -> dict[str, Any] | None:
    path = folder / "verification.json" if folder else None
    if path and path.exists():
        document: dict[str, Any] = json.loads(path.read_text("utf-8"))
        return document
    known = known_verification(layout, physics)
    return None if known is None else asdict(known)
