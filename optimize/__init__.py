"""Search without learning: spacing schedules, always against the best uniform pitch.

from optimize import search, METHODS

result = search("sprint", method="cma", budget=5000, seed=0)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from domino_env.core.lazy import lazy_names

if TYPE_CHECKING:
    from optimize.comparison.runner import Comparison, compare
    from optimize.evaluation.budget import Budget
    from optimize.evaluation.result import SearchResult
    from optimize.executors.choice import open_executor
    from optimize.methods import METHODS
    from optimize.problem import Problem
    from optimize.records.shipped import BestKnown, best_known
    from optimize.searching.runner import search
    from optimize.studies import open_store
    from optimize.studies.running import run_tasks
    from optimize.studies.task import Task, TaskResult
    from optimize.sweeps.points import axis_of
    from optimize.sweeps.runner import Sweep, sweep

__all__ = [
    "METHODS",
    "BestKnown",
    "Budget",
    "Comparison",
    "Problem",
    "SearchResult",
    "Sweep",
    "Task",
    "TaskResult",
    "axis_of",
    "best_known",
    "compare",
    "open_executor",
    "open_store",
    "run_tasks",
    "search",
    "sweep",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "Comparison": "comparison.runner",
        "compare": "comparison.runner",
        "Budget": "evaluation.budget",
        "SearchResult": "evaluation.result",
        "open_executor": "executors.choice",
        "METHODS": "methods",
        "Problem": "problem",
        "BestKnown": "records.shipped",
        "best_known": "records.shipped",
        "search": "searching.runner",
        "open_store": "studies",
        "run_tasks": "studies.running",
        "Task": "studies.task",
        "TaskResult": "studies.task",
        "axis_of": "sweeps.points",
        "Sweep": "sweeps.runner",
        "sweep": "sweeps.runner",
    },
)
