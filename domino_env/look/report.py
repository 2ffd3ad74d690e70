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
from dataclasses import asdict, dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from domino_env.files import write_text
from domino_env.layout import Layout
from domino_env.limits import RUN_BYTES, SHOWN_DOMINOES
from domino_env.look.race_data import Racer, race_data
from domino_env.look.verified import known_verification
from domino_env.physics import Physics
from domino_env.reading import decoded, one_line, read_bytes, read_json, shown, told_of
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
            found.append((path.stem, _shown_layout(path), None))
            continue
        if not (path / "layout.csv").exists():
            raise ValueError(f"{path}: no layout.csv in this folder; give a run or a layout file")
        if (path / "scene.toml").exists():
            own = load_scene(path / "scene.toml")
            if scene is not None and scene.to_toml() != own.to_toml():
                raise ValueError(f"{path}: its scene differs from '{scene.name}'; race one scene")
            scene = own
        found.append((_called(path), _shown_layout(path / "layout.csv"), path))
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


def _called(folder: Path) -> str:
    """What a run's row is called: by what made it, if the folder says so."""
    path = folder / "summary.json"
    told = read_json(path, RUN_BYTES, 10_000) if path.exists() else {}
    if isinstance(told, dict) and "algorithm" in told:
        return f"{one_line(str(told['algorithm']), 20).upper()} agent's row"
    if isinstance(told, dict) and "method" in told:
        return "optimised row"
    return one_line(folder.resolve().name, 100)


def _curve(
    folder: Path | None, name: str, across: str, up: str
) -> tuple[list[float], list[float]] | None:
    """Two columns of a CSV file in a run's folder, of the lines that have both as finite numbers;
    None where there is no such file."""
    if folder is None or not (folder / name).exists():
        return None
    path = folder / name
    found: tuple[list[float], list[float]] = [], []
    with told_of(path):
        text = decoded(read_bytes(path, RUN_BYTES))
        reader = csv.DictReader(io.StringIO(text, newline=""))
        try:
            for line in reader:
                if not line.get(across) or not line.get(up):
                    continue
                where = f"line {reader.line_num}"
                pair = [_number(line[key], f"{where}, {key}") for key in (across, up)]
                if all(map(math.isfinite, pair)):  # no row was built yet where it is -inf
                    found[0].append(pair[0])
                    found[1].append(pair[1])
        except csv.Error as error:
            raise ValueError(f"line {reader.line_num}: not a table: {error}") from None
    return found


def _number(told: str, where: str) -> float:
    try:
        value = float(told)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise ValueError(f"{where}: {shown(told)} is no number")
    return value


def _verification(folder: Path | None, layout: Layout, physics: Physics) -> dict[str, Any] | None:
    """What the page says of a check: that in the run's folder, or what is kept of a row that ships.

    No more of the file is passed on than the page shows.
    """
    path = folder / "verification.json" if folder else None
    if path is None or not path.exists():
        known = known_verification(layout, physics)
        return None if known is None else asdict(known)
    document = read_json(path, RUN_BYTES, 10 * SHOWN_DOMINOES.most + 100)
    with told_of(path):
        if not isinstance(document, dict):
            raise ValueError("expected an object with the keys engine and verdict")
        told: dict[str, Any] = {}
        for key in ("engine", "verdict"):
            if not isinstance(document.get(key), str):
                raise ValueError(f"{key} = {shown(document.get(key))}: expected a line of text")
            told[key] = one_line(document[key], 1000)
        for key in ("difference", "free_difference"):
            told[key] = _number_or_none(document.get(key), key)
        for key in ("model", "hinged", "free"):
            times = document.get(key)
            if times is None and key == "model":
                return told
            if not isinstance(times, list) or len(times) != layout.count:
                raise ValueError(f"{key} = {shown(times)}: expected {layout.count} times [s]")
            told[key] = [_number_or_none(time, key) for time in times]
    return told


def _number_or_none(value: object, where: str) -> float | None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value is not None and not (number and abs(value) < 1e15):  # type: ignore[arg-type]
        raise ValueError(f"{where}: {shown(value)} is no finite number")
    return value  # type: ignore[return-value]
