"""Searches that choose dominoes of a stock."""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

import domino_env as de
from optimize import Problem, search
from optimize.methods.search import assignment

KINDS, FEW, SPARES = (0.005, 0.0075, 0.01), (3, 4, 3), (5, 4, 6)
BOXES = {
    "exact": {"stock": de.Stock(KINDS, FEW)},
    "spares": {"stock": de.Stock(KINDS, SPARES)},
    "length": {"stock": de.Stock(KINDS, FEW), "length": 0.2},
    "fixed-gaps": {"stock": de.Stock(KINDS, SPARES), "spacing": (0.015, 0.015)},
}


@pytest.fixture(scope="module", params=BOXES)
def box(request):
    scene = de.load_scene("stock")
    scene = replace(
        scene, name=request.param, title="a small box", count=10, **BOXES[request.param]
    )
    scene.uniform()
    return scene


def test_random_changes_keep_the_box_and_change_the_order(box):
    problem = Problem(box)
    design = problem.design(box.uniform().layout)
    memory = deque([design])
    children = assignment._children(problem, design, memory, np.random.default_rng(0))
    for child in children:
        assert box.violations(problem.layout(child)) == []
    changed = np.abs(children[:, -9:] - design[-9:]).max(axis=1) > assignment.SAME_DOMINO
    assert changed.mean() > 0.9
    used = {
        tuple(np.unique(problem.layout(child).thickness, return_counts=True)[1])
        for child in children
    }
    assert (len(used) > 1) == (box.name in ("spares", "fixed-gaps"))


def test_predicted_gaps_follow_those_of_refined_layouts():
    """With coefficients of each place, also if few thicknesses change there."""
    rng = np.random.default_rng(0)
    slopes = rng.uniform(-0.2, 0.2, (9, 3))

    def gaps(thickness):
        around = np.pad(thickness, ((0, 0), (1, 1)))
        return sum(slopes[:, k] * around[:, k : k + 9] for k in range(3))

    thickness = rng.choice([0.0, 0.5, 1.0], (200, 9))
    memory = deque(np.concatenate([0.4 + gaps(thickness), thickness], axis=1))
    changes = rng.choice([-0.5, 0.0, 0.5], (7, 9))
    predicted = assignment._gap_changes(memory, changes)
    np.testing.assert_allclose(predicted, gaps(changes), atol=1e-3)
    few = deque(list(memory)[:4])
    error = np.abs(assignment._gap_changes(few, changes) - gaps(changes)).mean()
    assert np.abs(predicted - gaps(changes)).mean() < error < 2.0 * np.abs(slopes).mean()
    np.testing.assert_equal(assignment._gap_changes(deque([few[0]]), changes), 0.0)


def test_annealed_cycles_are_bitwise_reproducible_and_never_lose_the_best(box, bits, monkeypatch):
    small = {"CHILDREN": 10, "CYCLE": 2}
    for name, value in small.items():
        monkeypatch.setattr(assignment, name, value)
    first, again = (search(box, budget=700, seed=4) for _ in range(2))
    assert bits(first) == bits(again)
    assert "generations gained" in first.stop_reason
    assert box.violations(first.layout) == []
    assert first.score == pytest.approx(first.trace[-1][3], abs=2e-6)
