"""Searches in lockstep share their batches, and each has the result that it has alone."""

import numpy as np

from optimize.evaluator import Evaluator
from optimize.methods.gradient.local_search import LocalSearch, advance, run_local_searches
from optimize.methods.gradient.lockstep import run_in_lockstep
from optimize.problem import Problem


def test_searches_in_lockstep_share_every_batch(scenes):
    problem = Problem(scenes["both"])
    starts = np.random.default_rng(0).random((3, problem.dimension))
    counts: list[list[int]] = [[], []]
    evaluators = [
        Evaluator(problem, callback=lambda e, numbers=numbers: numbers.append(e.evaluations))
        for numbers in counts
    ]
    together = [LocalSearch(start) for start in starts]
    run_local_searches(evaluators[0], together, 30)
    # the end of the first search ends all: the longest comes first
    order = sorted(range(3), key=lambda i: -together[i].evaluations)
    single = [LocalSearch(starts[i]) for i in order]
    run_in_lockstep(evaluators[1], [advance([search], 30) for search in single])
    assert counts[0] == counts[1]
    assert single[0].score == together[order[0]].score
    assert len(counts[0]) == single[0].evaluations < sum(search.evaluations for search in single)
