"""Local searches on scores with kinks; perturbations."""

import numpy as np
import pytest

from optimize.methods.gradient.local_search import CoarseToFine, LocalSearch
from optimize.methods.search.perturbations import PERTURBATIONS
from optimize.methods.starts import coarse_matrix


def run(arm, objective):
    """Evaluate candidates until the search is done, at most 2000."""
    while not arm.done and arm.evaluations < 2000:
        assert np.all((arm.candidate >= 0.0) & (arm.candidate <= 1.0))
        arm.update(*objective(arm.candidate))


def quadratic(top, seed=0):
    """Return a concave quadratic of condition 100 with its maximum at `top`."""
    n = len(top)
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((n, n)))[0]
    curvature = turn @ np.diag(np.geomspace(1.0, 100.0, n)) @ turn.T

    def objective(x):
        return 5.0 - 0.5 * (x - top) @ curvature @ (x - top), curvature @ (top - x)

    return objective


def coarse_to_fine(start):
    return CoarseToFine(start, [coarse_matrix(1, len(start), 8), coarse_matrix(1, len(start), 20)])


@pytest.mark.parametrize(("search", "n"), [
    (LocalSearch, 1), (LocalSearch, 40),
    (LocalSearch, 300),  # with limited memory
    (coarse_to_fine, 60),
])  # fmt: skip
def test_a_local_search_finds_the_maximum_of_a_quadratic(search, n):
    arm = search(np.full(n, 0.5))
    run(arm, quadratic(0.5 + 0.3 * np.sin(np.arange(n) / 7.0)))
    assert arm.done
    assert arm.score == pytest.approx(5.0, abs=1e-3)


def test_a_local_search_finds_the_best_corner_or_face_of_the_box():
    """No component of the gradient leads into the box."""
    top = np.array([1.4, 0.3, -0.2, 0.6, 1.1])
    objective = quadratic(top, seed=3)
    arm = LocalSearch(np.full(5, 0.5))
    run(arm, objective)
    gradient = objective(arm.design)[1]
    low, high = arm.design <= 0.0, arm.design >= 1.0
    assert low.any()
    assert high.any()
    assert np.all(gradient[low] <= 1e-3)
    assert np.all(gradient[high] >= -1e-3)
    assert np.all(np.abs(gradient[~low & ~high]) < 0.02)


def test_a_local_search_keeps_a_given_sum():
    """Also where the projection, nearest in metres, is no projection of design vectors."""
    n = 30
    span, top = np.where(np.arange(n) < 15, 0.04, 0.008), 0.5 + 0.2 * np.sin(np.arange(n) / 7.0)
    objective, total = quadratic(top), span.sum() * 0.49

    def project(designs):
        return designs - ((designs @ span - total) / n)[:, None] / span

    arm = LocalSearch(np.full(n, 0.49), project, normal=span)
    run(arm, lambda x: (objective(x)[0], objective(x)[1] - (objective(x)[1] / span).mean() * span))
    curvature = np.array([objective(top)[1] - objective(top + unit)[1] for unit in np.eye(n)])
    change = np.linalg.solve(curvature, span)
    best = top - change * (span @ top - total) / (span @ change)
    assert arm.design @ span == pytest.approx(total, rel=1e-12)
    assert arm.score == pytest.approx(objective(best)[0], abs=1e-3)
    assert arm.evaluations < 100


@pytest.mark.parametrize("n", [2, 10])
def test_a_local_search_follows_a_kink(n):
    """The ridge -8 |x0 - x1²| bends; along it a smooth score rises to x = 0.7."""

    def objective(x):
        distance = x[0] - x[1] ** 2
        gradient = np.zeros(n)
        gradient[0] = -8.0 * np.sign(distance)
        gradient[1] = 16.0 * x[1] * np.sign(distance) - 2.0 * (x[1] - 0.7)
        gradient[2:] = -2.0 * (x[2:] - 0.4)
        score = -8.0 * abs(distance) - (x[1] - 0.7) ** 2 - ((x[2:] - 0.4) ** 2).sum()
        return 3.0 + score, gradient

    arm = LocalSearch(np.full(n, 0.1))
    run(arm, objective)
    assert arm.score == pytest.approx(3.0, abs=1e-5)
    assert arm.design[:2] == pytest.approx([0.49, 0.7], abs=5e-3)


def test_a_local_search_stops_at_a_jump_of_the_score():
    """Beyond x0 = 0.6 the wave stops: zero gradient and a negative score."""

    def objective(x):
        return (-0.3, np.zeros(2)) if x[0] > 0.6 else (1.0 + x[0] - x[1], np.array([1.0, -1.0]))

    arm = LocalSearch(np.array([0.2, 0.9]))
    run(arm, objective)
    assert arm.design[0] == pytest.approx(0.6, abs=1e-3)
    assert arm.design[0] <= 0.6
    assert arm.score >= 1.1 > 0.3  # it began at 0.3


# perturbations ----------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [(1, 39), (2, 39), (2, 1), (1, 2), (1, 6)])
@pytest.mark.parametrize("perturbation", PERTURBATIONS)
def test_a_perturbation_keeps_the_shape_and_its_parents(perturbation, shape):
    rng = np.random.default_rng(2)
    for _ in range(50):
        parents = rng.random((2, *shape))
        parents[0, 0, shape[1] - int(rng.integers(0, shape[1])) :] = 0.0
        copies = parents.copy()
        changed = perturbation(*parents, rng)
        assert changed.shape == shape
        assert np.all(np.isfinite(changed))
        assert np.array_equal(parents, copies)
