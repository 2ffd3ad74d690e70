"""Search without learning: spacing schedules, always against the best uniform pitch.

from optimize import search, METHODS

result = search("sprint", method="cma", budget=5000, seed=0)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from optimize.methods import METHODS
    from optimize.problem import Problem
    from optimize.result import SearchResult
    from optimize.searching import search
    from optimize.sweeping import sweep

__all__ = ["METHODS", "Problem", "SearchResult", "search", "sweep"]

_HOMES = {
    "METHODS": "methods",
    "Problem": "problem",
    "SearchResult": "result",
    "search": "searching",  # a module called search would hide the function
    "sweep": "sweeping",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'optimize' has no attribute '{name}'")
    value = getattr(import_module(f"optimize.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
