"""Write studio.gif, a drag and a search on the page: python docs/studio_picture.py.

It needs the extras studio and dev, Chromium and its driver.
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
SIZE = 1000, 860
WIDTH = 800  # [px] of the picture
CROP = 0, 0, 516, 680  # numbers, dominoes and curves, without the column of the scene
HOLD = 12  # frames for which a state is shown
LONGEST = 40.0  # [s] after which the search is stopped


def main() -> None:
    """Open the page, drag a point, search, and write the picture."""
    sys.path.insert(0, str(HERE.parent / "tests" / "optimize" / "interactive"))
    from test_page import Tab

    page, ready = studio("sprint"), threading.Event()
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
        picture = picture.resize((WIDTH, WIDTH * picture.height // picture.width)).crop(CROP)
        frames.extend([picture.quantize(96, dither=Image.Dither.NONE)] * number)

    tab = Tab(window, page.url)
    take(HOLD)
    tab.drag(12, 40, take)
    take(HOLD)
    tab.click("Search")
    speed, end = tab.speed, time.monotonic() + LONGEST
    while "layouts in" not in tab.status:
        if tab.speed != speed:
            speed = tab.speed
            take()
        if time.monotonic() > end:
            tab.click("Stop")
            tab.wait(lambda: "layouts in" in tab.status)
    take(2 * HOLD)
    window.quit()
    more: dict[str, Any] = {"append_images": frames[1:], "duration": 150, "loop": 0}
    frames[0].save(HERE / "studio.gif", save_all=True, optimize=True, **more)


if __name__ == "__main__":
    main()
