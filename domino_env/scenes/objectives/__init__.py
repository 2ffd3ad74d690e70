"""Objectives of scenes, one class each.

All modules of this folder are searched for them, so that a new objective is one file.
"""

from importlib import import_module
from pkgutil import iter_modules

from domino_env.scenes.objectives.base import Evaluation, Objective, ScoreGradient

__all__ = ["OBJECTIVES", "Evaluation", "Objective", "ScoreGradient"]


def _found() -> dict[str, type[Objective]]:
    modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
    classes = [value for module in modules for value in vars(module).values()]
    named = {
        kind.name: kind
        for kind in classes
        if isinstance(kind, type) and issubclass(kind, Objective) and hasattr(kind, "name")
    }
    return dict(sorted(named.items()))


OBJECTIVES = _found()
"""All objectives, by name."""
