"""Results: their drawings, their line in a session, the versions that made them.

A result is drawn without an import of what draws it: a package registers its drawing functions in
its `__init__`, under "kind" for a Matplotlib figure and "kind.html" for what a notebook shows. They
are imported at the first call.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from typing import Any

_HOMES: dict[str, str] = {}
MOST_ITEMS = 4  # of a tuple that is written out


def register(homes: Mapping[str, str]) -> None:
    """Add drawings: kind of result → "module:function" that draws one."""
    _HOMES.update(homes)


def draw(kind: str, *arguments: Any) -> Any:
    """Return what the function registered for this kind draws."""
    import pkgutil

    return pkgutil.resolve_name(_HOMES[kind])(*arguments)


def brief(value: Any) -> str:
    """Write a dataclass in a line: of arrays their shapes, of long tuples their lengths.

    To be its `__repr__`, as in ``__repr__ = brief``.
    """
    parts = [f"{f.name}={_short(getattr(value, f.name))}" for f in fields(value) if f.repr]
    return f"{type(value).__name__}({', '.join(parts)})"


def _short(value: Any) -> str:
    if getattr(value, "ndim", 0):  # an array
        return f"<array {'×'.join(map(str, value.shape))}>"
    if isinstance(value, tuple) and not hasattr(value, "_fields"):
        few = len(value) <= MOST_ITEMS
        return f"({', '.join(map(_short, value))})" if few else f"<{len(value)} items>"
    return repr(value)


def document(value: Any, names: str) -> dict[str, Any]:
    """Return the named fields of a result as JSON has them.

    Parameters
    ----------
    value
        A result.
    names
        Fields and properties, with spaces between.

    Returns
    -------
    dict
        Arrays as lists, enumerations by name, null for numbers that are not finite.
    """
    return {name: as_json(getattr(value, name)) for name in names.split()}


def as_json(value: Any) -> Any:
    """Return a value as JSON has it, what it holds too; see `document`."""
    if isinstance(value, Enum):
        return value.name
    if hasattr(value, "tolist"):  # of NumPy
        value = value.tolist()
    if isinstance(value, dict):
        return {key: as_json(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def versions() -> dict[str, str]:
    """Versions of everything that the bits of a result may depend on, by name."""
    import platform
    from contextlib import suppress
    from importlib.metadata import PackageNotFoundError, version

    found = {"python": platform.python_version()}
    for name in ("domino-chains", "numpy", "scipy", "numba", "cma"):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found
