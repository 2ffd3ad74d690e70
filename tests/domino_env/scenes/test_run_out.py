"""Run-outs: fixed dominoes after those that are designed."""

import numpy as np
import pytest

import domino_env as de
from optimize import search

FREE = de.Scene(
    count=9, spacing=(0.002, 0.04), thickness=(0.004, 0.012), first_thickness=0.0075,
    physics=de.Physics(push=8.0), run_out=de.RunOut(5, 0.004),
)  # fmt: skip
RNG = np.random.default_rng(3)
GAPS, THICKNESSES = RNG.uniform(0.005, 0.02, (2, 8)), RNG.uniform(0.005, 0.01, (2, 8))


def test_a_score_is_that_of_the_whole_row():
    for gaps, thickness in zip(GAPS, THICKNESSES, strict=True):
        layout = FREE.layout(gaps, thickness)
        row = de.Layout(
            np.append(gaps, [0.004] * 5), np.concatenate([[0.0075], thickness, [0.0075] * 5])
        )
        assert FREE.row(layout) == row
        expected = de.simulate(row, FREE.physics, rtol=1e-10).arrival_times
        np.testing.assert_array_equal(FREE.simulate(layout).arrival_times, expected)
        assert FREE.score(layout) == FREE.simulate(layout).mean_speed
        assert FREE.violations(layout) == []
    batch = FREE.evaluate(FREE.batch(GAPS, THICKNESSES, rtol=1e-10)).score
    scores = [FREE.score(FREE.layout(*sizes)) for sizes in zip(GAPS, THICKNESSES, strict=True)]
    assert batch == pytest.approx(scores, rel=1e-13)


def test_a_floor_simulates_the_whole_row():
    scene = FREE.replace(floor_friction=0.5)
    batch = scene.batch(GAPS[:1], THICKNESSES[:1])
    row = FREE.row(FREE.layout(GAPS[0], THICKNESSES[0]))
    speed = de.simulate_standing(row, FREE.physics, 0.5, 1e-3).mean_speed
    scores = scene.evaluate(batch, gradient=True)
    assert scores.score[0] == speed
    assert scores.gradient.spacing.shape == (1, 8)


def test_a_limited_search_on_a_floor_begins_with_the_baseline_of_the_row():
    scene = FREE.replace(count=4, thickness=(0.0075, 0.0075), floor_friction=0.5)
    scene = scene.replace(spacing=(0.01, 0.02), run_out=de.RunOut(2, 0.01))
    result = search(scene, "uniform", budget=2, seconds=60.0)
    assert result.score == scene.uniform().score > 0.0
    assert result.wave.layout.count == scene.row_count


def test_gains_on_floors_compare_whole_rows(output_of, tmp_path):
    scene = FREE.replace(name="row", count=4, thickness=(0.0075, 0.0075), spacing=(0.01, 0.02))
    (tmp_path / "row.toml").write_text(scene.to_toml())
    baseline = scene.uniform().layout
    baseline.to_csv(tmp_path / "row.csv")
    words = "--no-engine", "--floor", "0.5"
    output = output_of("verify", tmp_path / "row.csv", "--scene", tmp_path / "row.toml", *words)
    assert "fixed pivots: " in output
    assert ": +0.00%" in output  # the layout is the baseline on fixed pivots


def test_a_wave_that_ends_in_the_run_out_is_a_failure():
    """A run-out at the limit of the reach stops the wave after the last designed domino."""
    scene = FREE.replace(run_out=de.RunOut(5, 0.0479), thickness=(0.0075, 0.0075))
    layout = scene.layout(GAPS[0])
    wave = scene.simulate(layout)
    assert wave.outcome != de.Outcome.PROPAGATED
    assert 9 / 14 <= wave.reach + 1 / 14 < 1.0
    assert scene.score(layout) == wave.reach - 1.0
    env = de.DominoChainVector(1, scene, autoreset_mode="Disabled")
    env.reset()
    for _ in range(8):
        info = env.step(env.actions_towards(layout))[4]
    assert info["layout"][0].count == 9
    assert info["outcome"][0] == wave.outcome
    assert info["score"][0] == pytest.approx(wave.reach - 1.0, abs=1e-6)


@pytest.mark.parametrize(("changes", "words"), [
    ({"run_out": de.RunOut(5, 0.05)}, r"run_out\.spacing = 0\.05 m is out of reach of a domino"),
    ({"run_out": de.RunOut(99_999, 0.004)}, r"row\.count and run_out\.count add up to 100008"),
    ({"stock": de.Stock((0.0075,), (20,)), "thickness": None}, r"\[run_out\] and \[stock\]"),
    ({"objective": "tempo", "settings": de.Tempo(30.0, 40.0)}, r"\[run_out\] and \[tempo\]"),
    ({"ground": de.Ground(profile=[[0, 0], [0.5, 0.001], [1, 0]])}, r"ground\.profile exclude"),
])  # fmt: skip
def test_run_outs_that_contradict_the_scene_are_rejected(changes, words):
    with pytest.raises(ValueError, match=words):
        FREE.replace(**changes)
