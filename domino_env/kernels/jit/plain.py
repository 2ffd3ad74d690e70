"""Compilation by public parts of Numba only: same results, first calls take three times as long."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config

try:
    from domino_env.kernels.jit.storage import Cache
except Exception:  # whatever a changed Numba raises
    from numba.core.caching import FunctionCache as Cache  # type: ignore[assignment]

_FOLDER = Path(__file__).parents[1]
_SOURCES = sorted(_FOLDER.rglob("*.py"))
STAMP = hashlib.sha256(b"\0".join(path.read_bytes() for path in _SOURCES)).digest()


def cache_folder() -> Path:
    """Return the folder of compiled code: NUMBA_CACHE_DIR, or one beside the kernels."""
    return Path(config.CACHE_DIR or _FOLDER / "__pycache__")  # type: ignore[attr-defined]


def compile_plainly(function: Callable[..., Any], *, cache: bool, **options: Any) -> Any:
    """Compile a function by `numba.njit`.

    Parameters
    ----------
    function
        The Python function.
    cache
        True to cache its machine code in a folder whose name has the digest of all files of the
        folder `kernels`, as Numba checks only the file that contains the function.
    **options
        Options of `numba.njit`; `forceinline` is ignored.

    Returns
    -------
    numba.core.dispatcher.Dispatcher
        The compiled function.
    """
    options.pop("forceinline", None)
    njit: Any = numba.njit
    dispatcher = njit(nogil=True, error_model="numpy", **options)(function)
    if cache:
        cache_dir = config.CACHE_DIR  # type: ignore[attr-defined]
        folder = cache_folder() / f"plain-{STAMP.hex()[:16]}"
        try:
            config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
            dispatcher._cache = Cache(dispatcher.py_func)
        except (OSError, RuntimeError):  # the folder cannot be written: every process compiles
            pass
        except Exception:  # whatever a changed Numba raises
            dispatcher.enable_caching()
        finally:
            config.CACHE_DIR = cache_dir  # type: ignore[attr-defined]
    return dispatcher
