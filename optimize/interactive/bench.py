"""Time of a drag on the server: ``python -m optimize.interactive.bench``."""

from __future__ import annotations

import time

import numpy as np

from domino_env.scenes.io.reading import load_scene
from optimize.interactive.design import SPACING, Design
from optimize.interactive.page import Page

DRAGS = 100
COUNTS = (100, 1000)


def main() -> None:
    """Print the median time of a drag, from the pointer's position to the page's new contents."""
    for count in COUNTS:
        scene = load_scene("sprint").replace(count=count)
        page = Page(Design(scene), lambda _: None)
        seconds = np.empty(DRAGS)
        for k in range(DRAGS):
            began = time.perf_counter()
            page.drag(SPACING, 5, 0.018 + 1e-4 * k)
            seconds[k] = time.perf_counter() - began
        milliseconds = 1e3 * np.median(seconds)
        print(f"drag of one of {count} dominoes: {milliseconds:.1f} ms (median of {DRAGS})")


if __name__ == "__main__":
    main()
