"""Searches in lockstep: simultaneous requests of several searches are simulated as one batch.

Here a search is a generator that yields requests and is sent the answers. Large batches occupy all
cores with threads of the simulator, while one thread advances the searches: results are bitwise the
same for any number of threads.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from domino_env.core.types import Floats
from optimize.evaluator import Evaluator


@dataclass(frozen=True)
class Request:
    """Request for scores.

    Attributes
    ----------
    designs
        (B, n) design vectors.
    gradient
        True to compute gradients too; they are 0 for a wave that stops or violates a limit.
    """

    designs: Floats
    gradient: bool = False


Answer = tuple[Floats, Floats]
"""Scores (B,), and gradients (B, n) if they were requested."""

Search = Generator[Request | None, Answer, None]
"""A search, which yields None while it waits for the others."""


def run_in_lockstep(evaluator: Evaluator, searches: Sequence[Search]) -> None:
    """Advance all searches in lockstep until the first in the sequence ends.

    Parameters
    ----------
    evaluator
        Evaluator of the requests.
    searches
        Searches, in the order in which they receive their answers.

    Raises
    ------
    BudgetSpent
        If a limit is reached.
    """
    running = list(searches)
    requests: dict[Search, Request | None] = {}
    answers: dict[Search, Answer] = {}
    while True:
        for search in list(running):
            try:
                has_answer = search in answers
                requests[search] = search.send(answers[search]) if has_answer else next(search)
            except StopIteration:
                if search is searches[0]:
                    return
                running.remove(search)
                del requests[search]
        answers = _evaluate(evaluator, requests, gradient=False)
        answers |= _evaluate(evaluator, requests, gradient=True)


def _evaluate(
    evaluator: Evaluator, requests: dict[Search, Request | None], *, gradient: bool
) -> dict[Search, Answer]:
    """Evaluate all requests with a gradient, or all without one."""
    groups = {s: r.designs for s, r in requests.items() if r is not None and r.gradient is gradient}
    if not groups:
        return {}
    designs = np.concatenate(list(groups.values()))
    scores = evaluator.evaluate(designs, gradient)
    gradients = scores.gradient if gradient else np.empty((len(designs), 0))
    ends = np.cumsum([len(part) for part in groups.values()])[:-1]
    parts = zip(np.split(scores.score, ends), np.split(gradients, ends), strict=True)
    return dict(zip(groups, parts, strict=True))
