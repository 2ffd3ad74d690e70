"""A line on the terminal while a search runs: how far, the best speed, the gain over uniform."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from domino_env.core.progress import progress_bar
from domino_env.scenes.uniform import gain

if TYPE_CHECKING:
    from optimize.evaluator import Budget

LINE = "{desc} {percentage:.0f} %, {elapsed}{postfix}"  # where there is no terminal
FORMAT = "{desc} {percentage:3.0f}%|{bar}| {elapsed}{postfix}"


class Watch(Protocol):
    """What is called with the budget after every batch of a search."""

    def __call__(self, budget: Budget, /) -> None:
        """Look at the budget."""


@contextmanager
def progress_line(name: str, mark: float, shown: bool | None, unit: str = "m/s") -> Iterator[Watch]:
    """Keep a line on the terminal, and yield what moves it.

    Parameters
    ----------
    name
        What to call the search.
    mark
        Score of the best uniform row, the baseline.
    shown
        Whether there is a line; None: where standard error is a terminal, and elsewhere a new
        line now and then.
    unit
        Of the scores.
    """
    if shown is False:
        yield lambda budget: None
        return
    looks: dict[str, Any] = {"total": 1.0, "desc": name, "bar_format": FORMAT, "leave": False}
    with progress_bar(shown, line=LINE, dynamic_ncols=True, **looks) as line:

        def watch(budget: Budget) -> None:
            line.set_postfix_str(best_so_far(budget.best_score, mark, unit), refresh=False)
            line.update(budget.part - line.n)

        yield watch


def best_so_far(score: float, mark: float, unit: str = "m/s") -> str:
    """Say the best score and its gain over uniform."""
    if score <= 0.0:
        return f"no row runs through yet, the best to {1.0 + score:.0%}"
    lead = gain(score, mark)
    against = "" if lead is None else f", {lead:+.2%} against uniform"
    return f"best {score:.5f} {unit}".rstrip() + against
