"""Registry of search methods: their names, and the functions that they name.

A method is a function `run(evaluator, rng)`. It calls `evaluator.evaluate` with design vectors in
the unit box until BudgetSpent ends it, or returns when it is done. It may describe the reliability
of its best layout in `evaluator.status`. All its randomness comes from `rng`, and the evaluator
keeps the best layouts. A method in your own module is named `package.module:function`.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from pkgutil import resolve_name
from typing import cast

import numpy as np

from domino_env.core.checks import require_choice, require_extra, require_type
from optimize.evaluator import Evaluator

Method = Callable[[Evaluator, np.random.Generator], None]

METHODS = {
    "auto": "search.race:run",
    "cma": "search.cma_es:run",
    "l-bfgs": "scipy_methods:l_bfgs",
    "gauss-newton": "gradient.least_squares:run",
    "assign": "search.assignment:run",
    "slsqp": "scipy_methods:slsqp",
    "scp": "gradient.convex_steps:run",
    "trust-constr": "scipy_methods:trust_constr",
    "cobyqa": "scipy_methods:cobyqa",
    "powell": "scipy_methods:powell",
    "nelder-mead": "scipy_methods:nelder_mead",
    "differential-evolution": "scipy_methods:differential_evolution",
    "dual-annealing": "scipy_methods:dual_annealing",
    "direct": "scipy_methods:direct",
    "random": "baselines:random",
    "uniform": "baselines:uniform",
}
"""Module and function of each search method, by its name; modules are those of this folder."""

THIRD_PARTY = {"ngopt": ("baselines:ngopt", "nevergrad"), "tpe": ("baselines:tpe", "optuna")}
"""Third-party methods for comparison: module and function, and the package they need."""

GROUP = "domino.methods"
"""Group of entry points by which other packages add families of methods, such as `agent:RUN`.

The function of a name returns the method for the text after the colon.
"""


def installed_third_party() -> list[str]:
    """Return the names of the third-party methods that are installed."""
    return [name for name, (_, package) in THIRD_PARTY.items() if find_spec(package) is not None]


def installed_families() -> dict[str, EntryPoint]:
    """Return the entry points of families of methods of installed packages, by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def load(name: str | Method) -> Method:
    """Import a method.

    Parameters
    ----------
    name
        A key of `METHODS` or `THIRD_PARTY`, "family:text" with a family of another package,
        "package.module:function", or the function itself.

    Returns
    -------
    callable
        The method, called as `run(evaluator, rng)`.

    Raises
    ------
    ValueError
        If the name is unknown (the message has the nearest known one), if the function cannot be
        imported, or if it cannot be called as `run(evaluator, rng)`.
    TypeError
        If the method is neither a name nor a function.
    ImportError
        If a package is missing; the message has the extra that contains it.
    """
    if not isinstance(name, str):
        return _check_signature(name, method_name(name))
    prefix, colon, text = name.partition(":")
    families = {} if name in METHODS else installed_families()
    if text:  # a method of another package may make environments
        from domino_env.envs import register

        register()
    if colon and prefix in families:
        return cast("Method", families[prefix].load()(text))
    if text and prefix not in METHODS:
        return _check_signature(import_function(name), name)
    names = [f"{family}:RUN" for family in families]
    require_choice("method", name, [*METHODS, *THIRD_PARTY, *names, "package.module:function"])
    function, package = (METHODS[name], None) if name in METHODS else THIRD_PARTY[name]
    if package is not None:
        require_extra(f"method '{name}'", "peers", package)
    return cast("Method", resolve_name(f"optimize.methods.{function}"))


def method_name(method: str | Method) -> str:
    """Return the name of a method that is given by name or as the function itself.

    Raises
    ------
    TypeError
        If the method is neither a name nor a function.
    """
    require_type("method", method, str | Callable, "a name, or a function run(evaluator, rng)")
    if isinstance(method, str):
        return method
    function = method if hasattr(method, "__qualname__") else type(method)
    return f"{function.__module__}:{function.__qualname__}"


def import_function(name: str) -> object:
    """Import a function by `package.module:function`, also from the working folder.

    Raises
    ------
    ValueError
        If it cannot be imported.
    """
    folder = str(Path.cwd())
    if folder not in sys.path:  # spawned processes get this list
        sys.path.append(folder)
    try:
        return resolve_name(name)
    except (AttributeError, ImportError, SyntaxError, ValueError) as error:
        raise ValueError(
            f"method '{name}' cannot be imported from {folder} or where Python finds packages: "
            f"{error}; name a function at the top of a module as package.module:function"
        ) from error


def _check_signature(method: object, name: str) -> Method:
    """Return a method; raise a ValueError if it cannot be called as one."""
    try:
        with suppress(ValueError):  # a compiled function has no signature
            inspect.signature(cast("Method", method)).bind(None, None)
    except TypeError:
        raise ValueError(f"method '{name}': give a function run(evaluator, rng)") from None
    return cast("Method", method)
