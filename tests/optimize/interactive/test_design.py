"""Designs without a page: drags within the rules, history, numbers, background work."""

import threading
from typing import Any

import numpy as np
import pytest

import domino_env as de
from optimize.interactive.design import SPACING, THICKNESS, StudioDesign
from optimize.interactive.jobs import improvement_method, run_search

SPRINT, COURSE = de.load_scene("sprint"), de.load_scene("course")
LISTED = SPRINT.replace(spacing_values=(0.005, 0.010, 0.020, 0.040), count=12)
SCENES = {
    "bounds": SPRINT,
    "length": COURSE,
    "list": LISTED,
    "change": SPRINT.replace(largest_change=0.002),
    "stock": de.load_scene("stock"),
    "thickness": de.load_scene("sprint-thickness"),
    "slope": de.load_scene("downhill"),
}


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize("wanted", [1e-9, 0.0101, 0.0263, 7.0])
def test_a_drag_anywhere_keeps_the_rules(kind: str, wanted: float) -> None:
    design = StudioDesign(SCENES[kind])
    for part in [SPACING, THICKNESS][: 1 + design.scene.free_thickness]:
        design.drag(part, 5, wanted)
        assert design.scene.violations(design.layout) == []
        assert design.score == design.scene.score(design.layout)


def test_a_drag_sets_the_nearest_value_allowed() -> None:
    free, listed = StudioDesign(SPRINT), StudioDesign(LISTED)
    for wanted, set_to, nearest in ((0.0263, 0.0263, 0.020), (7.0, 0.040, 0.040)):
        free.drag(SPACING, 5, wanted)
        listed.drag(SPACING, 5, wanted)
        assert free.layout.spacing[5] == pytest.approx(set_to, rel=1e-12)
        assert listed.layout.spacing[5] == nearest


def test_a_drag_with_a_fixed_length_changes_the_neighbours() -> None:
    design = StudioDesign(COURSE)
    before = design.layout.spacing
    design.drag(SPACING, 20, before[20] + 0.001)
    changed = np.flatnonzero(abs(design.layout.spacing - before) > 1e-9)
    assert changed.tolist() == [19, 20]
    design.drag(SPACING, 20, 0.040)  # more than one neighbour can give
    changed = np.flatnonzero(abs(design.layout.spacing - before) > 1e-9)
    assert changed.tolist() == list(range(changed[0], changed[-1] + 1))
    assert design.layout.spacing[20] == pytest.approx(0.040)
    design.drag(SPACING, 20, float(before[20]))  # a drag begins at the last step
    np.testing.assert_allclose(design.layout.spacing, before, rtol=1e-12)


def test_a_drag_is_one_step_of_the_history() -> None:
    design = StudioDesign(SPRINT)
    first = design.layout
    for gap in (0.010, 0.011, 0.012):
        design.drag(SPACING, 3, gap)
    design.commit()
    dragged = design.layout
    design.change(count=30)
    design.move(-1)
    assert (design.scene, design.layout) == (SPRINT, dragged)
    design.move(-1)
    assert design.layout == first
    assert not design.can_move(-1)
    design.move(1)
    assert design.layout == dragged
    design.drag(SPACING, 3, 0.02)
    design.commit()
    assert not design.can_move(1)


@pytest.mark.parametrize("fields", [
    {"count": 57}, {"height": 0.060}, {"spacing": (0.015, 0.030)}, {"length": 1.1},
    {"ground": de.Ground(slope=2.0)}, {"physics": SPRINT.physics.replace(push=12.0)},
], ids=lambda fields: next(iter(fields)))  # fmt: skip
def test_another_scene_keeps_the_shape(fields: dict[str, Any]) -> None:
    design = StudioDesign(SPRINT)
    design.drag(SPACING, 0, 0.030)
    design.commit()
    design.change(**fields)
    assert design.scene.violations(design.layout) == []
    assert design.layout.spacing[0] == pytest.approx(0.030, abs=0.003)
    assert design.score == design.scene.score(design.layout)


def test_an_impossible_scene_changes_nothing() -> None:
    design = StudioDesign(SPRINT)
    before = design.scene, design.layout
    with pytest.raises(ValueError, match="length"):
        design.change(length=9.0)
    assert (design.scene, design.layout) == before
    for wrong, message in (
        ((THICKNESS, 5, 0.01), "quantity = 'thickness': choose one of spacing"),
        ((SPACING, 39, 0.01), "index = 39: give a whole number from 0 to 38"),
        ((SPACING, 5, float("nan")), "value = nan m: give a finite number"),
    ):
        with pytest.raises(ValueError, match=message):
            design.drag(*wrong)
    with pytest.raises(ValueError, match="leaves nothing free"):
        design.change(spacing=(0.02, 0.02))
    with pytest.raises(ValueError, match="40 dominoes, and the scene 20"):
        design.open(SPRINT.replace(count=20), design.layout)


def test_displayed_numbers_agree_with_the_command(output_of, tmp_path) -> None:
    design = StudioDesign(SPRINT)
    design.drag(SPACING, 3, 0.012)
    design.uniform = SPRINT.uniform()
    numbers = design.numbers()
    path = tmp_path / "row.csv"
    design.layout.to_csv(path)
    printed = output_of("simulate", path, "--scene", "sprint")
    speed, last = numbers["mean speed"], numbers["last domino hit after"].partition(" ±")[0]
    assert f"mean speed {speed} over" in printed
    assert f"last domino hit after {last}\n" in printed
    gained = numbers["gain over the uniform baseline (best equal gaps)"]
    assert gained == f"{SPRINT.score(design.layout) / design.uniform.score - 1.0:+.2%}"
    size = gained.removeprefix("+").removeprefix("-")
    assert f"score {speed} on 'sprint', {size} " in printed


def test_displayed_numbers_of_a_schedule_are_errors() -> None:
    design = StudioDesign(de.load_scene("tempo"))
    name = "result of the uniform baseline (best equal gaps)"
    assert design.numbers()[name] == "computing …"
    design.uniform = design.scene.uniform()
    assert design.numbers()[name] == design.numbers()["result"] == "RMS error 18.7318 ms"


def test_numbers_of_a_wave_that_stops_name_the_place() -> None:
    design = StudioDesign(SPRINT.replace(spacing=(0.002, 0.060)))
    assert design.stop is None
    design.uniform = design.scene.uniform()
    assert "+0.00%" in design.numbers().values()
    design.drag(SPACING, 20, 0.050)  # more than the height
    assert design.stop == 20
    assert design.numbers()["dominoes hit"] == "21 of 40"


@pytest.mark.parametrize("kind", ["bounds", "length", "list"])
def test_improving_raises_the_score_and_keeps_the_rules(kind: str, monkeypatch) -> None:
    monkeypatch.setattr("optimize.interactive.jobs.SHOW_INTERVAL", 0.0)
    monkeypatch.setattr("optimize.interactive.jobs.STEP_PAUSE", 0.0)
    scene = SCENES[kind].replace(count=12, length=None if kind != "length" else 0.24)
    design, scores = StudioDesign(scene), list[float]()

    def show(layout: de.Layout, _: float) -> None:
        scores.append(scene.score(layout))

    layout, words = run_search(scene, improvement_method(design.layout), threading.Event(), show)
    assert scene.violations(layout) == []
    assert scene.score(layout) == pytest.approx(max(scores), rel=1e-9)
    assert scores == sorted(scores)
    assert (max(scores) > design.score * 1.001) == (kind != "list")
    assert ("Search" in words) == (kind == "list")


def test_a_search_that_is_stopped_returns_its_best() -> None:
    stopped, layouts = threading.Event(), list[de.Layout]()

    def show(layout: de.Layout, _: float) -> None:
        layouts.append(layout)
        stopped.set()

    layout, words = run_search(SPRINT, "auto", stopped, show)
    assert "stopped" in words
    assert SPRINT.score(layout) >= SPRINT.score(layouts[0]) - 1e-6
