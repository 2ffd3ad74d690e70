"""Objectives of scenes, one class each.

`OBJECTIVES` is filled from all modules of this folder, so a new objective needs only a new file.
"""

from importlib import import_module
from pkgutil import iter_modules

from domino_env.scenes.objectives.base import Objective, ScoreGradient, Scores

__all__ = ["OBJECTIVES", "Objective", "ScoreGradient", "Scores"]


def _find_objectives() -> dict[str, type[Objective]]:
    """Return all subclasses of `Objective` in this folder that have a name, by their names."""
    modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
    classes = [value for module in modules for value in vars(module).values()]
    by_name = {
        kind.name: kind
        for kind in classes
        if isinstance(kind, type) and issubclass(kind, Objective) and hasattr(kind, "name")
    }
    return dict(sorted(by_name.items()))


OBJECTIVES = _find_objectives()
"""Classes of all objectives, by name."""
