"""What leaving out pays: run times with and without, as ratios taken in one run.

Both sides of a ratio are timed in turns, so that a machine whose mood changes is unfair to
neither; the best of many turns counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from domino_env.core.tables import csv_table, text_table
from domino_env.physics.forces import diagnose
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import simulate, simulate_batch

Task = Callable[[], object]
Progress = Callable[[str], object]


@dataclass(frozen=True)
class Saving:
    """What leaving out one thing saves.

    Attributes
    ----------
    what
        What is left out.
    row
        What is toppled.
    full
        Run time with it [s].
    lean
        Run time without it [s].
    """

    what: str
    row: str
    full: float
    lean: float

    @property
    def ratio(self) -> float:
        """How many times faster it is without."""
        return self.full / self.lean


def in_turns(full: Task, lean: Task, seconds: float = 0.3) -> tuple[float, float]:
    """Best run time of two tasks that take turns for about so long, five turns at least."""
    best = [np.inf, np.inf]
    for task in (full, lean):
        task()  # compiled, and its memory touched
    began, turns = time.perf_counter(), 0
    while turns < 5 or (time.perf_counter() - began < seconds and turns < 2000):
        for k, task in enumerate((full, lean)):
            start = time.perf_counter()
            task()
            best[k] = min(best[k], time.perf_counter() - start)
        turns += 1
    return float(best[0]), float(best[1])


def nearly(layout: Layout) -> Layout:
    """Return the same row, not recognised as uniform: one density off by its last digit."""
    density = layout.density.copy()
    density[-1] = np.nextafter(density[-1], np.inf)
    return Layout(layout.spacing, layout.thickness, layout.height, layout.width, density)


def savings(seconds: float = 0.3, progress: Progress | None = None) -> Iterator[Saving]:
    """Time every omission; `seconds` for each pair."""
    for what, row, full, lean in _pairs():
        if progress is not None:
            progress(f"{what}: {row}")
        yield Saving(what, row, *in_turns(full, lean, seconds))


def _pairs() -> Iterator[tuple[str, str, Task, Task]]:
    rng = np.random.default_rng(2)
    physics = Physics(push=8.0)
    smooth = replace(physics, friction=0.0)
    rows = {
        "100 equal, pitch 16 mm": Layout.uniform(100, pitch=0.016),
        "100 at random gaps of 10-25 mm": Layout(rng.uniform(0.010, 0.025, 99), 0.0075),
        "40 at random gaps of 2-40 mm": Layout(rng.uniform(0.002, 0.040, 39), 0.0075),
    }
    for name, row in rows.items():
        one = partial(simulate, row, rtol=1e-8)
        yield "friction", name, partial(one, physics), partial(one, smooth)
    for count in (100, 1000):
        row = Layout.uniform(count, pitch=0.016)
        one = partial(simulate, physics=physics, rtol=1e-8)
        yield (
            "differences between dominoes",
            f"{count} equal, pitch 16 mm",
            partial(one, nearly(row)),
            partial(one, row),
        )
    for name, row in rows.items():
        tight, loose = (partial(simulate, row, physics, rtol=rtol) for rtol in (1e-12, 1e-4))
        yield "tolerance 1e-4, not 1e-12", name, tight, loose
    for name, row in rows.items():
        yield (
            "contact forces",
            name,
            partial(diagnose, row, physics),
            partial(simulate, row, physics, rtol=1e-8),
        )
    gaps = rng.uniform(0.002, 0.040, (2000, 39))
    thick = np.full(40, 0.0075)
    for friction in (0.25, 0.0):
        batch = partial(simulate_batch, gaps, thick, replace(physics, friction=friction))
        yield (
            "the record of each domino",
            f"2000 rows of 40, μ = {friction:g}",
            partial(batch, record=True),
            partial(batch, record=False),
        )


def as_table(savings: Iterable[Saving]) -> list[str]:
    """Tabulate the savings; returns lines."""
    names = ("left out", "row", "with", "without", "times faster")
    rows, what = [], ""
    for s in savings:
        times = f"{s.full * 1e3:.4f} ms", f"{s.lean * 1e3:.4f} ms", f"{s.ratio:.2f}"
        rows.append((s.what if s.what != what else "", s.row, *times))
        what = s.what
    return text_table(names, rows, right=names[2:])


def as_csv(savings: Iterable[Saving]) -> str:
    """Write the savings as a table in CSV; seconds."""
    rows = ((s.what, s.row, f"{s.full:.4e}", f"{s.lean:.4e}", f"{s.ratio:.3f}") for s in savings)
    return csv_table(("left_out", "row", "with", "without", "ratio"), rows)
