"""Ready: a trained agent as one of `optimize`'s methods; it builds its row at once.

Named `agent` in the entry-point group `domino.methods`: `agent:RUN` takes what `agents.evaluate`
does.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from optimize.evaluation.budget import Budget

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
    from agents.single.evaluation import POLICIES, evaluate, shipped

    if run not in shipped() and not (Path(run) / "policy.npz").exists():
        raise ValueError(
            f"method 'agent:{run}': {run or 'nothing'} holds no policy; name the folder of a "
            f"finished training, or one that ships: {', '.join(shipped())}"
        )

    def method(budget: Budget, rng: np.random.Generator) -> None:
        folder = Path(run) if Path(run).exists() else POLICIES / run
        budget.already_spent(training_seconds(folder))
        row = evaluate(run, budget.problem.scene).layout
        budget.score(budget.problem.design(row))

    return method
