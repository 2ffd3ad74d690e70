"""Compilation by public parts of Numba only: same results, first calls take three times as long."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config

_FOLDER = Path(__file__).parents[1]
STAMP = hashlib.sha256(
    b"\0".join(path.read_bytes() for path in sorted(_FOLDER.rglob("*.py")))
).digest()


def compile_plainly(function: Callable[..., Any], *, kept: bool, **options: Any) -> Any:
    """Compile a function as any user of Numba would.

    Parameters
    ----------
    function
        The Python function.
    kept
        Whether its machine code is cached, in a folder named after the state of all files of the
        package: Numba checks only the file that contains the function.
    **options
        Of `numba.njit`.
    """
    options.pop("forceinline", None)
    njit: Any = numba.njit
    dispatcher = njit(nogil=True, error_model="numpy", **options)(function)
    if kept:
        chosen = config.CACHE_DIR  # type: ignore[attr-defined]
        folder = Path(chosen or _FOLDER / "__pycache__") / f"plain-{STAMP.hex()[:16]}"
        try:
            config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
            dispatcher.enable_caching()
        except (OSError, RuntimeError):  # not writable: compiled in every process
            pass
        finally:
            config.CACHE_DIR = chosen  # type: ignore[attr-defined]
    return dispatcher
