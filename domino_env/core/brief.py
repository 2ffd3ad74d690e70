"""Results in a line, for those who look at them in a session."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

MOST_ITEMS = 4  # of a tuple that is written out


def brief(value: Any) -> str:
    """Write a dataclass in a line: of arrays their shapes, of long tuples their lengths.

    To be its `__repr__`, as in ``__repr__ = brief``.
    """
    parts = [f"{f.name}={_short(getattr(value, f.name))}" for f in fields(value) if f.repr]
    return f"{type(value).__name__}({', '.join(parts)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"<array {'×'.join(map(str, value.shape))}>"
    if isinstance(value, tuple) and not hasattr(value, "_fields"):
        few = len(value) <= MOST_ITEMS
        return f"({', '.join(map(_short, value))})" if few else f"<{len(value)} items>"
    return repr(value)
