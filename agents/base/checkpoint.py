"""Checkpoints: read without running code, and refused where they do not fit what is trained."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from domino_env.core.files import write_bytes
from domino_env.core.reading import naming

# what torch and stable-baselines3 raise for a state that is not theirs
_UNFIT = (KeyError, TypeError, RuntimeError, AttributeError, IndexError, OverflowError)


def write_checkpoint(path: Path, state: dict[str, Any]) -> None:
    """Write plain numbers and tensors."""
    write_bytes(path, lambda file: torch.save(state, file))


@contextmanager
def read_checkpoint(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the state in a checkpoint: plain numbers and tensors.

    Raises
    ------
    ValueError
        Where it is damaged or no checkpoint, or what is done with it inside fails: it is another
        learner's.
    """
    with naming(path):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                state = torch.load(path, weights_only=True, map_location="cpu")
        except Exception as error:  # the unpickler raises whatever the bytes lead it to
            raise ValueError(f"not a checkpoint, or damaged: {error}") from None
        try:
            yield state
        except _UNFIT as error:
            raise ValueError(f"it does not fit this learner: {error!r}") from None


def require_finite(network: torch.nn.Module) -> None:
    """Raise ValueError for weights that are no numbers."""
    for name, values in network.state_dict().items():
        if not torch.isfinite(values).all():
            raise ValueError(f"{name} holds what is no finite number")
