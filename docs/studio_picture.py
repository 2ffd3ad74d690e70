"""Write studio.gif, a drag, a search and a race on the page: python docs/studio_picture.py.

It needs the group dev, Chromium and its driver.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image

from optimize import studio

HERE = Path(__file__).parent
SIZE = 1100, 690
WIDTH = 830  # [px] of the picture
HOLD = 10  # frames for which a state is shown
RACE = 17.0  # [s] of a race, ten times slower than real time
FRAME = 120  # [ms]


def main() -> None:
    """Open the page, drag a domino, search, push the row, and write the picture."""
    sys.path[:0] = [str(HERE.parent), str(HERE.parent / "tests" / "optimize" / "studio")]
    from test_page import Tab

    from benchmarks.page import open_chromium

    window = open_chromium()
    size = {"width": SIZE[0], "height": SIZE[1], "deviceScaleFactor": 1, "mobile": False}
    window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    frames: list[Image.Image] = []

    def take(number: int = 1) -> None:
        picture: Any = Image.open(io.BytesIO(window.get_screenshot_as_png())).convert("RGB")
        height = WIDTH * picture.height // picture.width
        frames.extend([picture.resize((WIDTH, height), Image.Resampling.LANCZOS)] * number)

    with tempfile.TemporaryDirectory() as folder:
        tab = Tab(window, studio().save(Path(folder) / "studio.html"))
        tab.open()
        take(HOLD)
        for _ in range(4):
            tab.drag("domino", 20, (5, 0))
            take()
        take(HOLD)
        tab.click("faster")
        while "best row" not in tab.text("message"):
            take()
        take(HOLD)
        tab.set("pace", "0.1")
        tab.press("domino", 0)
        end = time.monotonic() + RACE
        while time.monotonic() < end:
            take()
    take(2 * HOLD)
    window.quit()
    # one palette, of a frame of the race, so that no colour flickers
    palette = frames[-3 * HOLD].quantize(96, Image.Quantize.MAXCOVERAGE)
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    more: dict[str, Any] = {"append_images": others, "duration": FRAME, "loop": 0}
    first.save(HERE / "studio.gif", save_all=True, optimize=True, **more)


if __name__ == "__main__":
    main()
