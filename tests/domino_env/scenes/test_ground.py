"""Scenes on uneven ground: layouts along it, gradients, rejected scenes."""

from dataclasses import replace

import numpy as np
import pytest
from uneven_layouts import POINTS, UNEVEN_SCENE

import domino_env as de
from domino_env.physics import footing
from domino_env.scenes.io.reading import read_layout
from domino_env.scenes.placement import draw_layouts

FREE, UNEVEN = UNEVEN_SCENE, UNEVEN_SCENE.ground


def random_sizes(batch: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    pairs = FREE.count - 1
    return rng.uniform(*FREE.spacing, (batch, pairs)), rng.uniform(*FREE.thickness, (batch, pairs))


def test_both_edges_of_every_base_lie_on_the_curve_and_gaps_along_it():
    gaps, thick = random_sizes(1)
    layout = FREE.layout(gaps[0], thick[0])
    along = np.stack([np.cos(layout.tilt), -np.sin(layout.tilt)], axis=1)
    fronts = layout.pivots + np.array([0.0, UNEVEN.height(0.0)])
    backs = fronts - layout.thickness[:, None] * along
    for edges in (fronts, backs):
        np.testing.assert_allclose(UNEVEN.height(edges[:, 0]), edges[:, 1], atol=1e-15)
    free = np.sum((backs[1:] - fronts[:-1]) * along[1:], axis=1)
    np.testing.assert_allclose(free, gaps[0], rtol=1e-13)
    for x in (-0.1, 0.05, 0.36):  # no jump in the slope, also where it goes on straight
        left, here, right = UNEVEN.height([x - 1e-5, x, x + 1e-5])
        assert left + right - 2.0 * here == pytest.approx(0.0, abs=2e-9)
    np.testing.assert_allclose(np.diff(UNEVEN.height([0.36, 0.46, 0.56]), n=2), 0.0, atol=1e-15)


def evaluated(scene, gaps, thick, rtol=1e-12):
    """Return scores and their derivatives by gaps, thicknesses and heights."""
    evaluation = scene.evaluate(scene.batch(gaps, thick, rtol=rtol), gradient=True)
    gradient = evaluation.gradient
    return evaluation.score, gradient.spacing, gradient.thickness, gradient.height


DOWN = -np.tan(np.radians(4.0))


@pytest.mark.parametrize(("one", "other", "rtol"), [
    (de.Ground(slope=4.0), de.Ground(profile=[[0.1, 0.7 + 0.1 * DOWN], [0.2, 0.7 + 0.2 * DOWN]]),
     1e-9),
    (UNEVEN, de.Ground(profile=[[x, y + 0.3] for x, y in POINTS]), 1e-12),
    (de.Ground(slope=0.0), None, 0.0),
], ids=["straight", "higher", "level"])  # fmt: skip
def test_scores_on_grounds_of_one_shape_are_the_same(one, other, rtol):
    batch = random_sizes(3)
    (score, *by), (same, *like) = (evaluated(FREE.replace(ground=g), *batch) for g in (one, other))
    np.testing.assert_allclose(score, same, rtol=rtol)
    close = 1e-9 if rtol else 0.0
    np.testing.assert_allclose(by, like, rtol=close, atol=1e-2 * close)


@pytest.mark.parametrize("seed", range(4))
def test_all_layouts_within_accepted_bounds_can_stand(seed):
    """The ground is the most uneven that is accepted; gaps are at their bounds and between."""
    rng = np.random.default_rng(seed)
    shape = np.stack([np.linspace(-0.1, 0.5, 9), rng.uniform(-1.0, 1.0, 9)], axis=1)
    low, high = 0.0, 0.1
    for _ in range(20):
        middle = 0.5 * (low + high)
        try:
            ground = de.Ground(profile=shape * [1.0, middle])
            scene = FREE.replace(ground=ground, spacing=(0.004, 0.044))
            low = middle
        except ValueError:
            high = middle
    gaps = rng.choice([0.004, 0.044, 0.02, 0.009], (2000, FREE.count - 1))
    thick = rng.choice(scene.thickness, gaps.shape)
    batch = scene.batch(gaps, thick)
    arrays = batch.spacing, batch.thickness, batch.height, batch.rise, batch.tilt
    assert footing.find_violation(*arrays) is None
    assert low > 1e-4


def test_waves_stop_where_placement_noise_makes_dominoes_lean():
    noise = de.Placement(0.02, 64, 0.5)
    wild = FREE.replace(placement=noise)
    gaps, thick = random_sizes(2)
    placed = draw_layouts(wild.batch(gaps, thick), noise.errors(gaps.shape[1]))
    placed = replace(placed, ground=UNEVEN)
    arrays = placed.spacing, placed.thickness, placed.height, placed.rise, placed.tilt
    assert footing.impassable(*arrays).any()
    assert np.isfinite(wild.evaluate(wild.batch(gaps, thick)).score).all()


def test_settings_that_conflict_with_uneven_ground_are_rejected():
    hollow = de.Ground(profile=[[0, 0.0014], [0.03, 0], [0.06, 0.0014]])
    for changes, words in (
        ({"ground": hollow, "spacing": (0.003, 0.03)}, r"too narrow for the hollow near x = 0\.03"),
        ({"length": 0.2}, r"ground\.profile and row\.length exclude each other"),
        ({"spacing": (0.008, 0.0479)}, "too wide for the hollow"),
    ):
        with pytest.raises(ValueError, match=words):
            FREE.replace(**changes)
    assert FREE.replace(length=0.2, ground=de.Ground(slope=2.0)).length == 0.2


def test_layouts_of_files_stand_on_the_ground_of_the_scene(tmp_path):
    gaps, thick = random_sizes(1)
    layout = FREE.layout(gaps[0], thick[0])
    flat = de.Layout(layout.spacing, layout.thickness)
    for kept, name in ((layout, "hilly.csv"), (flat, "flat.csv")):
        kept.to_csv(tmp_path / name)
        assert read_layout(tmp_path / name, FREE) == layout
    assert FREE.violations(layout) == []
    assert "on its ground; make the layout with `scene.layout`" in FREE.violations(flat)[0]
    assert "rise and tilt of 0" in FREE.replace(ground=None).violations(layout)[0]
