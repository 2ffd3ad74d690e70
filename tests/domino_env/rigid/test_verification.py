"""The model against simulators that keep no contact closed."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import domino_env as de
from domino_env.rigid import engine
from domino_env.rigid.simulation import largest_difference, simulate_standing
from domino_env.rigid.verification import Verification, as_document, verification_table, verify
from domino_env.scenes.uniform import best_uniform_on

LAYOUT, PHYSICS = de.Layout.uniform(14, pitch=0.024), de.Physics(push=5 * np.pi)


@pytest.mark.parametrize(("late", "uncertainty", "hit", "toppled", "word"), [
    (5e-4, 0.0, 14, 14, "AGREES"),
    (2e-3, 0.0, 14, 14, "CLOSE"),
    (1.8e-3, 9e-4, 14, 14, "AGREES"),  # only differences beyond the uncertainty count
    (3.5e-3, 9e-4, 14, 14, "CLOSE"),
    (4e-3, 0.0, 14, 14, "DIFFERS"),
    (4e-3, 5e-3, 14, 14, "UNDECIDED"),  # the uncertainty is too large
    (0.0, math.inf, 14, 14, "UNDECIDED"),
    (0.0, 0.0, 13, 13, "DIFFERS: the wave reaches 14 of 14 dominoes in the model, 13"),
    (0.0, 0.0, 14, 13, "DIFFERS: every arrival time"),
])  # fmt: skip
def test_only_differences_beyond_the_uncertainty_count(late, uncertainty, hit, toppled, word):
    wave = de.simulate(LAYOUT, PHYSICS)
    times = wave.arrival_times * (1.0 + late)
    times[hit:] = np.inf
    waves = []
    for floor in (None, 0.5):
        rigid = simulate_standing(LAYOUT, PHYSICS, floor, 0.5)
        lean = np.where(np.arange(14) < toppled, 1.0, 0.0)
        changes = {"arrival_times": times, "lean": lean, "error_estimate": uncertainty}
        waves.append(replace(rigid, **changes, converged=uncertainty < 1e-3))
    checked = Verification(wave, tuple(waves), tuple(waves))
    assert checked.verdict.startswith(word)
    assert "nan" not in checked.verdict
    read = json.loads(json.dumps(as_document(checked), allow_nan=False))
    table = verification_table(checked)
    assert table[-2:] == [read["verdict"]] * 2
    same = "are undecided" if uncertainty > 1e-3 else "agree"
    for place in ("fixed pivots", "floor 0.5"):
        start = f"{place}: simulate_standing and simulate_standing {same}, arrival times"
        assert any(line.startswith(start) for line in table)
    assert any("has not converged" in line for line in table) == (uncertainty >= 1e-3)
    assert [one["floor"] for one in read["floors"]] == [None, 0.5]
    assert read["engine_floors"] == read["floors"]


def test_model_and_reference_stop_at_the_same_domino():
    layout = de.Layout([0.012, 0.012, 0.060, 0.012], 0.0075)
    ended = verify(layout, de.Physics(push=10.0), floors=[0.5])
    assert ended.wave.hit == ended.fixed.hit == ended.standing[0].hit == 3
    assert np.isnan(ended.difference)
    assert as_document(ended)["difference"] is None
    assert ended.verdict.startswith("AGREES")


HILL = de.Layout(
    [0.016] * 13, 0.0075, rise=np.linspace(0.0018, -0.0018, 13), tilt=np.linspace(-0.08, 0.08, 14)
)


RNG = np.random.default_rng(4)
RANDOM = de.Layout(RNG.uniform(0.008, 0.024, 13), RNG.uniform(0.005, 0.009, 14))


@pytest.mark.parametrize("layout", [RANDOM, HILL], ids=["random", "over a hill"])
def test_the_engine_agrees_with_both_or_reports_that_it_has_not_converged(layout, monkeypatch):
    pytest.importorskip("pymunk")
    monkeypatch.setattr(engine, "STEPS", (2e-4, 1e-4))
    monkeypatch.setattr(engine, "RTOL", 3e-3)
    checked = verify(layout, PHYSICS, floors=[0.5], engine=True)
    assert checked.verdict.startswith("AGREES")
    assert checked.engine[0].converged
    assert checked.engine[0].simulator.startswith("pymunk 7")
    assert abs(checked.engine[0].arrival_times[-1] / checked.wave.arrival_times[-1] - 1.0) < 1e-3
    for rigid, in_engine in zip(checked.reference, checked.engine, strict=True):
        assert largest_difference(rigid.arrival_times, in_engine.arrival_times) < 2e-3
        assert rigid.toppled == in_engine.toppled == 14
    monkeypatch.setattr(engine, "MAX_SWEEPS", 60)
    rough = verify(layout, PHYSICS, floors=[], engine=True)
    # the sweeps were not doubled, so the effect of more sweeps is unknown
    assert (rough.engine[0].converged, rough.engine[0].error_estimate) == (False, math.inf)
    assert rough.verdicts[1].startswith("UNDECIDED")
    assert "has not converged within its limits" in "\n".join(verification_table(rough))


def test_removing_dominoes_far_behind_changes_no_arrival_time():
    pytest.importorskip("pymunk")
    layout = de.Layout.uniform(40, pitch=0.02)
    settings = layout, PHYSICS, None, 2e-4, 60
    whole, near = (engine.run_engine(*settings, window)[0] for window in (None, 24))
    assert largest_difference(near, whole) < 1e-5


SHORT = de.load_scene("sprint").replace(count=12)


def test_the_command_verifies_without_the_engine(tmp_path, output_of):
    SHORT.uniform().layout.to_csv(tmp_path / "layout.csv")
    (tmp_path / "scene.toml").write_text(SHORT.to_toml())
    words = "verify", tmp_path / "layout.csv", "--floor", "free", "--no-engine"
    printed = output_of(*words)
    assert "AGREES" in printed
    assert "floor 1:" in printed  # the name free means a friction of 1
    assert json.loads(output_of(*words, "--json"))["verdict"] in printed


def test_the_best_uniform_layout_on_a_floor_beats_its_neighbours():
    baseline = SHORT.uniform().layout
    assert best_uniform_on(SHORT, baseline, None) is baseline
    gap = float(best_uniform_on(SHORT, baseline, 0.3).spacing[0])
    layouts = [de.Layout.uniform(SHORT.count, spacing=gap + x) for x in (-0.003, 0.0, 0.003)]
    less, best, more = (simulate_standing(x, SHORT.physics, 0.3).mean_speed for x in layouts)
    assert best > max(less, more)
