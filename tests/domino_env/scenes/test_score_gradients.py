"""Gradients of scores, with every stage of the scoring, compared with differences."""

import numpy as np
import pytest
from uneven_layouts import UNEVEN_SCENE

import domino_env as de

STEPS = np.array([-2.0, -1.0, 1.0, 2.0])
WEIGHTS = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
UNEVEN = UNEVEN_SCENE
SLOPE = UNEVEN.replace(ground=de.Ground(slope=-3.0))
ROW = UNEVEN.replace(ground=None, spacing=(0.002, 0.04), run_out=de.RunOut(5, 0.004))
SCENES = {
    "uneven ground": UNEVEN,
    "slope": SLOPE,
    "schedule": UNEVEN.replace(objective="tempo", settings=de.Tempo(30.0, 50.0, tolerance=0.1)),
    "quantile": UNEVEN.replace(placement=de.Placement(0.0005, 8, 0.3)),
    "run-out": ROW,
    "run-out on a slope": SLOPE.replace(run_out=de.RunOut(5, 0.01)),
    "run-out after a length": ROW.replace(length=0.2),
    "run-out with limits": ROW.replace(limits=de.Limits(stall_margin=0.05)),
    "run-out with noise": ROW.replace(placement=de.Placement(1e-3, 4)),
    "run-out with a quantile": ROW.replace(placement=de.Placement(1e-3, 4, 0.5)),
}


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_gradients_match_finite_differences(scene):
    """On the ground, all later dominoes move along it with a gap or a thickness."""
    rng, pairs, step = np.random.default_rng(2), scene.count - 1, 1e-6
    sizes = rng.uniform(0.009, 0.02, pairs), rng.uniform(0.0075, 0.0115, pairs)
    batch = scene.batch(*(size[None] for size in sizes), rtol=1e-13)
    scores = scene.evaluate(batch, gradient=True)
    assert scores.score[0] > 0.0
    moved = step * (STEPS[:, None, None] * np.eye(pairs)).reshape(-1, pairs)
    for k, exact in enumerate(scores.gradient[:2]):
        placed = [size + moved * (i == k) for i, size in enumerate(sizes)]
        values = scene.evaluate(scene.batch(*placed, rtol=1e-13)).score.reshape(4, pairs)
        difference = WEIGHTS @ values / step
        np.testing.assert_allclose(exact[0], difference, rtol=0, atol=1e-8 * np.abs(exact).max())
