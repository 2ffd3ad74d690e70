"""Budgets: what is counted, what is kept, and when they end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from optimize import Problem, search
from optimize.evaluator import PATIENT, Budget, BudgetSpent
from optimize.journal import Journal
from optimize.recorder import Recorder
from optimize.run_folder import JOURNAL


def test_a_budget_that_is_spent_raises_into_the_method(scenes) -> None:
    budget = Budget(Recorder(Problem(scenes["spacing"])), evaluations=10)
    designs = np.random.default_rng(0).random((7, budget.problem.dimension))
    assert budget.scores(designs).shape == (7,)
    with pytest.raises(BudgetSpent):
        budget.scores(designs)
    assert budget.spent == 10  # what could be paid for was simulated
    assert budget.part == 1.0
    for ask in (budget.score, budget.score_and_gradient, budget.lateness):
        with pytest.raises(BudgetSpent):
            ask(designs[0])
    assert budget.spent == 10


def test_a_budget_keeps_the_best(scenes) -> None:
    seen = []
    recorder = Recorder(Problem(scenes["spacing"]))
    budget = Budget(recorder, watch=lambda b: seen.append(b.best_score))
    with pytest.raises(ValueError, match="nothing has been scored yet"):
        budget.best  # noqa: B018 - reading it is the test
    designs = np.random.default_rng(0).random((50, budget.problem.dimension))
    scores = [budget.score(x) for x in designs]
    assert seen == np.maximum.accumulate(scores).tolist()
    assert budget.best_score == max(scores)
    assert np.array_equal(budget.best, designs[np.argmax(scores)])
    assert [s for _, _, _, s in budget.trace] == sorted(set(seen))
    assert budget.part == len(designs) / PATIENT  # nothing limits it
    assert not budget.over


def test_falls_count_what_was_simulated(scenes) -> None:
    scene = scenes["dying"]
    budget = Budget(Recorder(Problem(scene)))
    designs = np.random.default_rng(0).random((40, budget.problem.dimension))
    waves = [scene.simulate(budget.problem.layout(x)) for x in designs]
    assert len({wave.outcome for wave in waves}) > 1
    budget.scores(designs)
    expected = sum(int(np.isfinite(wave.stall_margin).sum()) for wave in waves)
    assert budget.falls == expected


@pytest.mark.parametrize("name", ["dying", "spacing"])
def test_gradients_are_the_problems_and_every_wave_is_counted(scenes, name: str) -> None:
    problem = Problem(scenes[name])
    designs = np.random.default_rng(0).random((12, problem.dimension))
    budget = Budget(Recorder(problem))
    found = budget.scores_and_gradients(designs)
    truth = problem.scores_and_gradients(designs)
    assert all(np.array_equal(a, b) for a, b in zip(found, truth, strict=True))
    without = problem.evaluate(designs).without_gradient
    dead = int(without.sum())
    assert (dead > 0) == (name == "dying")
    assert budget.spent == 12 + 2 * problem.dimension * dead
    before = budget.spent
    _, slopes = budget.scores_and_gradients(designs, of_dying=False)
    assert budget.spent == before + 12
    assert not slopes[without].any()


@pytest.mark.parametrize("remembered", [False, True])
def test_time_spent_before_counts_with_a_journal_too(
    scenes, tmp_path: Path, remembered: bool
) -> None:
    scene, journal = scenes["spacing"], None
    if remembered:
        journal = Journal(tmp_path / "j", scene, "any", 0, {}, resume=False)
    with Recorder(Problem(scene), journal) as recorder:
        budget = Budget(recorder, seconds=1000.0)
        budget.already_spent(400.0)
        assert 400.0 <= budget.elapsed < 500.0
        assert 0.4 <= budget.part < 0.5


def test_a_large_journal_goes_when_its_search_has_finished(
    scenes, tmp_path: Path, monkeypatch
) -> None:
    def stop(budget: Budget) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("optimize.journal.KEPT", 100)
    search(scenes["spacing"], "random", 300, folder=tmp_path, watch=stop)
    assert (tmp_path / JOURNAL).exists()  # it can go on
    search(scenes["spacing"], "random", 300, folder=tmp_path, resume=True)
    assert not (tmp_path / JOURNAL).exists()
