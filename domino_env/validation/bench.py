"""`make bench`: how long a wave takes, with its error beside it, warmed up, on one core.

Each figure is the median of many runs; the error is that of the arrival times against the tightest
run.  Figures are comparable within one table only: machines, and their moods, differ.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import TIGHTEST, Wave, simulate, simulate_batch
from domino_env.validation.first_calls import first_calls

RUNS = 60


def median_time(task: Callable[[], object], runs: int = RUNS) -> float:
    """Median seconds of a task that has been run once before."""
    task()
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        task()
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def _usual_rows() -> dict[str, Layout]:
    """Rows of the tables of single waves and of gradients, by name."""
    rng = np.random.default_rng(2)
    return {
        "100 uniform, pitch 16 mm": Layout.uniform(100, pitch=0.016),
        "100 random, gaps 10-25 mm": Layout(rng.uniform(0.010, 0.025, 99), 0.0075),
        "40 random, gaps 2-40 mm": Layout(rng.uniform(0.002, 0.040, 39), 0.0075),
    }


def single_waves() -> list[str]:
    """Tabulate times and errors of single rows at several tolerances."""
    lines = ["row                        friction   rtol      time [ms]   error     estimate"]
    for name, layout in _usual_rows().items():
        for friction in (0.25, 0.0):
            physics = Physics(friction, 9.81, 8.0)
            exact = simulate(layout, physics, rtol=TIGHTEST).arrival_times[1:]
            for rtol in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
                wave = simulate(layout, physics, rtol=rtol)
                error = np.max(np.abs(wave.arrival_times[1:] / exact - 1.0))
                seconds = median_time(partial(simulate, layout, physics, rtol=rtol))
                lines.append(
                    f"{name:26} {friction:8.2f}   {rtol:.0e}   {seconds * 1e3:9.4f}   "
                    f"{error:.1e}   {wave.error_estimate:.1e}"
                )
    return lines


def long_rows() -> list[str]:
    """Tabulate cost against length: it is linear."""
    rng = np.random.default_rng(3)
    lines = ["length     uniform [s]   random [s]"]
    for count in (1_000, 10_000, 100_000):
        uniform = Layout.uniform(count, pitch=0.016)
        random = Layout(rng.uniform(0.010, 0.025, count - 1), 0.0075)
        times = [median_time(partial(simulate, row, Physics()), 3) for row in (uniform, random)]
        lines.append(f"{count:7d}   {times[0]:10.4f}   {times[1]:10.4f}")
    return lines


def batches() -> list[str]:
    """Tabulate layouts a second in batches, over all cores."""
    rng = np.random.default_rng(4)
    spacing = rng.uniform(0.002, 0.040, (4000, 39))
    thickness = np.full(40, 0.0075)
    lines = ["batch of 4000 rows of 40, gaps 2-40 mm, speed only"]
    for rtol in (1e-4, 1e-6, 1e-8):

        def task(rtol: float = rtol) -> object:
            return simulate_batch(spacing, thickness, Physics(), rtol=rtol, record=False)

        lines.append(
            f"rtol {rtol:.0e}: {len(spacing) / median_time(task, 7):9.0f} layouts a second"
        )
    return lines


def gradients() -> list[str]:
    """Tabulate what a gradient of the total time costs, in plain runs of the same row."""
    lines = ["row                        friction   rtol      wave [ms]   with gradient   ratio"]
    for name, layout in _usual_rows().items():
        for friction in (0.25, 0.0):
            physics = Physics(friction, 9.81, 8.0)
            for rtol in (1e-6, 1e-8, 1e-12):
                plain = partial(simulate, layout, physics, rtol=rtol)

                def both(plain: Callable[..., Wave] = plain) -> object:
                    return plain(gradient=True).gradient()

                alone, all_of_it = median_time(plain), median_time(both)
                lines.append(
                    f"{name:26} {friction:8.2f}   {rtol:.0e}   {alone * 1e3:9.4f}   "
                    f"{all_of_it * 1e3:13.4f}   {all_of_it / alone:5.2f}"
                )
    return lines


def environments() -> list[str]:
    """Tabulate steps of the environments, beside CartPole's."""
    from domino_env.envs.bench import environment_steps

    return environment_steps()


def main() -> None:
    """Print every table."""
    for table in (single_waves, gradients, long_rows, batches, environments, first_calls):
        print("\n".join(table()), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
