"""Searches that choose dominoes of a stock."""

from dataclasses import replace
from itertools import product

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
    children = assignment._children(problem, design, 60, np.random.default_rng(0))
    for child in children:
        assert box.violations(problem.layout(child)) == []
    changed = np.abs(children[:, -9:] - design[-9:]).max(axis=1) > assignment.SAME_DOMINO
    assert changed.mean() > 0.9
    used = {
        tuple(np.unique(problem.layout(child).thickness, return_counts=True)[1])
        for child in children
    }
    assert (len(used) > 1) == (box.name in ("spares", "fixed-gaps"))


def test_annealed_cycles_are_bitwise_reproducible_and_never_lose_the_best(box, bits, monkeypatch):
    small = {"PROPOSALS": 20, "CHILDREN": 10, "CYCLE": 2, "MAX_IDLE": 1, "LEAST_GAIN": 1e-2}
    for name, value in small.items():
        monkeypatch.setattr(assignment, name, value)
    first, again = (search(box, budget=700, seed=4) for _ in range(2))
    assert bits(first) == bits(again)
    assert "generations gained" in first.stop_reason
    assert box.violations(first.layout) == []
    assert first.score == pytest.approx(first.trace[-1][3], abs=2e-6)


def test_an_assignment_with_few_changes_is_the_best():
    random = np.random.default_rng(0)
    kinds, current = np.array([2, 2, 2]), np.array([0, 0, 1, 1, 2])
    for changes in (0, 2, 3, 5):
        prices = random.random((5, 3))
        allowed = [
            order for order in product(range(3), repeat=5)
            if np.all(np.bincount(order, minlength=3) <= kinds)
            and np.sum(np.array(order) != current) <= changes
        ]  # fmt: skip
        least = min(prices[np.arange(5), order].sum() for order in allowed)
        assigned = assignment.assign(prices, kinds, current, changes)
        assert tuple(assigned.tolist()) in allowed
        assert prices[np.arange(5), assigned].sum() == pytest.approx(least)
