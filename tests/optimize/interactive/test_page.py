"""The page: in a real browser where there is one, with one server and a tab for each test."""

import re
import signal
import threading
import time
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import numpy as np
import pytest

import domino_env as de
from optimize import Studio, studio
from optimize.interactive.design import StudioDesign
from optimize.interactive.exchange import open_design

page = pytest.importorskip("optimize.interactive.page", reason="needs the extra 'studio'")
pytestmark = pytest.mark.filterwarnings("ignore")  # Panel's and Bokeh's own

SPRINT = de.load_scene("sprint")
FIRST = SPRINT.uniform().layout
LONGEST = 120.0  # [s] that a slow machine may take
ALL = """
function all(root) {
  const found = [...root.querySelectorAll('*')];
  return found.concat(...found.filter(e => e.shadowRoot).map(e => all(e.shadowRoot)));
}
function find(selector, text) {
  return all(document).find(e => e.matches(selector) && (!text || e.textContent.trim() == text));
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


@pytest.mark.parametrize("name", ["sprint", "relay", "table", "downhill"])
def test_the_value_of_a_control_gives_the_same_scene(name):
    scene = de.load_scene(name)
    for control in page.CONTROLS:
        if (value := control.read(scene)) is not None:
            assert scene.replace(**control.fields(scene, value)) == scene, control.label


def test_controls_add_change_and_remove_a_run_out():
    count, gap = (c for c in page.CONTROLS if "run-out" in c.label)
    longer = SPRINT.replace(**count.fields(SPRINT, 20))
    assert (longer.row_count, gap.read(SPRINT)) == (60, None)
    wider = longer.replace(**gap.fields(longer, 8.0))
    assert wider.run_out == de.RunOut(20, 0.008)
    assert wider.replace(**count.fields(wider, 30)).run_out == de.RunOut(30, 0.008)
    assert wider.replace(**count.fields(wider, 0)) == SPRINT


class Tab:
    """A tab of the browser with the page of a studio.

    All is read from the page, not from the server's thread, which may be at work.
    """

    def __init__(self, window: Any, url: str) -> None:
        self.window = window
        window.switch_to.new_window("tab")
        window.get(url)
        self.handle = window.current_window_handle
        self.wait(lambda: self.settled)

    def wait(self, condition: Callable[[], Any]) -> Any:
        """Wait until a condition holds, and return its value."""
        end = time.monotonic() + LONGEST
        while not (found := condition()):
            assert time.monotonic() < end, f"not in time: {self.text('.numbers')} {self.status}"
            time.sleep(0.05)
        return found

    def run(self, script: str, *arguments: Any) -> Any:
        return self.window.execute_script(ALL + script, *arguments)

    def text(self, selector: str = "*") -> str:
        """Return the text of elements."""
        return self.run(
            "return all(document).filter(e => e.matches(arguments[0])).map(e => e.textContent)"
            ".join(' ')", selector,
        )  # fmt: skip

    @property
    def status(self) -> str:
        return self.text("[role=status]")

    @property
    def link(self) -> str:
        return self.of("a", "Link that contains this layout", "href")

    @property
    def design(self) -> StudioDesign:
        """The design in the link of the page."""
        return open_design(self.link)

    @property
    def speed(self) -> float:
        return float((re.search(r"([\d.]+) m/s", self.text(".numbers")) or [0, "nan"])[1])

    @property
    def gain(self) -> float:
        return float((re.search(r"([+-][\d.]+)%gain", self.text(".numbers")) or [0, "nan"])[1])

    @property
    def settled(self) -> bool:
        """True if the numbers are complete and those of the layout in the link."""
        return bool(self.link) and abs(self.speed - self.design.score) < 6e-7 and self.gain > -100

    def of(self, selector: str, text: str, what: str) -> Any:
        """Return an attribute of the first such element, or what one of its methods returns.

        Elements are not kept: the page may draw them anew at any time.
        """
        return self.run(
            "const found = find(arguments[0], arguments[1]), value = found && found[arguments[2]];"
            "return typeof value == 'function' ? (value.call(found), true) : value",
            selector, text, what,
        )  # fmt: skip

    def click(self, name: str) -> None:
        self.wait(lambda: self.of("button:enabled, a", name, "click"))

    def send(self, selector: str, keys: str, text: str = "") -> None:
        element = self.run("return find(arguments[0], arguments[1])", selector, text)
        element.send_keys(keys)

    def drag(self, number: int, up: int, callback: Callable[[], Any] = lambda: None) -> None:
        """Drag a point of the gap curve by some pixels, and call `callback` after each step."""
        from selenium.webdriver import ActionChains

        def act(name: str, *values: Any) -> None:
            moves = ActionChains(self.window, duration=10)
            getattr(moves.w3c_actions.pointer_action, name)(*values)
            moves.perform()

        before = self.design.layout
        x, y = map(int, self.run(POINT, number))
        act("move_to_location", x, y)
        act("pointer_down")
        for k in range(1, 9):
            act("move_to_location", x + 3, y - up * k // 8)  # which goes up and down only
            callback()
        act("pointer_up")
        self.wait(lambda: self.design.layout != before and self.settled)


@pytest.fixture(scope="module")
def served() -> Studio:
    """A studio that is served as the command serves it."""
    made, ready = studio(SPRINT), threading.Event()
    server = threading.Thread(target=made.serve, args=(lambda _: ready.set(),), daemon=True)
    server.start()
    assert ready.wait(LONGEST)
    return made


@pytest.fixture(scope="module")
def opened(chromium: Any, served: Studio) -> Tab:
    return Tab(chromium, served.url)


@pytest.fixture
def tab(opened: Tab) -> Iterator[Tab]:
    opened.click("Reset")
    opened.wait(lambda: not opened.status and opened.settled and opened.design.layout == FIRST)
    yield opened
    assert "SEVERE" not in [entry["level"] for entry in opened.window.get_log("browser")]


def test_dragging_a_point_changes_the_gap_and_the_numbers(tab: Tab) -> None:
    before = tab.speed
    tab.drag(12, 35)
    gaps = tab.design.layout.spacing
    assert np.flatnonzero(abs(gaps - FIRST.spacing) > 1e-6).tolist() == [12]
    assert gaps[12] > 0.022
    assert tab.speed != before
    tab.click("Undo")
    tab.wait(lambda: tab.speed == before)


def test_improving_raises_the_gain(tab: Tab) -> None:
    tab.click("Improve")
    tab.wait(lambda: "nothing nearby is better" in tab.status and tab.settled and tab.gain > 1.0)


def test_a_stopped_search_shows_its_best_layout(tab: Tab) -> None:
    tab.click("Search")
    tab.click("Stop")
    tab.wait(lambda: "stopped; this is the best so far" in tab.status and tab.settled)
    assert tab.gain >= 0.0
    tab.wait(lambda: tab.of("button:disabled", "Stop", "disabled"))


def test_a_race_plays_and_the_export_scores_the_same(
    tab: Tab, tmp_path: Path, output_of: Callable[..., str]
) -> None:
    tab.window.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    from selenium.webdriver.common.keys import Keys

    tab.drag(0, 60)
    tab.run(
        "const select = find('select');"
        "select.value = 'best known layout'; select.dispatchEvent(new Event('change'))"
    )
    tab.wait(lambda: "Best known layout is the fastest" in tab.text())
    tab.of("button.play", "", "click")
    tab.wait(lambda: re.search(r"\d\.\d+ s of \d", tab.text()))
    tab.click("Layout (CSV)")
    tab.send("button", Keys.ENTER, "Scene (TOML)")
    names = {"sprint.csv", "sprint.scene.toml"}
    tab.wait(lambda: {path.name for path in tmp_path.iterdir()} >= names)
    printed = output_of("simulate", tmp_path / "sprint.csv")
    assert f"score {tab.speed:.6f} m/s on 'sprint'" in printed


def test_an_invalid_file_shows_its_error_and_a_link_its_layout(tab: Tab, tmp_path: Path) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text("spacing_mm,thickness_mm\n18,5,7.5\n,7.5\n")
    tab.send("input[type=file]", str(path))
    tab.wait(lambda: "wrong.csv, line 2: more cells" in tab.status)
    assert tab.design.layout == FIRST
    layout = de.Layout.uniform(40, spacing=0.012)
    layout.to_csv(path)
    tab.send("input[type=file]", str(path))
    tab.wait(lambda: "opened wrong.csv" in tab.status and tab.design.layout == layout)
    linked = Tab(tab.window, tab.link)
    assert linked.design.layout == layout
    linked.click("Equal gaps")
    linked.wait(lambda: linked.design.layout == FIRST)
    tab.window.close()
    tab.window.switch_to.window(tab.handle)
    assert tab.design.layout == layout  # tabs do not disturb each other


def test_a_damaged_link_shows_an_error(served: Studio) -> None:
    from bokeh.client import pull_session

    with pull_session(url=served.url, arguments={"design": "AAAA"}) as session:
        texts = [str(getattr(model, "text", "")) for model in session.document.models]
    assert any("copy the whole link" in text for text in texts)


def test_sliders_follow_the_keyboard(tab: Tab) -> None:
    from selenium.webdriver.common.keys import Keys

    tab.send(".noUi-handle", Keys.ARROW_RIGHT)
    tab.wait(lambda: tab.design.layout.count == 41 and tab.settled)
    assert tab.design.scene.count == 41


def test_the_page_fits_a_phone(tab: Tab) -> None:
    size = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    tab.window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        tab.wait(lambda: tab.run("return document.documentElement.scrollWidth") <= 390)
    finally:
        tab.window.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_closing_the_last_tab_ends_the_server(opened: Tab, served: Studio) -> None:
    assert served.url
    opened.window.close()
    opened.window.switch_to.window(opened.window.window_handles[0])
    opened.wait(lambda: not served.url)


def test_the_command_opens_its_address_and_ends_by_ctrl_c(
    monkeypatch: pytest.MonkeyPatch, output_of: Callable[..., str]
) -> None:
    pages, this = list[bytes](), threading.get_ident()

    def visit(url: str) -> None:
        pages.append(urlopen(url).read())
        signal.pthread_kill(this, signal.SIGINT)

    monkeypatch.setattr(
        webbrowser, "open", lambda url: threading.Thread(target=visit, args=(url,)).start()
    )
    assert "http://localhost:" in output_of("studio", "sprint")
    assert b"Domino studio" in pages[0]


def test_a_notebook_shows_the_page_in_a_frame() -> None:
    made = studio(SPRINT)
    assert (frame := made._repr_html_()) == made._repr_html_()
    assert f'src="{made.url}"' in frame
    assert b"Domino studio" in urlopen(made.url).read()
    assert made.layout == FIRST
