"""The page: in a real browser where there is one, with one server and a tab for each test."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

import domino_env as de
from domino_env.cli.main import main
from optimize import Studio, studio
from optimize.interactive.exchange import link_of

pytest.importorskip("panel", reason="needs the extra 'studio'")
pytestmark = pytest.mark.filterwarnings("ignore")  # Panel's and Bokeh's own

SPRINT = de.load_scene("sprint")
LONGEST = 120.0  # [s] that a slow machine may take
ALL = """
function all(root) {
  const found = [...root.querySelectorAll('*')];
  return found.concat(...found.filter(e => e.shadowRoot).map(e => all(e.shadowRoot)));
}
"""
POINT = """
const models = [...Bokeh.documents[0]._all_models.values()];
const gaps = models.find(m => m.type == 'Figure' && m.title.text.startsWith('Gap'));
const view = Bokeh.index.find_one_by_id(gaps.id);
let place = null;
gaps.renderers.forEach(r => { if (r.glyph.type == 'Scatter' && r.data_source.data.x.length) {
  const box = view.el.getBoundingClientRect(), data = r.data_source.data, k = arguments[0];
  place = [box.left + view.frame.x_scale.compute(data.x[k]),
           box.top + view.frame.y_scale.compute(data.y[k])]; } });
return place;
"""


class Tab:
    """A tab of the browser, with the page of a served studio."""

    def __init__(self, window: Any, url: str, studio: Studio) -> None:
        self.window, self.studio = window, studio
        self.first = {*window.window_handles}
        window.switch_to.new_window("tab")
        window.get(url)
        self.handle = window.current_window_handle
        self.wait(lambda: "m/s" in self.text("numbers"))
        self.page = studio.design

    def wait(self, condition: Callable[[], Any]) -> Any:
        """Wait until a condition holds, and return its value."""
        end = time.monotonic() + LONGEST
        while not (found := condition()):
            assert time.monotonic() < end, "not in time"
            time.sleep(0.05)
        return found

    def run(self, script: str, *arguments: Any) -> Any:
        return self.window.execute_script(ALL + script, *arguments)

    def text(self, kind: str) -> str:
        """Return the text of elements with a class or a role."""
        return self.run(
            "return all(document).filter(e => e.matches(`.${arguments[0]}, [role=${arguments[0]}]`)"
            ").map(e => e.textContent).join(' ')", kind,
        )  # fmt: skip

    @property
    def speed(self) -> float:
        return float(re.search(r"([\d.]+) m/s", self.text("numbers"))[1])

    @property
    def gain(self) -> float:
        return float(re.search(r"([+-][\d.]+)%gain", self.text("numbers"))[1])

    def element(self, selector: str, text: str = "") -> Any:
        return self.run(
            "return all(document).find(e => e.matches(arguments[0]) &&"
            " (!arguments[1] || e.textContent.trim() == arguments[1]))", selector, text,
        )  # fmt: skip

    def enabled(self, name: str) -> bool:
        return self.run(
            "return all(document).some(e => e.matches('button:enabled') &&"
            " e.textContent.trim() == arguments[0])", name,
        )  # fmt: skip

    def click(self, name: str) -> None:
        self.run("arguments[0].click()", self.element("button:not(:has(a)), a", name))


@pytest.fixture(scope="module")
def window() -> Iterator[Any]:
    webdriver = pytest.importorskip("selenium.webdriver")
    binary, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if binary is None or driver is None:
        pytest.skip("no Chromium here")
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for flag in ("headless=new", "no-sandbox", "disable-gpu", "window-size=1280,1300"):
        options.add_argument(f"--{flag}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    window = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield window
    window.quit()


@pytest.fixture(scope="module")
def served() -> Studio:
    """A studio that is served as the command serves it."""
    made, ready = studio(SPRINT), threading.Event()
    server = threading.Thread(target=made.serve, args=(lambda _: ready.set(),), daemon=True)
    server.start()
    assert ready.wait(LONGEST)
    return made


@pytest.fixture(scope="module")
def opened(window: Any, served: Studio) -> Tab:
    return Tab(window, served.url, served)


@pytest.fixture
def tab(opened: Tab) -> Iterator[Tab]:
    yield opened
    for handle in {*opened.window.window_handles} - opened.first - {opened.handle}:
        opened.window.switch_to.window(handle)
        opened.window.close()
    opened.window.switch_to.window(opened.handle)
    assert [one for one in opened.window.get_log("browser") if one["level"] == "SEVERE"] == []
    opened.click("Reset")
    opened.wait(lambda: opened.page.layout == opened.page.first[1])


def test_dragging_a_point_changes_the_gap_and_the_numbers(tab: Tab) -> None:
    from selenium.webdriver import ActionChains

    before = tab.speed
    x, y = tab.run(POINT, 12)
    moves = ActionChains(tab.window, duration=10)
    pointer = moves.w3c_actions.pointer_action
    pointer.move_to_location(int(x), int(y))
    pointer.pointer_down()
    for k in range(8):
        pointer.move_to_location(int(x) + 3, int(y) - 5 * k)  # which goes up and down only
    pointer.pointer_up()
    moves.perform()
    tab.wait(lambda: tab.speed != before)
    tab.wait(lambda: tab.enabled("Undo"))
    changed = [i for i, gap in enumerate(tab.page.layout.spacing) if abs(gap - 0.018077) > 1e-6]
    assert changed == [12]
    assert tab.page.layout.spacing[12] > 0.022
    assert tab.speed == pytest.approx(SPRINT.score(tab.page.layout), abs=5e-7)
    tab.click("Undo")
    tab.wait(lambda: tab.speed == before)


def test_improving_gains_and_another_tab_keeps_its_layout(tab: Tab) -> None:
    first, gaps = tab.page, tab.page.layout
    tab.click("Improve")
    tab.wait(lambda: "improved" in tab.text("status"))
    assert tab.gain > 1.0
    assert tab.speed == pytest.approx(SPRINT.score(first.layout), abs=5e-7)
    other = Tab(tab.window, tab.studio.url, tab.studio)
    assert other.page.layout == gaps != first.layout


def test_a_search_stops_where_it_is_stopped(tab: Tab) -> None:
    tab.click("Search")
    tab.wait(lambda: tab.enabled("Stop"))
    tab.click("Stop")
    tab.wait(lambda: "stopped; this is the best so far" in tab.text("status"))
    assert tab.gain >= 0.0
    assert not tab.enabled("Stop")


def test_a_race_plays_and_the_export_scores_the_same(
    tab: Tab, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tab.window.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    tab.page.drag("spacing", 0, 0.028)  # as by hand
    tab.page.commit()
    select = tab.element("select")
    tab.run(
        "arguments[0].value = 'best known layout';"
        "arguments[0].dispatchEvent(new Event('change'))", select,
    )  # fmt: skip
    page_text = "return all(document).map(e => e.textContent).join(' ')"
    tab.wait(lambda: "Best known layout is the fastest" in tab.run(page_text))
    tab.run("arguments[0].click()", tab.element("button.play"))
    clock = "return all(document).map(e => e.textContent).find(t => /^\\d.\\d+ s of/.test(t))"
    tab.wait(lambda: float((tab.run(clock) or "0").split()[0]) > 0.1)
    tab.click("Layout (CSV)")
    tab.click("Scene (TOML)")
    tab.wait(lambda: len(list(tmp_path.glob("sprint*.[ct]*[vl]"))) == 2)
    assert main(["simulate", str(tmp_path / "sprint.csv")]) == 0
    assert f"score {SPRINT.score(tab.page.layout):.6f} on 'sprint'" in capsys.readouterr().out


def test_a_wrong_file_gets_its_sentence_and_a_link_its_layout(tab: Tab, tmp_path: Path) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text("spacing_mm,thickness_mm\n18,5,7.5\n,7.5\n")
    before = tab.page.layout
    tab.element("input[type=file]").send_keys(str(path))
    tab.wait(lambda: "wrong.csv, line 2: more cells" in tab.text("status"))
    assert tab.page.layout is before
    de.Layout.uniform(40, spacing=0.012).to_csv(path)
    tab.element("input[type=file]").send_keys(str(path))
    tab.wait(lambda: "opened wrong.csv" in tab.text("status"))
    link = tab.studio.url + link_of(tab.page)
    tab.wait(
        lambda: tab.element("a", "Link that contains this layout").get_attribute("href") == link
    )
    linked = Tab(tab.window, link, tab.studio)
    assert linked.page.layout == tab.page.layout != before
    tab.window.get(f"{tab.studio.url}?design=AAAA")
    tab.wait(lambda: "copy the whole link" in tab.text("status"))


def test_sliders_follow_the_keyboard(tab: Tab) -> None:
    from selenium.webdriver.common.keys import Keys

    handle = tab.element(".noUi-handle")
    handle.send_keys(Keys.ARROW_RIGHT)
    tab.wait(lambda: (tab.page.scene.count, tab.page.layout.count) == (41, 41))
    assert tab.page.scene.violations(tab.page.layout) == []
    tab.wait(lambda: "computing" not in tab.text("numbers"))


def test_the_page_fits_a_phone(tab: Tab) -> None:
    size = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    tab.window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        tab.wait(lambda: tab.run("return document.documentElement.scrollWidth") <= 390)
    finally:
        tab.window.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_closing_the_last_tab_ends_the_server(opened: Tab) -> None:
    assert opened.studio.url
    opened.window.close()
    opened.window.switch_to.window(opened.window.window_handles[0])
    opened.wait(lambda: not opened.studio.url)


def test_the_command_prints_its_address_and_ends_by_ctrl_c() -> None:
    code = "import sys; from domino_env.cli.main import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, "studio", "sprint", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        url = process.stdout.readline().strip()
        assert b"Domino studio" in urlopen(url).read()
        process.send_signal(signal.SIGINT)
        assert process.wait(LONGEST) == 0
    finally:
        process.kill()


def test_a_notebook_shows_the_page_in_a_frame() -> None:
    made = studio(SPRINT)
    assert (frame := made._repr_html_()) == made._repr_html_()
    assert f'src="{made.url}"' in frame
    assert b"Domino studio" in urlopen(made.url).read()
    assert made.layout == SPRINT.uniform().layout
