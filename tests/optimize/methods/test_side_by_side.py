"""Searches side by side: one batch for all, and each finds what it finds alone."""

from __future__ import annotations

import numpy as np
import pytest

from optimize.evaluator import Budget, BudgetSpent
from optimize.methods.gradient.local_search import Ascent, climb, climbing
from optimize.methods.gradient.lockstep import Asked, Search, side_by_side
from optimize.problem import Problem
from optimize.recorder import Recorder


def test_climbs_that_ask_side_by_side_share_every_batch(scenes) -> None:
    problem = Problem(scenes["both"])
    starts = np.random.default_rng(0).random((3, problem.dimension))
    asked: list[int] = []

    def budget() -> Budget:
        asked.clear()
        return Budget(Recorder(problem), watch=lambda b: asked.append(b.spent))

    one_climb = [Ascent(start) for start in starts]
    climb(budget(), one_climb, 30)
    batches = list(asked)
    three = [Ascent(start) for start in starts]
    longest = max(range(3), key=lambda i: one_climb[i].told)
    # who ends last comes first, for its end is that of all
    order = [longest, *(i for i in range(3) if i != longest)]
    side_by_side(budget(), [climbing([three[i]], 30) for i in order])
    assert asked == batches
    assert three[longest].score == one_climb[longest].score
    assert len(batches) == three[longest].told < sum(arm.told for arm in three)


def test_who_waits_is_asked_again_and_the_first_ends_it(scenes) -> None:
    problem, told = Problem(scenes["one-gap"]), []

    def waiting() -> Search:
        while len(told) < 3:
            yield None

    def working() -> Search:
        while True:
            scores, slopes = yield Asked(np.full((2, 1), 0.5))
            told.append((scores.shape, slopes.size))

    budget = Budget(Recorder(problem), 100)
    side_by_side(budget, [waiting(), working()])
    assert told == [((2,), 0)] * 3
    assert budget.spent == 8  # the last two before anybody could know
    with pytest.raises(BudgetSpent, match="limit of 100 rows reached"):
        side_by_side(budget, [working()])
