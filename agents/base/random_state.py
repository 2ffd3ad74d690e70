"""Streams: the learners draw from global random streams; here these are put back."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch


@contextmanager
def streams_put_back() -> Iterator[None]:
    """Draw within as you like: the global streams go on afterwards as if nothing had been drawn."""
    plain = random.getstate()
    numpy = np.random.get_state()  # noqa: NPY002
    deep, threads = torch.get_rng_state(), torch.get_num_threads()
    try:
        yield
    finally:
        random.setstate(plain)
        np.random.set_state(numpy)  # noqa: NPY002
        torch.set_rng_state(deep)
        torch.set_num_threads(threads)
