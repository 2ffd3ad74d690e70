"""Searches side by side share their batches, and each finds what it finds alone."""

import numpy as np

from optimize.evaluator import Evaluator
from optimize.methods.gradient.local_search import LocalSearch, advance, run_local_searches
from optimize.methods.gradient.lockstep import run_in_lockstep
from optimize.problem import Problem


def test_climbs_that_ask_side_by_side_share_every_batch(scenes):
    problem = Problem(scenes["both"])
    starts = np.random.default_rng(0).random((3, problem.dimension))
    asked: list[int] = []

    def budget() -> Evaluator:
        asked.clear()
        return Evaluator(problem, callback=lambda e: asked.append(e.evaluations))

    one_climb = [LocalSearch(start) for start in starts]
    run_local_searches(budget(), one_climb, 30)
    batches = list(asked)
    three = [LocalSearch(start) for start in starts]
    longest = max(range(3), key=lambda i: one_climb[i].evaluations)
    # who ends last comes first, for its end is that of all
    order = [longest, *(i for i in range(3) if i != longest)]
    run_in_lockstep(budget(), [advance([three[i]], 30) for i in order])
    assert asked == batches
    assert three[longest].score == one_climb[longest].score
    assert len(batches) == three[longest].evaluations < sum(arm.evaluations for arm in three)
