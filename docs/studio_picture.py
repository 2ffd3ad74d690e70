"""Write studio.gif, a drag, a search, a race and a measurement: python docs/studio_picture.py.

The recording is synthetic: hits of the wave of the row, with noise and a room. The program needs
the group dev, Chromium and its driver.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image

import domino_env as de
from domino_env.view.sound import write_wav
from optimize import studio

HERE = Path(__file__).parent
SIZE = 1100, 690
WIDTH = 830  # [px] of the picture
HOLD = 10  # frames for which a state is shown
RACE = 17.0  # [s] of a race, ten times slower than real time
FRAME = 120  # [ms]
BUILT = de.Physics(friction=0.22, push=7.5)  # of the row that is recorded


def main() -> None:
    """Open the page, drag a domino, search, push and measure the row, and write the picture."""
    tests = HERE.parent / "tests"
    sys.path[:0] = [str(HERE.parent), str(tests / "optimize" / "studio")]
    sys.path.append(str(tests))
    from recordings import record
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
        take(HOLD)
        recording = Path(folder) / "my row.wav"
        write_wav(0.3 * record(de.simulate(tab.layout, BUILT).arrival_times), recording)
        tab.run("document.getElementById('measure').open = true")
        window.find_element("id", "recordings").send_keys(str(recording))
        tab.wait(lambda: "explains the hits" in tab.text("measured"))
        tab.run("document.getElementById('measure').scrollIntoView()")
        time.sleep(0.2)  # in which the page is drawn
        take(3 * HOLD)
    window.quit()
    # one palette, of a frame of the race, so that no colour flickers
    palette = frames[-5 * HOLD].quantize(96, Image.Quantize.MAXCOVERAGE)
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    more: dict[str, Any] = {"append_images": others, "duration": FRAME, "loop": 0}
    first.save(HERE / "studio.gif", save_all=True, optimize=True, **more)


if __name__ == "__main__":
    main()
