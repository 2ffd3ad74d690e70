"""The global random state: learners draw from it, and here it is put back."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch


@contextmanager
def random_state_restored() -> Iterator[None]:
    """Draw within as you like: afterwards the global state is as if nothing had been drawn."""
    python, legacy = random.getstate(), np.random.get_state()  # noqa: NPY002
    generator, threads = torch.get_rng_state(), torch.get_num_threads()
    try:
        yield
    finally:
        random.setstate(python)
        np.random.set_state(legacy)  # noqa: NPY002
        torch.set_rng_state(generator)
        torch.set_num_threads(threads)
