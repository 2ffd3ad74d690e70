"""What a result was made with."""

from __future__ import annotations

import platform
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version


def versions() -> dict[str, str]:
    """Versions of everything that the bits of a result may depend on, by name."""
    found = {"python": platform.python_version()}
    for name in ("domino-chains", "numpy", "scipy", "numba", "cma"):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found
