"""Properties that every method has."""

import random
from itertools import count

import numpy as np
import pytest

import domino_env as de
from optimize import METHODS, Evaluator, search
from optimize.methods import scipy_methods
from optimize.methods.registry import installed_third_party

SCENES = ["spacing", "one-gap", "both", "length-both", "dying", "dead"]
ENDLESS = [name for name in METHODS if name != "uniform"]  # they go on until they are stopped

every_method = pytest.mark.parametrize("method", METHODS)
endless_method = pytest.mark.parametrize("method", ENDLESS)


@every_method
@pytest.mark.parametrize("name", SCENES)
def test_a_method_keeps_the_budget_and_the_rules_of_the_scene(scenes, simulated, method, name):
    scene = scenes[name]
    scene.uniform()
    simulated.clear()
    budget = 100 if method == "auto" else 40
    result = search(scene, method, budget=budget, seed=3)
    layouts, scores = zip(*simulated, strict=True)
    assert result.evaluations == len(layouts) == (budget if method in ENDLESS else 1)
    for layout in layouts:
        assert scene.violations(layout) == []
        if scene.length is not None:
            assert abs(layout.length - scene.length) < 1e-12
    best = max(scores)
    assert result.trace[-1][3] == best
    assert result.score == scene.score(result.layout) == pytest.approx(best, abs=2e-6)
    assert result.wave.rtol == result.uniform.wave.rtol == 1e-10
    assert result.uniform is scene.uniform()
    *counts, gains = (np.diff(column) for column in zip(*result.trace, strict=True))
    assert all(np.all(column >= 0.0) for column in counts)  # evaluations, falls, seconds
    assert np.all(gains[:-1] > 0.0)
    assert gains[-1] == 0.0
    completes = result.score > 0.0 and result.uniform.score > 0.0
    assert result.gain == (result.score / result.uniform.score - 1.0 if completes else None)


# the others are searched twice in test_journal.py
@pytest.mark.parametrize("method", ["auto", "cma", *installed_third_party()])
def test_a_method_is_bitwise_reproducible(bits, scenes, monkeypatch, tmp_path, method):
    """It uses no file, and no global random generator."""
    monkeypatch.chdir(tmp_path)
    first = search(scenes["dying"], method, budget=150, seed=11)
    np.random.seed(1)  # noqa: NPY002
    before = np.random.get_state()[1:3], random.getstate()  # noqa: NPY002
    (tmp_path / "cma_signals.in").write_text("{'timeout': 0, 'popsize': 3}")  # which pycma reads
    assert bits(search(scenes["dying"], method, budget=150, seed=11)) == bits(first)
    after = np.random.get_state()[1:3], random.getstate()  # noqa: NPY002
    assert [f.name for f in tmp_path.iterdir()] == ["cma_signals.in"]
    np.testing.assert_equal(after, before)


@endless_method
def test_ctrl_c_ends_a_method_with_the_best_so_far(scenes, simulated, method):
    scene = scenes["spacing"]
    scene.uniform()
    simulated.clear()
    batches = []

    def press(evaluator: Evaluator) -> None:
        batches.append(evaluator.evaluations)
        if len(batches) == 5:
            raise KeyboardInterrupt

    result = search(scene, method, budget=100_000, callback=press)
    assert result.interrupted
    scores = [score for _, score in simulated[2:]]  # a score and a gradient compile before
    assert result.evaluations == batches[-1] == len(scores)
    assert result.score == pytest.approx(max(scores), abs=2e-6)


@pytest.mark.parametrize(
    ("method", "seconds"), [(method, 1e-9) for method in ENDLESS] + [("auto", 1.0), ("cma", 1.0)]
)
def test_a_budget_of_seconds_ends_a_method_after_at_least_one_layout(scenes, method, seconds):
    ticks = count()  # a clock that advances by 10 ms whenever it is read
    result = search(scenes["spacing"], method, seconds=seconds, clock=lambda: 0.01 * next(ticks))
    assert not result.interrupted
    assert seconds <= result.seconds < seconds + 0.1
    assert result.evaluations >= 1
    assert result.score > 0.0


@pytest.mark.parametrize(
    ("method", "budget", "least"),
    [("cma", 3000, 1.02), ("l-bfgs", 300, 1.02), ("scp", 150, 1.02), ("auto", 800, 1.031)],
)
def test_a_method_beats_the_uniform_baseline_of_sprint(method, budget, least):
    result = search("sprint", method, budget=budget)
    assert result.wave.outcome == de.Outcome.PROPAGATED
    assert result.score > least * result.uniform.score
    assert result.wave.error_estimate < 1e-10


def test_auto_runs_slsqp_too_if_a_length_ties_gaps_and_thicknesses(scenes, monkeypatch):
    """With half of the effort; its better layouts are those of the search."""
    spent, original = {}, scipy_methods.descend

    def descend(solver, evaluator, start):
        before = evaluator.effort
        original(solver, evaluator, start)
        spent[solver] = spent.get(solver, 0) + evaluator.effort - before
        spent["all"] = evaluator.effort

    monkeypatch.setattr(scipy_methods, "descend", descend)
    for name, is_tied in (("length-both", True), ("length", False), ("both", False)):
        spent.clear()
        search(scenes[name], budget=3000, seed=1)
        assert bool(spent) == is_tied
        if is_tied:
            assert 0.3 < spent["SLSQP"] / spent["all"] < 0.7
