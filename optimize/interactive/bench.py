"""Time of a drag on the server: ``python -m optimize.interactive.bench``."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np

from domino_env.scenes.scene import Scene
from optimize.interactive.design import SPACING, Design
from optimize.interactive.page import Page

DRAGS = 100
COUNTS = (100, 1000)


def main() -> None:
    """Print the median time of a drag, from the pointer's position to the page's new contents."""
    for count in COUNTS:
        scene = Scene(count=count, spacing=(0.002, 0.040), thickness=(0.0075, 0.0075))
        page = Page(Design(scene), lambda run: run())
        begin, go, end = page.handlers(SPACING)
        begin(SimpleNamespace(x=0.3, y=18.0))
        seconds = np.empty(DRAGS)
        for k in range(DRAGS):
            began = time.perf_counter()
            go(SimpleNamespace(x=0.3, y=18.0 + 0.1 * k))
            seconds[k] = time.perf_counter() - began
        end(None)
        milliseconds = 1e3 * np.median(seconds)
        print(f"drag of one of {count} dominoes: {milliseconds:.1f} ms (median of {DRAGS})")


if __name__ == "__main__":
    main()
