"""Search methods, one idea a file, loaded when asked for.

A method is a function `run(budget, rng)`.  It asks `budget` for scores of designs in the unit box
(`scores` of a batch, `score`, `score_and_gradient`) until BudgetSpent ends it, or returns when it
has nothing left to try.  All its randomness comes from `rng`; what it has found is the budget's to
remember.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from optimize.budget import Budget

    Method = Callable[[Budget, np.random.Generator], None]

METHODS = {
    "auto": "structured",
    "cma": "evolution",
    "l-bfgs": "quasi_newton",
    "gauss-newton": "least_squares",
    "assign": "assignment",
    "slsqp": "quadratic_programs",
    "scp": "convex_steps",
    "trust-constr": "trust_regions",
    "cobyqa": "quadratic_models",
    "powell": "directions",
    "nelder-mead": "simplex",
    "differential-evolution": "differential_evolution",
    "dual-annealing": "annealing",
    "direct": "rectangles",
    "random": "random_layouts",
    "uniform": "uniform_pitch",
}
"""Name of each method, and the module here that holds it."""


PEERS = {"ngopt": ("ngopt", "nevergrad"), "tpe": ("parzen", "optuna")}
"""Methods of other projects to compare with: the module here, and what must be installed for it."""


def installed_peers() -> list[str]:
    """Names of the peers that can run here."""
    return [name for name, (_, needed) in PEERS.items() if find_spec(needed) is not None]


def load(name: str) -> Method:
    """The method of that name.  ValueError with a suggestion where there is none."""
    if name in PEERS:
        module, needed = PEERS[name]
        if find_spec(needed) is None:
            raise ValueError(f"method '{name}' needs {needed}: pip install {needed}")
    elif name in METHODS:
        module = METHODS[name]
    else:
        known = [*METHODS, *installed_peers()]
        near = difflib.get_close_matches(name.lower().replace("_", "-"), known, n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise ValueError(f"there is no method '{name}': {hint}choose {', '.join(known)}")
    method: Method = import_module(f"optimize.methods.{module}").run
    return method
