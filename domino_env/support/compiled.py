"""Functions compiled by plain Numba, for those who share no code with the kernels."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numba


def compiled(function: Any) -> Any:
    """Compile a function, and cache it where a folder can be written."""
    dispatcher = numba.njit(nogil=True, error_model="numpy")(function)
    with suppress(RuntimeError):
        dispatcher.enable_caching()
    return dispatcher
