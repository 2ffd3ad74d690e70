"""Search methods, one idea a file, loaded when asked for.

A method is a function `run(budget, rng)`.  It asks `budget` for scores of designs in the unit box
(`scores` of a batch, `score`, `score_and_gradient`) until BudgetSpent ends it, or returns when it
has nothing left to try; in `budget.standing` it may say how far its best is to be trusted.  All its
randomness comes from `rng`; what it has found is the budget's to remember.  One in a module of
one's own is named `package.module:function`.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import TYPE_CHECKING, cast

from optimize.methods.own import checked, load_own, name_of

if TYPE_CHECKING:
    import numpy as np

    from optimize.evaluation.budget import Budget

    Method = Callable[[Budget, np.random.Generator], None]

METHODS = {
    "auto": "structured.race",
    "cma": "stochastic.evolution",
    "l-bfgs": "gradient.quasi_newton",
    "gauss-newton": "gradient.least_squares",
    "assign": "structured.assignment",
    "slsqp": "gradient.quadratic_programs",
    "scp": "gradient.convex_steps",
    "trust-constr": "gradient.trust_regions",
    "cobyqa": "derivative_free.quadratic_models",
    "powell": "derivative_free.directions",
    "nelder-mead": "derivative_free.simplex",
    "differential-evolution": "stochastic.differential_evolution",
    "dual-annealing": "stochastic.annealing",
    "direct": "derivative_free.rectangles",
    "random": "stochastic.random_layouts",
    "uniform": "uniform_pitch",
}
"""Name of each method, and the module here that holds it."""


GROUP = "domino.methods"
"""Entry points of other packages: a method's name, and the function `run(budget, rng)` for it.

The function for a name such as `agent` makes a method of what follows a colon, as in `agent:RUN`.
"""

OF_SOMETHING = ("agent",)  # names that a colon and more belong to

PEERS = {"ngopt": ("stochastic.ngopt", "nevergrad"), "tpe": ("stochastic.parzen", "optuna")}
"""Methods of other projects to compare with: the module here, and what must be installed for it."""


def installed_peers() -> list[str]:
    """List the names of the peers that can run here."""
    return [name for name, (_, needed) in PEERS.items() if find_spec(needed) is not None]


def of_others() -> dict[str, EntryPoint]:
    """List methods that installed packages bring, learned ones among them, by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def load(name: str | Method) -> Method:
    """Import the method of that name, `package.module:function` among them; or take a function.

    Raises
    ------
    ValueError
        Where there is none; it suggests a name.
    ImportError
        Where what it needs is missing; it says what to install.
    """
    if not isinstance(name, str):
        return checked(name, name_of(name))
    word, colon, what = name.partition(":")
    others = {} if name in METHODS else of_others()
    if word in others and bool(colon) == (word in OF_SOMETHING):
        found = others[word].load()
        return cast("Method", found(what) if colon else found)
    if colon and what and word not in (*METHODS, *others):
        return load_own(name)
    if name in PEERS:
        module, needed = PEERS[name]
        if find_spec(needed) is None:
            raise ValueError(f"method '{name}' needs {needed}: pip install {needed}")
    elif name in METHODS:
        module = METHODS[name]
    else:
        known = [*METHODS, *installed_peers()]
        known += [other + ":RUN" * (other in OF_SOMETHING) for other in others]
        known += ["package.module:function"]
        near = difflib.get_close_matches(name.lower().replace("_", "-"), known, n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise ValueError(f"there is no method '{name}': {hint}choose {', '.join(known)}")
    method: Method = import_module(f"optimize.methods.{module}").run
    return method
