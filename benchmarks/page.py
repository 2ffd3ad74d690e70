"""Times of the page in headless Chromium: until it is ready, and of a drag."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import domino_env as de
from domino_env.scenes.io.link import make_link
from optimize.studio.page import write_page

STARTS, DRAGS = 5, 100  # pages that are opened; positions of the pointer that are timed

# From a position of the pointer to the drawn canvases, in milliseconds, for domino 5.
DRAG = """
const canvas = document.getElementById("row"), box = canvas.getBoundingClientRect(), times = [];
const { px, pz, own } = domino.state.row.state, y = box.y + pz(0.5 * own.layout.height[5]);
const send = (type, x) => canvas.dispatchEvent(new PointerEvent(type, {
  clientX: x, clientY: y, pointerId: 1, isPrimary: true, buttons: 1, bubbles: true }));
canvas.setPointerCapture = () => {};
const from = box.x + px(own.x[5]) - 2;
send("pointerdown", from);
for (let k = 1; k <= arguments[0]; k++) {
  const began = performance.now();
  send("pointermove", from + 4 + (k % 7));
  canvas.getContext("2d").getImageData(0, 0, 1, 1);  // waits until all is drawn
  times.push(performance.now() - began);
}
send("pointerup", from + 4);
return times;
"""


def open_chromium() -> Any:
    """Return a headless browser; None where there is none."""
    binary, driver = shutil.which("chromium"), shutil.which("chromedriver")
    try:
        from selenium import webdriver
    except ImportError:
        return None
    if binary is None or driver is None:
        return None
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for flag in ("headless=new", "no-sandbox", "window-size=1440,900"):
        options.add_argument(f"--{flag}")
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))


def time_page() -> Iterator[tuple[str, float, str]]:
    """Yield names, median times [s] and remarks; nothing without Chromium and Selenium."""
    window = open_chromium()
    if window is None:
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "studio.html"
        size = write_page(path)
        ready = []
        for _ in range(STARTS):
            window.get("about:blank")
            window.get(path.as_uri())
            script = "const done = arguments[0]; domino.ready.then(() => done(performance.now()))"
            ready.append(1e-3 * float(window.execute_async_script(script)))
        yield "page: from opening the file until it is ready", median(ready), f"{size:,} bytes"
        for count in (100, 1000):
            scene = de.load_scene("sprint").replace(count=count, name="own")
            layout = scene.layout([0.012 + 0.002 * (k % 5) for k in range(count - 1)])
            window.get("about:blank")
            window.get(f"{path.as_uri()}#{make_link(scene, layout)}")
            window.execute_async_script("domino.ready.then(arguments[0])")
            times = window.execute_script(DRAG, DRAGS)
            name = f"page: drag of one of {count} dominoes, unequal gaps"
            yield name, 1e-3 * median(times), f"median of {DRAGS}"
    window.quit()
