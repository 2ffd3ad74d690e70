"""What training needs beyond the rest of the project."""

from __future__ import annotations

from importlib.util import find_spec

REQUIRED = ("torch", "stable_baselines3", "sb3_contrib")


def require_learning(*more: str) -> None:
    """Raise ImportError that says how to install it, where a package for learning is missing."""
    missing = [name for name in (*REQUIRED, *more) if find_spec(name) is None]
    if missing:
        raise ImportError(
            f'learning needs {", ".join(missing)}: pip install "domino-chains[rl]" '
            "(in this folder: pip install -c constraints.txt -e .[rl])"
        )
