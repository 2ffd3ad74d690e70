"""Design vectors, gradients and searches in scenes with rules."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from ruled_scenes import BOX, RULED
from uneven_layouts import UNEVEN_SCENE

import domino_env as de
from optimize import METHODS, Problem, search
from optimize.methods.gradient.least_squares import compute_lateness


@pytest.mark.parametrize("name", RULED)
def test_projected_designs_are_those_of_their_layouts(name):
    problem = Problem(RULED[name])
    outside = 3.0 * np.random.default_rng(1).random((20, problem.dimension)) - 1.0
    for x, y in zip(outside, problem.project(outside), strict=True):
        layout = problem.layout(np.clip(x, 0.0, 1.0))
        assert problem.design(layout) == pytest.approx(y, abs=1e-12)
        if problem.equality is not None:
            coefficients, total = problem.equality
            assert coefficients @ y == pytest.approx(total, abs=1e-12)


def test_assign_finds_the_best_order_of_a_small_box():
    """Against all orders of the box at gaps that the scene fixes."""
    scene = RULED["stock-order"]
    orders = set(permutations(BOX.without(0.0075).dominoes.tolist()))
    batch = scene.batch(np.full((len(orders), 8), 0.018), np.array(list(orders)))
    scores = scene.evaluate(batch).score
    result = search(scene, "assign", budget=600, seed=0)
    assert result.score == pytest.approx(scores.max(), rel=1e-6)


# gradients --------------------------------------------------------------------------------------

SLOPE = UNEVEN_SCENE.replace(ground=de.Ground(slope=-3.0))
ROW = UNEVEN_SCENE.replace(ground=None, spacing=(0.002, 0.04), run_out=de.RunOut(5, 0.004))
PLAIN = ["spacing", "one-gap", "thickness", "both", "dying", "length", "length-both"]
SMOOTH = {
    **{name: RULED[name] for name in ("growth-both", "growth")},
    "tempo": replace(de.load_scene("tempo"), count=7),
    "quantile": replace(
        de.load_scene("jitter"), count=7, placement=de.Placement(0.0005, 30, 0.05)
    ),
    "noise": replace(RULED["free"], placement=de.Placement(1e-3, 5)),
    "tempo-noise": replace(de.load_scene("tempo-noise"), count=7, placement=de.Placement(1e-3, 5)),
    "in-heights": replace(RULED["growth-both"], growth=None, objective="mean_speed"),
    "uneven ground": UNEVEN_SCENE,
    "slope": SLOPE,
    "schedule on uneven ground": UNEVEN_SCENE.replace(
        objective="tempo", settings=de.Tempo(30.0, 50.0, tolerance=0.1)
    ),
    "quantile on uneven ground": UNEVEN_SCENE.replace(placement=de.Placement(0.0005, 8, 0.3)),
    "run-out": ROW,
    "run-out on a slope": SLOPE.replace(run_out=de.RunOut(5, 0.01)),
    "run-out after a length": ROW.replace(length=0.2),
    "run-out with limits": ROW.replace(limits=de.Limits(stall_margin=0.05)),
    "run-out with noise": ROW.replace(placement=de.Placement(1e-3, 4)),
    "run-out with a quantile": ROW.replace(placement=de.Placement(1e-3, 4, 0.5)),
}  # fmt: skip


@pytest.mark.parametrize("name", [*PLAIN, *SMOOTH])
def test_gradients_match_finite_differences(scenes, name):
    """Against Richardson's extrapolation of wider differences at a closer tolerance."""
    scene = (scenes | SMOOTH)[name]
    problem, exact = Problem(scene), Problem(scene, rtol=1e-13)
    checked = 0
    for x in 0.1 + 0.8 * np.random.default_rng(5).random((30, problem.dimension)):
        steps = []
        for h in (1e-4, 2e-4, 4e-4):
            step = h * np.eye(problem.dimension)
            difference = exact.evaluate(x + step).score - exact.evaluate(x - step).score
            steps.append(difference / (2.0 * h))
        fine = (4.0 * steps[0] - steps[1]) / 3.0
        coarse = (4.0 * steps[1] - steps[2]) / 3.0
        size = np.abs(fine).max()
        if np.abs(fine - coarse).max() > 1e-7 * size:
            continue  # a kink within reach of the differences, where there is no gradient
        scores = problem.evaluate(x, gradient=True)
        assert scores.score == pytest.approx(exact.evaluate(x).score, rel=1e-9)
        if scores.score < 0.0:
            assert not scores.gradient.any()
            continue
        assert scores.gradient == pytest.approx(fine, abs=2e-7 * size)
        if (checked := checked + 1) == 10:
            return
    pytest.fail(f"only {checked} of 30 points are no kinks")


# searches ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["stock-length", "growth"])
def test_every_method_keeps_the_rules(method, name):
    result = search(RULED[name], method, budget=60, seed=2)
    assert RULED[name].violations(result.layout) == []
    assert result.score == RULED[name].score(result.layout)


def test_the_gradient_of_lateness_matches_finite_differences():
    problem = Problem(SMOOTH["tempo"])
    x = np.full(problem.dimension, 0.4)
    _, (lateness, gradient) = compute_lateness(problem, x)
    for i in (0, 3, 8):
        step = 1e-6 * np.eye(problem.dimension)[i]
        later, earlier = (compute_lateness(problem, x + sign * step)[1][0] for sign in (1, -1))
        assert gradient[:, i] == pytest.approx((later - earlier) / 2e-6, abs=1e-6)
    assert lateness.shape == (6,)
