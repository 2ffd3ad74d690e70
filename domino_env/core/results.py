"""Results: their drawings, their `repr`, and the versions of the packages that made them.

Modules of results do not import the modules that draw results. The `__init__` of a package
registers functions that return a Matplotlib figure, and the first call imports them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from importlib import resources
from typing import Any

_DRAWINGS: dict[str, str] = {}  # kind of result → "module:function"
MAX_ITEMS = 4  # of a tuple that a repr shows in full


def register(functions: Mapping[str, str]) -> None:
    """Register drawing functions: kind of result → "module:function"."""
    _DRAWINGS.update(functions)


def draw(kind: str, *arguments: Any) -> Any:
    """Return the figure that the registered function of this kind of result draws."""
    import pkgutil

    return pkgutil.resolve_name(_DRAWINGS[kind])(*arguments)


def dataclass_repr(value: Any) -> str:
    """Return the repr of a dataclass, with the shapes of arrays and the lengths of long tuples."""
    parts = [f"{f.name}={_short_repr(getattr(value, f.name))}" for f in fields(value) if f.repr]
    return f"{type(value).__name__}({', '.join(parts)})"


def _short_repr(value: Any) -> str:
    if getattr(value, "ndim", 0):  # an array
        return f"<array {'×'.join(map(str, value.shape))}>"
    if isinstance(value, tuple) and not hasattr(value, "_fields"):
        if len(value) > MAX_ITEMS:
            return f"<{len(value)} items>"
        return f"({', '.join(map(_short_repr, value))})"
    return repr(value)


def document(value: Any, names: str) -> dict[str, Any]:
    """Return the named fields of a result as values of JSON.

    Parameters
    ----------
    value
        A result.
    names
        Fields and properties, separated by spaces.

    Returns
    -------
    dict
        Arrays as lists, enumerations by name, null for numbers that are not finite.
    """
    return {name: as_json(getattr(value, name)) for name in names.split()}


def as_json(value: Any) -> Any:
    """Convert a value and its items to types of JSON, in the way that `document` does."""
    if isinstance(value, Enum):
        return value.name
    if hasattr(value, "tolist"):  # an array or a number of NumPy
        value = value.tolist()
    if isinstance(value, dict):
        return {key: as_json(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def revision() -> str:
    """Return the revision of the environments: a digest of scenes, waves and rewards.

    Two versions of the code with the same behaviour have the same revision.
    `docs/shipped_scenes.py` computes and writes it.
    """
    return resources.files("domino_env.core").joinpath("revision.txt").read_text("ascii").strip()


def versions(*others: str) -> dict[str, str]:
    """Return the revision, and the versions of Python and of packages that results depend on.

    Parameters
    ----------
    *others
        Names of further packages; those that are not installed are left out.
    """
    import platform
    from contextlib import suppress
    from importlib.metadata import PackageNotFoundError, version

    installed = {"revision": revision(), "python": platform.python_version()}
    for name in ("domino-chains", "numpy", "scipy", "numba", "cma", *others):
        with suppress(PackageNotFoundError):
            installed[name] = version(name)
    return installed
