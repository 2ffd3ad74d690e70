"""Functions compiled by plain Numba, for those who share no code with the kernels."""

from __future__ import annotations

from functools import partial
from typing import Any

import numba


def compiled(function: Any) -> Any:
    """Compile a function, and cache it where a folder can be written."""
    compile_with = partial(numba.njit, nogil=True, error_model="numpy")
    try:
        return compile_with(cache=True)(function)
    except RuntimeError:  # no folder for a cache
        return compile_with()(function)
