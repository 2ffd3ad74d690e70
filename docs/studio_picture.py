"""Write studio.gif, a search on the page: python docs/studio_picture.py.

It needs the extras studio and dev, Chromium and its driver.
"""

from __future__ import annotations

import io
import shutil
import threading
import time
from pathlib import Path
from typing import Any

from PIL import Image
from selenium import webdriver

from optimize import studio

SIZE = 1000, 640
WIDTH = 800  # [px] of the picture
CROP = 0, 0, 788, 498  # without the bars that scroll the page
FIND = """
function all(root) {
  const found = [...root.querySelectorAll('*')];
  return found.concat(...found.filter(e => e.shadowRoot).map(e => all(e.shadowRoot)));
}
return all(document).find(e => e.tagName == 'BUTTON' && e.textContent.trim() == arguments[0]);
"""


def main() -> None:
    """Open the page, search, and write what is seen."""
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
        frames.extend([picture.quantize(48, dither=Image.Dither.NONE)] * number)

    window.get(page.url)
    while not window.execute_script(FIND, "Search"):
        time.sleep(0.5)
    time.sleep(3.0)
    take(6)
    window.execute_script("arguments[0].click()", window.execute_script(FIND, "Search"))
    score = None
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        if page.design.score != score:
            score = page.design.score
            take()
        time.sleep(0.05)
    take(15)
    window.quit()
    target = Path(__file__).with_name("studio.gif")
    more: dict[str, Any] = {"append_images": frames[1:], "duration": 150, "loop": 0}
    frames[0].save(target, save_all=True, optimize=True, **more)


if __name__ == "__main__":
    main()
