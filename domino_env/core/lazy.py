"""The face of a package: public names that load when they are first used."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_names(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Make the `__getattr__` and `__dir__` of a package from where its names live.

        __getattr__, __dir__ = lazy_names(__name__, {"Layout": "chain.layout"})

    Parameters
    ----------
    package
        Its name.
    homes
        The module that holds each public name, below the package.

    Returns
    -------
    tuple
        Both functions. A name that has been loaded is an attribute from then on.
    """

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        value = getattr(import_module(f"{package}.{homes[name]}"), name)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *homes})

    return load, names
