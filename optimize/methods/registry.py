"""Search methods, one idea a file, loaded when asked for.

A method is a function `run(budget, rng)`.  It asks `budget` for scores of designs in the unit box
(`scores` of a batch, `score`, `score_and_gradient`) until BudgetSpent ends it, or returns when it
has nothing left to try; in `budget.standing` it may say how far its best is to be trusted.  All its
randomness comes from `rng`; what it has found is the budget's to remember.  One in a module of
one's own is named `package.module:function`.
"""

from __future__ import annotations

import difflib
import inspect
import sys
from collections.abc import Callable
from functools import reduce
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    import numpy as np

    from optimize.evaluator import Budget

    Method = Callable[[Budget, np.random.Generator], None]

METHODS = {
    "auto": "search.race",
    "cma": "search.cma_es",
    "l-bfgs": "gradient.quasi_newton",
    "gauss-newton": "gradient.least_squares",
    "assign": "search.assignment",
    "slsqp": "gradient.quadratic_programs",
    "scp": "gradient.convex_steps",
    "trust-constr": "gradient.trust_regions",
    "cobyqa": "search.quadratic_models",
    "powell": "search.directions",
    "nelder-mead": "search.simplex",
    "differential-evolution": "search.differential_evolution",
    "dual-annealing": "search.annealing",
    "direct": "search.rectangles",
    "random": "search.random_layouts",
    "uniform": "search.uniform_pitch",
}
"""Name of each method, and the module here that holds it."""


GROUP = "domino.methods"
"""Entry points of other packages: a method's name, and the function `run(budget, rng)` for it.

The function for a name such as `agent` makes a method of what follows a colon, as in `agent:RUN`.
"""

OF_SOMETHING = ("agent",)  # names that a colon and more belong to

PEERS = {"ngopt": ("search.ngopt", "nevergrad"), "tpe": ("search.parzen", "optuna")}
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


def load_own(name: str) -> Method:
    """Import the function that `package.module:function` names.

    Modules are looked for where Python finds packages, and in the working folder.

    Raises
    ------
    ValueError
        Where it cannot be imported, or cannot be called as `run(budget, rng)`.
    """
    home, _, inside = name.partition(":")
    here = str(Path.cwd())
    if here not in sys.path:  # spawned processes get this list
        sys.path.append(here)
    try:
        module = import_module(home)
    except ModuleNotFoundError as error:
        if not f"{home}.".startswith(f"{error.name}."):
            raise ValueError(f"method '{name}': {home} cannot be imported: {error}") from error
        raise ValueError(
            f"method '{name}': there is no module '{error.name}' in {here} or where Python finds "
            "packages; a method of your own is named package.module:function"
        ) from None
    except Exception as error:  # whatever a stranger's module does
        said = f"{type(error).__name__}: {error}"
        raise ValueError(f"method '{name}': {home} cannot be imported: {said}") from error
    try:
        found = reduce(getattr, inside.split("."), cast("object", module))
    except AttributeError:
        near = difflib.get_close_matches(inside, vars(module), n=1)
        hint = f"; did you mean '{home}:{near[0]}'?" if near else ""
        where = getattr(module, "__file__", None) or home
        raise ValueError(f"method '{name}': {where} holds no '{inside}'{hint}") from None
    return checked(found, name)


def checked(method: object, name: str) -> Method:
    """Give what can be called as a method.

    Raises
    ------
    ValueError
        Where it cannot.
    """
    try:
        inspect.signature(cast("Method", method)).bind(None, None)
    except TypeError:
        raise ValueError(f"method '{name}': it is not called as run(budget, rng)") from None
    except ValueError:  # compiled, without a signature
        pass
    return cast("Method", method)


def name_of(method: str | Method) -> str:
    """Give the name of a method that is given by name or as the function itself."""
    if isinstance(method, str):
        return method
    told = method if hasattr(method, "__qualname__") else type(method)
    return f"{told.__module__}:{told.__qualname__}"


def importable_name(method: str | Method) -> str:
    """Give the name by which other processes import a method.

    Raises
    ------
    ValueError
        For a function that its own name does not lead to: a lambda, one inside another.
    """
    name = name_of(method)
    if not isinstance(method, str):
        try:
            same = load_own(name) is method
        except ValueError:
            same = False
        if not same:
            raise ValueError(
                f"method '{name}' cannot be imported by that name, and so by no other process: "
                "define it at the top of a module"
            )
    return name
