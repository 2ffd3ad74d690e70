"""Print the median time of a drag on the server of the studio: python docs/studio_drag.py."""

from __future__ import annotations

import timeit
from statistics import median

import numpy as np

from domino_env.scenes.io.reading import load_scene
from optimize.interactive.draft import Draft
from optimize.interactive.page import Page

DRAGS = 100  # positions of the pointer that are timed


def measure_drag(count: int) -> float:
    """Return the median time [s] from a position of the pointer to the new contents of the page.

    Parameters
    ----------
    count
        Number of dominoes.
    """
    page = Page(Draft.uniform(load_scene("sprint").replace(count=count)), lambda _: None)
    shifts = iter(1e-4 * np.arange(DRAGS))  # [m] of domino 5, within the bounds
    times = timeit.repeat(
        lambda: page.preview(Draft.with_shift, 5, next(shifts)), number=1, repeat=DRAGS
    )
    page.close()
    return median(times)


if __name__ == "__main__":
    for count in (100, 1000):
        time = 1e3 * measure_drag(count)
        print(f"drag of one of {count} dominoes: {time:.1f} ms (median of {DRAGS})")
