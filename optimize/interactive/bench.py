"""Time of a drag on the server: ``python -m optimize.interactive.bench``."""

from __future__ import annotations

import timeit
from statistics import median

from domino_env.scenes.io.reading import load_scene
from optimize.interactive.design import SPACING, Design
from optimize.interactive.page import Page

DRAGS = 100


def seconds(count: int) -> float:
    """Return the median time [s] from the pointer's position to the page's new contents."""
    page = Page(Design(load_scene("sprint").replace(count=count)), lambda _: None)
    gaps = iter(range(DRAGS))
    return median(
        timeit.repeat(
            lambda: page.drag(SPACING, 5, 0.018 + 1e-4 * next(gaps)), number=1, repeat=DRAGS
        )
    )


if __name__ == "__main__":
    for count in (100, 1000):
        print(f"drag of one of {count} dominoes: {1e3 * seconds(count):.1f} ms (median of {DRAGS})")
