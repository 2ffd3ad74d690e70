"""Evaluator: counts, the best layouts, and limits."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from optimize import Evaluator, Problem, open_store, run_experiment
from optimize.evaluator import BudgetSpent

PROBLEM = Problem("sprint")


@pytest.mark.parametrize(("call", "words"), [
    (lambda: Evaluator("sprint"), "problem = 'sprint': give a Problem, such as Problem"),
    (lambda: Evaluator(PROBLEM, 0), "max_evaluations = 0: give a whole number, at least 1"),
    (lambda: Evaluator(PROBLEM, max_seconds="1"), "max_seconds = '1' s: give a finite number"),
    (lambda: Evaluator(PROBLEM, tolerance=-1), "tolerance = -1: give a finite number, more than 0"),
    (lambda: Evaluator(PROBLEM, callback=5), "callback = 5: give a function of the Evaluator"),
    (lambda: Evaluator(PROBLEM, clock=lambda: "x"), "clock() = 'x' s: give a finite number"),
    (lambda: Evaluator(PROBLEM, journal=5), "journal = 5: give a Journal, or None"),
    (lambda: Evaluator(PROBLEM).borrow(5, 9).__enter__(), "problem = 5: give the Problem of shor"),
    (lambda: Evaluator(PROBLEM).evaluate(0.5), "designs has shape (1, 1): give (B, 39)"),
    (lambda: Problem("sprint", 0).evaluate(np.ones(39)), "rtol = 0: give a finite number from"),
    (lambda: open_store(3), "path = 3: give a path"),
    (lambda: PROBLEM.design("x"), "layout = 'x': give a Layout"),
    (lambda: run_experiment([], 3), "executor = 3: give a concurrent.futures.Executor"),
])  # fmt: skip
def test_wrong_arguments_are_rejected(call, words):
    with pytest.raises((ValueError, TypeError), match=re.escape(words)):
        call()


def test_an_evaluator_raises_at_its_limit(scenes):
    evaluator = Evaluator(Problem(scenes["spacing"]), 10)
    designs = np.random.default_rng(0).random((7, evaluator.problem.dimension))
    assert evaluator.evaluate(designs).score.shape == (7,)
    with pytest.raises(BudgetSpent):
        evaluator.evaluate(designs)
    assert evaluator.evaluations == 10  # as many as remained
    assert (evaluator.progress, evaluator.remaining) == (1.0, 0.0)
    lateness = partial(evaluator.evaluate_by, "lateness", compute=None)
    for method in (evaluator.evaluate, lateness):
        with pytest.raises(BudgetSpent, match="limit of 10 layouts reached"):
            method(designs[0])
    assert evaluator.evaluations == 10


def test_the_best_design_is_kept(scenes):
    best = []
    evaluator = Evaluator(Problem(scenes["spacing"]), callback=lambda e: best.append(e.best_score))
    with pytest.raises(ValueError, match="no designs are given: evaluate one or more"):
        evaluator.evaluate(np.empty((0, evaluator.problem.dimension)))
    with pytest.raises(ValueError, match="nothing has been scored yet"):
        evaluator.best  # noqa: B018 - reading it is the test
    designs = np.random.default_rng(0).random((50, evaluator.problem.dimension))
    scores = [evaluator.evaluate(x).score for x in designs]
    assert best == np.maximum.accumulate(scores).tolist()
    assert evaluator.best_score == max(scores)
    evaluator.best[:] = 0.0  # a copy
    assert np.array_equal(evaluator.best, designs[np.argmax(scores)])
    assert [s for _, _, _, s in evaluator.trace] == sorted(set(best))
    assert not evaluator.stop_reason


@pytest.mark.parametrize("entry", [np.nextafter(1.0, 2.0), -5e-324])
def test_rounding_errors_outside_of_the_box_are_clipped(scenes, entry):
    evaluator = Evaluator(Problem(scenes["spacing"]))
    evaluator.evaluate(np.full(evaluator.problem.dimension, entry))
    assert np.array_equal(evaluator.best, np.full(evaluator.problem.dimension, round(entry)))


@pytest.mark.parametrize("name", ["length-both", "dying"])
def test_scores_do_not_depend_on_the_order_of_requests(scenes, name):
    """An optimiser may ask for more than it evaluates, and learn the scores in any order."""
    problem = Problem(scenes[name])
    designs = np.random.default_rng(0).random((16, problem.dimension))
    first, second = Evaluator(problem), Evaluator(problem)
    scores = [first.evaluate(x, True) for x in designs]
    again = [second.evaluate(x, True) for x in designs[::-1]][::-1]
    assert [s.score for s in again] == [s.score for s in scores]
    assert np.array_equal([s.gradient for s in again], [s.gradient for s in scores])
    assert np.array_equal(first.best, second.best)


@pytest.mark.parametrize("name", ["dying", "spacing"])
def test_gradients_count_once_and_are_zero_where_the_wave_stops(scenes, name):
    scene = scenes[name]
    problem = Problem(scene)
    designs = np.random.default_rng(0).random((12, problem.dimension))
    evaluator = Evaluator(problem)
    evaluator.evaluate(designs)
    waves = [scene.simulate(problem.layout(x)) for x in designs]
    assert evaluator.falls == sum(int(np.isfinite(w.stall_margin).sum()) for w in waves)
    result, expected = evaluator.evaluate(designs, True), problem.evaluate(designs, True)
    assert np.array_equal(result.score, expected.score)
    assert np.array_equal(result.gradient, expected.gradient)
    stopped = expected.score < 0.0
    assert stopped.any() == (name == "dying")
    assert not expected.gradient[stopped].any()
    assert expected.gradient[~stopped].any(axis=1).all()
    assert evaluator.evaluations == 24


def test_layouts_simulated_elsewhere_are_recorded(scenes):
    problem = Problem(scenes["spacing"])
    evaluator = Evaluator(problem, 5, max_seconds=1000.0)
    designs = np.random.default_rng(0).random((4, problem.dimension))
    scores, requests = problem.evaluate(designs), []
    evaluator.record(scores, lambda i: requests.append(i) or designs[i])
    assert requests == [int(np.argmax(scores.score))]
    assert (evaluator.remaining, evaluator.best_score) == (1.0, scores.score.max())
    assert evaluator.falls == scores.falls.sum()
    evaluator.add_seconds(900.0)
    assert 0.9 <= evaluator.seconds / 1000.0 < 1.0


def test_shorter_layouts_count_by_their_dominoes(scenes):
    scene = scenes["spacing"]
    evaluator = Evaluator(Problem(replace(scene, count=14)), 10)
    shorter = Problem(scene)
    with evaluator.borrow(shorter, 5) as borrowed:
        borrowed.evaluate(np.full((5, shorter.dimension), 0.3))
    assert evaluator.evaluations == 3  # five of 7 dominoes cost as much as two and a half of 14
    assert evaluator.falls == borrowed.falls
    with evaluator.borrow(shorter, 1000) as borrowed:  # at most half of what remains
        borrowed.evaluate(np.full((50, shorter.dimension), 0.3))
    assert (borrowed.evaluations, evaluator.evaluations) == (7, 7)
    evaluator.evaluate(np.full((2, evaluator.problem.dimension), 0.3))
    with pytest.raises(BudgetSpent), evaluator.borrow(shorter, 1) as borrowed:
        borrowed.evaluate(np.full((2, shorter.dimension), 0.3))
