"""Methods of one's own: a function `run(budget, rng)`, or its name as `package.module:function`."""

from __future__ import annotations

import difflib
import inspect
import sys
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from optimize.methods import Method


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
