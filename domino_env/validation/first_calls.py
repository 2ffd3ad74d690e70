"""How long the first call of each kind takes where nothing has been compiled yet.

Every user, container and worker waits for it once.  Each column is a process of its own: with an
empty cache, and again with the cache that the first one left.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np


def first_calls() -> list[str]:
    """Tabulate seconds of processor time of first calls, compiling and loading.

    Returns
    -------
    list of str
        One line a kind, in the order in which they are called, and their sum.
    """
    with tempfile.TemporaryDirectory() as folder:
        compiling, loading = _seconds(folder), _seconds(folder)
    lines = ["first call            compiling [s]   loading [s]"]
    for kind in compiling:
        lines.append(f"{kind:22}{compiling[kind]:13.2f}{loading[kind]:14.2f}")
    together = [sum(seconds.values()) for seconds in (compiling, loading)]
    return [*lines, f"{'all together':22}{together[0]:13.2f}{together[1]:14.2f}"]


def _seconds(cache: str) -> dict[str, float]:
    """What each kind takes in a new process with that cache."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    done = subprocess.run(
        [sys.executable, "-m", "domino_env.validation.first_calls"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    seconds: dict[str, float] = json.loads(done.stdout)
    return seconds


def _kinds() -> dict[str, Callable[[], object]]:
    import domino_env as de

    rng = np.random.default_rng(0)
    spacing, physics = rng.uniform(0.01, 0.03, (4, 39)), de.Physics()
    random, uniform = de.Layout(spacing[0], 0.0075), de.Layout.uniform(40, pitch=0.02)

    def step() -> object:
        env = de.DominoChain("sprint")
        env.reset(seed=0)
        return env.step(env.action_space.sample())

    return {
        "random row": lambda: de.simulate(random, physics),
        "uniform row": lambda: de.simulate(uniform, physics),
        "batch": lambda: de.simulate_batch(spacing, 0.0075, physics),
        "gradient": lambda: de.simulate(random, physics, gradient=True).gradient(),
        "batch with gradient": lambda: de.simulate_batch(spacing, 0.0075, physics, gradient=True),
        "environment's step": step,
        "diagnosis": lambda: de.diagnose(random, physics),
        "smallest push": lambda: de.smallest_push(random, physics),
        "steady wave": lambda: de.steady_wave(0.02, 0.0075),
    }


def main() -> None:
    """Print seconds of processor time of each first call in this process, as JSON."""
    seconds = {}
    for kind, call in _kinds().items():
        began = time.process_time()
        call()
        seconds[kind] = time.process_time() - began
    print(json.dumps(seconds))


if __name__ == "__main__":
    main()
