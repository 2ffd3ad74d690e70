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
from optimize.interactive.design import Design
from optimize.interactive.exchange import make_link, open_design

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
# the place of a domino: the canvas has the scale and the margins of the figures
DOMINO = """
const box = find('canvas[role=application]').getBoundingClientRect();
const view = Bokeh.index.find_one_by_id([...Bokeh.documents[0]._all_models.values()].find(
  m => m.type == 'Figure').id);
return [view.el.getBoundingClientRect().left + view.frame.x_scale.compute(arguments[0]) - 3,
        box.bottom - 25];
"""
COUNT_NODES = """
window.nodes = 0;
const make = AudioContext.prototype.createBufferSource;
AudioContext.prototype.createBufferSource = function() { nodes++; return make.call(this); };
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
        self.window, self.url = window, url
        window.switch_to.new_window("tab")
        window.get(url)
        self.handle = window.current_window_handle
        self.wait(lambda: self.settled)

    def wait(self, condition: Callable[[], Any]) -> Any:
        """Wait until a condition holds, and return its value."""
        end = time.monotonic() + LONGEST
        while not (found := condition()):
            assert time.monotonic() < end, f"not in time: {self.result} {self.status}"
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
    def design(self) -> Design:
        """The design in the address of the page."""
        return open_design(self.window.current_url)

    @property
    def result(self) -> str:
        return self.text(".number")

    @property
    def settled(self) -> bool:
        """True if the result is complete, and that of the layout in the address."""
        is_linked = "design=" in self.window.current_url
        return (
            is_linked and f"{self.design.score:.3f} m/s" in self.result and "equal" in self.result
        )

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

    def choose(self, option: str) -> None:
        """Choose an option of the selection that has it."""
        self.run(
            "const select = all(document).find(e => e.matches('select') &&"
            "  [...e.options].some(o => o.value == arguments[0]));"
            "select.value = arguments[0]; select.dispatchEvent(new Event('change'))", option,
        )  # fmt: skip

    def send(self, selector: str, keys: str, text: str = "") -> None:
        element = self.run("return find(arguments[0], arguments[1])", selector, text)
        element.send_keys(keys)

    def pointer(self, *moves: tuple[Any, ...]) -> None:
        """Move and press the pointer."""
        from selenium.webdriver import ActionChains

        chain = ActionChains(self.window, duration=10)
        for name, *values in moves:
            getattr(chain.w3c_actions.pointer_action, name)(*values)
        chain.perform()

    def drag(
        self, place: Any, across: int, up: int, callback: Callable[[], Any] = lambda: None
    ) -> None:
        """Drag from a place on the screen by some pixels, and call `callback` after each step."""
        before, (x, y) = self.design.layout, map(int, place)
        self.pointer(("move_to_location", x, y), ("pointer_down",))
        for k in range(1, 9):
            self.pointer(("move_to_location", x + across * k // 8, y - up * k // 8))
            callback()
        self.pointer(("pointer_up",))
        self.wait(lambda: self.design.layout != before and self.settled)

    def point(self, gap: int) -> Any:
        """Return the place of a gap's point on the screen."""
        return self.run(POINT, gap)

    def domino(self, index: int) -> Any:
        """Return the place of a domino on the screen, near its base."""
        return self.run(DOMINO, float(self.design.layout.pivots[index, 0]))

    def changed_gaps(self) -> list[int]:
        """Return the gaps that differ from the first layout."""
        return np.flatnonzero(abs(self.design.layout.spacing - FIRST.spacing) > 1e-6).tolist()


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
    opened.window.get(opened.url)
    opened.wait(lambda: opened.settled and opened.design.layout == FIRST)
    yield opened
    assert "SEVERE" not in [entry["level"] for entry in opened.window.get_log("browser")]


def test_dragging_a_domino_or_a_point_changes_gaps_and_result(tab: Tab) -> None:
    before = tab.result
    tab.drag(tab.domino(12), 8, 0)
    assert tab.changed_gaps() == [11, 12]
    assert tab.design.layout.length == pytest.approx(FIRST.length)
    tab.click("Undo")
    tab.wait(lambda: tab.result == before and tab.changed_gaps() == [])
    tab.drag(tab.point(12), 3, 35)  # which goes up and down only
    assert tab.changed_gaps() == [12]
    assert tab.design.layout.spacing[12] > 0.022
    changed = tab.design.layout
    tab.window.refresh()
    tab.wait(lambda: tab.settled)
    assert tab.design.layout == changed


def test_a_push_is_heard_and_space_pauses(tab: Tab) -> None:
    tab.run(COUNT_NODES)
    x, y = map(int, tab.domino(0))
    tab.pointer(("move_to_location", x, y), ("pointer_down",), ("pointer_up",))
    pointer = (
        "const s = Bokeh.documents[0].get_model_by_name('pointer'); return s.visible && s.location"
    )
    tab.wait(lambda: tab.run(pointer) > 0.1)
    tab.send("canvas[role=application]", " ")
    place = tab.run(pointer)
    time.sleep(0.2)
    assert tab.run(pointer) == place
    tab.send("canvas[role=application]", " ")
    tab.wait(lambda: tab.run("return nodes") == 39)
    tab.wait(lambda: tab.run(pointer) == pytest.approx(FIRST.pivots[-1, 0]))


def test_dominoes_are_inserted_and_removed(tab: Tab) -> None:
    from selenium.webdriver.common.keys import Keys

    x, y = map(int, tab.domino(5))
    press = ("pointer_down",), ("pointer_up",)
    tab.pointer(("move_to_location", x + 12, y), *press, *press)
    tab.wait(lambda: tab.design.layout.count == 41 and tab.settled)
    tab.pointer(("move_to_location", *map(int, tab.domino(9))), *press)
    tab.send("canvas[role=application]", Keys.DELETE)
    tab.wait(lambda: tab.design.layout.count == 40 and tab.settled)
    assert tab.design.layout != FIRST
    tab.click("Undo")
    tab.click("Undo")
    tab.wait(lambda: tab.design.layout == FIRST)


def test_a_search_ends_by_itself(tab: Tab) -> None:
    tab.click("Make it faster")
    tab.wait(lambda: "best of" in tab.status and tab.settled)
    assert "3.18% faster than the best equal gaps" in tab.result
    assert tab.of("button", "Search thoroughly", "click")
    tab.click("Stop")
    tab.wait(
        lambda: "stopped" in tab.status and tab.of("button", "Make it faster", "disabled") is False
    )


def test_a_drag_ends_a_search_and_keeps_what_it_found(tab: Tab) -> None:
    tab.click("Make it faster")
    tab.wait(lambda: "faster than" in tab.result)
    tab.drag(tab.domino(20), 4, 0)
    tab.wait(lambda: tab.of("button", "Make it faster", "disabled") is False)
    assert len(tab.changed_gaps()) > 20


def test_a_race_a_saved_file_and_a_wrong_one(
    tab: Tab, tmp_path: Path, output_of: Callable[..., str]
) -> None:
    tab.window.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    tab.drag(tab.point(0), 0, 60)
    tab.choose("best known row")
    state = (
        "return [...Bokeh.documents[0]._all_models.values()].find(m => m.data?.attributes?.state)"
    )
    tab.wait(lambda: tab.run(f"{state}.data.attributes.state.rival") == "best known row")
    assert "later than best known row; the row is" in tab.run(
        f"{state}.data.attributes.state.verdict"
    )
    for name, ending in (("Layout (CSV)", "csv"), ("Scene without gaps (TOML)", "scene.toml")):
        tab.click("Print and save")
        tab.wait(lambda name=name: tab.of(".bk-item", name, "click"))
        tab.wait(lambda ending=ending: (tmp_path / f"sprint.{ending}").exists())
    printed = output_of("simulate", tmp_path / "sprint.csv")
    assert f"score {tab.design.score:.6f} m/s on 'sprint'" in printed
    path, layout = tmp_path / "wrong.csv", tab.design.layout
    path.write_text("spacing_mm,thickness_mm\n18,5,7.5\n,7.5\n")
    tab.send("input[type=file]", str(path))
    tab.wait(lambda: "wrong.csv, line 2: more cells" in tab.status)
    assert tab.design.layout == layout
    uniform = de.Layout.uniform(40, spacing=0.012)
    uniform.to_csv(path)
    tab.send("input[type=file]", str(path))
    tab.wait(lambda: "opened wrong.csv" in tab.status and tab.design.layout == uniform)
    linked = Tab(tab.window, tab.window.current_url)
    assert linked.design.layout == uniform
    linked.click("Equal gaps")
    linked.wait(lambda: linked.design.layout == FIRST)
    tab.window.close()
    tab.window.switch_to.window(tab.handle)
    assert tab.design.layout == uniform  # tabs do not disturb each other


def test_a_stopped_row_is_mended_and_checked(tab: Tab) -> None:
    wide = SPRINT.replace(spacing=(0.002, 0.06))
    design = Design.uniform(wide).with_size("spacing", 20, 0.055)
    tab.window.get(tab.url + make_link(design))
    tab.wait(lambda: "stops at domino 20" in tab.result)
    tab.wait(lambda: tab.of("button", "Mend the gap where it stops", "click"))
    tab.wait(lambda: "m/s" in tab.result)
    tab.click("Will it work?")
    tab.wait(lambda: "Yes. Placed to ±0.5 mm, 100% of 256 rows fall" in tab.status)
    assert "40 of 40 dominoes fall" in tab.status


def test_scenes_of_the_gallery_open(tab: Tab) -> None:
    href = tab.run("return all(document).find(e => e.matches('a[href*=\"scene=table\"]'))?.href")
    assert href
    tab.window.get(href)
    tab.wait(lambda: re.search(r"0\.80\d m/s as fast as the best equal gaps", tab.result))


def test_a_damaged_link_shows_an_error(served: Studio) -> None:
    from bokeh.client import pull_session

    with pull_session(url=served.url, arguments={"design": "AAAA"}) as session:
        texts = [str(getattr(model, "text", "")) for model in session.document.models]
    assert any("copy the whole link" in text for text in texts)


def test_sliders_change_the_scene_and_keep_the_best_equal_gaps(tab: Tab) -> None:
    from selenium.webdriver.common.keys import Keys

    tab.wait(lambda: tab.of("h3", "Dominoes", "click"))
    tab.wait(lambda: tab.run("return find('.noUi-handle')?.getBoundingClientRect().width") or 0)
    for _ in range(2):
        tab.send(".noUi-handle", Keys.ARROW_RIGHT)
    tab.wait(lambda: tab.design.layout.count == 42 and "as fast as the best" in tab.result)
    tab.click("Undo")
    tab.wait(lambda: tab.design.layout == FIRST)  # one step of the history


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


def test_a_rejected_value_keeps_the_last_accepted_one() -> None:
    calls = list[Any]()
    made = page.Page(Design.uniform(SPRINT), calls.append)
    try:
        slope = next(c for c in page.CONTROLS if c.label.startswith("Slope"))
        made._call(made._change, slope, 5.0)
        made._call(made._change, slope, 14.0)
        assert "tips over by itself" in made.message.object
        assert made.design.scene.ground == de.Ground(slope=5.0)
        made._call(made._change, slope, 4.0)
        assert made.message.object.endswith("></p>")
        made._move(-1)
        assert made.design.scene == SPRINT
        height, count = (
            next(c for c in page.CONTROLS if c.label.startswith(label))
            for label in ("Height", "Number")
        )
        for control, value in ((height, 50.0), (count, 41), (count, 40), (count, 42)):
            made._call(made._change, control, value)
        assert (made.design.scene.height, made.design.scene.count) == (0.05, 42)
        made._move(-1)
        assert (made.design.scene.height, made.design.scene.count) == (0.05, 40)
    finally:
        made.close()
