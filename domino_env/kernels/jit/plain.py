"""Compilation by Numba's public means only: the same results, first calls three times as long."""

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
        Whether its machine code is cached, in a folder that is named after the state of all files
        of the package: Numba looks at the one file that the function stands in.
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
        except (OSError, RuntimeError):  # the folder cannot be written: it is compiled every time
            pass
        finally:
            config.CACHE_DIR = chosen  # type: ignore[attr-defined]
    return dispatcher
