"""Registry of drawings: a result is drawn without an import of what draws it.

A package registers its drawing functions in its `__init__`, under "kind" for a Matplotlib figure
and "kind.html" for what a notebook shows. They are imported at the first call.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_HOMES: dict[str, str] = {}


def register(homes: Mapping[str, str]) -> None:
    """Add drawings: kind of result → "module:function" that draws one."""
    _HOMES.update(homes)


def draw(kind: str, *arguments: Any) -> Any:
    """Return what the function registered for this kind draws."""
    import pkgutil

    return pkgutil.resolve_name(_HOMES[kind])(*arguments)
