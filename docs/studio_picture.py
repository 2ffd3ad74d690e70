"""Write studio.gif, a drag, a search and a race on the page: python docs/studio_picture.py.

It needs the extra studio, the group dev, Chromium and its driver.
"""

from __future__ import annotations

import io
import shutil
import sys
import threading
import time
from pathlib import Path
from typing import Any

from PIL import Image
from selenium import webdriver

from optimize import studio

HERE = Path(__file__).parent
SIZE = 1100, 690
BAR = 16  # [px] of the scroll bar
WIDTH = 830  # [px] of the picture
HOLD = 10  # frames for which a state is shown
RACE = 17.0  # [s] of a race, ten times slower than real time
FRAME = 120  # [ms]


def main() -> None:
    """Open the page, drag a domino, search, push the row, and write the picture."""
    sys.path.insert(0, str(HERE.parent / "tests" / "optimize" / "interactive"))
    from test_page import Tab

    page, ready = studio(), threading.Event()
    threading.Thread(target=page.serve, args=(lambda _: ready.set(),), daemon=True).start()
    ready.wait()
    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for flag in ("headless=new", "no-sandbox", f"window-size={SIZE[0]},{SIZE[1] + 140}"):
        options.add_argument(f"--{flag}")
    driver = webdriver.ChromeService(str(shutil.which("chromedriver")))
    window = webdriver.Chrome(options=options, service=driver)
    frames: list[Image.Image] = []

    def take(number: int = 1) -> None:
        picture: Any = Image.open(io.BytesIO(window.get_screenshot_as_png())).convert("RGB")
        picture = picture.crop((0, 0, SIZE[0] - BAR, SIZE[1]))
        height = WIDTH * picture.height // picture.width
        frames.extend([picture.resize((WIDTH, height), Image.Resampling.LANCZOS)] * number)

    tab = Tab(window, page.url)
    take(HOLD)
    tab.drag(tab.domino(20), 9, 0, take)
    take(HOLD)
    tab.click("Make it faster")
    result = tab.result
    while "best of" not in tab.status:
        if tab.result != result:
            result = tab.result
            take()
    take(HOLD)
    tab.choose("10 × slower")
    tab.pointer(tab.domino(0), ("pointer_down",), ("pointer_up",))
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
