"""What version 0.1.0 wrote is read: a run's scene, layouts, trace and summary."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import domino_env as de
from domino_env.physics.layout import Layout
from domino_env.view.report import read_racers

RUN = Path(__file__).parent / "data" / "version_0_1_0"


def test_its_scene_reads_and_is_written_the_same_to_the_byte() -> None:
    path = RUN / "scene.toml"
    scene = de.load_scene(path)
    assert scene.stock is not None
    assert scene.spacing_values is not None
    assert scene.to_toml() == path.read_text("utf-8")


def test_its_layouts_read_and_score_what_they_scored() -> None:
    summary = json.loads((RUN / "summary.json").read_text("utf-8"))
    rows = [Layout.read(RUN / name) for name in ("layout.csv", "layout.json")]
    assert rows[0] == rows[1]
    assert de.load_scene(RUN / "scene.toml").score(rows[0]) == pytest.approx(summary["score"])


def test_its_folder_is_shown() -> None:
    racers, title = read_racers([RUN])
    assert title == "Six dominoes from a box, on steps, as version 0.1.0 wrote them"
    assert [racer.name for racer in racers] == ["optimised row", "best uniform row"]
    assert racers[0].trace is not None
