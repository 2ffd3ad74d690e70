"""Searches side by side: what they ask for at the same time is simulated as one batch.

A search here is a generator that yields what it wants to know and is sent the answer.  Batches of
many rows keep all cores busy, in the threads of the simulator, while everything that decides stays
in one thread: results are the same to the bit for any number of threads.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from optimize.evaluator import Budget

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Asked:
    """Scores that a search wants to know.

    Attributes
    ----------
    designs
        (B, n) designs.
    gradients
        Whether their gradients are wanted too; that of a wave that dies is zero.
    """

    designs: Floats
    gradients: bool = False


Answer = tuple[Floats, Floats]
"""Scores (B,), and gradients (B, n) where they were asked for."""

Search = Generator[Asked | None, Answer, None]
"""Yields None where it waits for what the others find."""


def side_by_side(budget: Budget, searches: Sequence[Search]) -> None:
    """Go on with all searches in lockstep until the first of them ends.

    Parameters
    ----------
    budget
        Pays for the evaluations.
    searches
        In the order in which they are told their answers.

    Raises
    ------
    BudgetSpent
        Where not all can be paid for.
    """
    live = list(searches)
    asked: dict[Search, Asked | None] = {}
    told: dict[Search, Answer] = {}
    while True:
        for search in list(live):
            try:
                asked[search] = search.send(told[search]) if search in told else next(search)
            except StopIteration:
                if search is searches[0]:
                    return
                live.remove(search)
                del asked[search]
        told = _answers(budget, asked, gradients=False) | _answers(budget, asked, gradients=True)


def _answers(
    budget: Budget, asked: dict[Search, Asked | None], *, gradients: bool
) -> dict[Search, Answer]:
    wanted = {s: a.designs for s, a in asked.items() if a is not None and a.gradients is gradients}
    if not wanted:
        return {}
    designs = np.concatenate(list(wanted.values()))
    if gradients:
        scores, slopes = budget.scores_and_gradients(designs, of_dying=False)
    else:
        scores, slopes = budget.scores(designs), np.empty((len(designs), 0))
    ends = np.cumsum([len(rows) for rows in wanted.values()])[:-1]
    parts = zip(np.split(scores, ends), np.split(slopes, ends), strict=True)
    return dict(zip(wanted, parts, strict=True))
