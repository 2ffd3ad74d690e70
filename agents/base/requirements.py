"""What learning needs beyond the rest of the project."""

from __future__ import annotations

from importlib.util import find_spec

NEEDED = ("torch", "stable_baselines3", "sb3_contrib")


def require_extra(*more: str) -> None:
    """Raise ImportError that says how to install it, where the extra is missing."""
    missing = [name for name in (*NEEDED, *more) if find_spec(name) is None]
    if missing:
        raise ImportError(
            f'learning needs {", ".join(missing)}: pip install "domino-chains[rl]" '
            "(in this folder: pip install -c constraints.txt -e .[rl])"
        )
