"""Search without learning: spacing schedules, always against the best uniform pitch.

from optimize import search, METHODS

result = search("sprint", method="cma", budget=5000, seed=0)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from optimize.comparison.runner import Comparison, compare
    from optimize.evaluation.result import SearchResult
    from optimize.methods import METHODS
    from optimize.problem import Problem
    from optimize.records.shipped import BestKnown, best_known
    from optimize.searching.runner import search
    from optimize.sweeps.points import axis_of
    from optimize.sweeps.runner import Sweep, sweep

__all__ = [
    "METHODS",
    "BestKnown",
    "Comparison",
    "Problem",
    "SearchResult",
    "Sweep",
    "axis_of",
    "best_known",
    "compare",
    "search",
    "sweep",
]

# no module has the name of a function here: it would hide it in some order of imports
_HOMES = {
    "METHODS": "methods",
    "BestKnown": "records.shipped",
    "Comparison": "comparison.runner",
    "Problem": "problem",
    "SearchResult": "evaluation.result",
    "Sweep": "sweeps.runner",
    "axis_of": "sweeps.points",
    "best_known": "records.shipped",
    "compare": "comparison.runner",
    "search": "searching.runner",
    "sweep": "sweeps.runner",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'optimize' has no attribute '{name}'")
    value = getattr(import_module(f"optimize.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
