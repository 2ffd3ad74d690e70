"""Trained agents as one of `optimize`'s methods: they build their rows at once.

Named `agent` in the entry-point group `domino.methods`: `agent:RUN` takes what `agents.evaluate`
does.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from optimize.evaluator import Budget

    Method = Callable[[Budget, np.random.Generator], None]


def agent(run: str) -> Method:
    """Make the method that builds the row of a trained agent; its training counts as time spent.

    Parameters
    ----------
    run
        What `agents.evaluate` takes.

    Raises
    ------
    ValueError
        For what is no agent.
    """
    from agents.base.run_files import training_seconds
    from agents.evaluation.one_scene import folder_of, load_policy

    try:
        policy = load_policy(run)
    except ValueError as error:
        raise ValueError(f"method 'agent:{run}': {error}") from None

    def method(budget: Budget, rng: np.random.Generator) -> None:
        budget.already_spent(training_seconds(folder_of(run)))
        row = policy.build(budget.problem.scene).layout
        budget.score(budget.problem.design(row))

    return method
