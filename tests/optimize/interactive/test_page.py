"""The page: the story of a draft in a real browser where there is one, with one server."""

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
from optimize.experiments.best_known import best_known
from optimize.interactive import server
from optimize.interactive.draft import Draft
from optimize.interactive.exchange import make_link, open_draft

page = pytest.importorskip("optimize.interactive.page", reason="needs the extra 'studio'")
pytestmark = pytest.mark.filterwarnings("ignore")  # Panel's and Bokeh's own

SPRINT = de.load_scene("sprint")
FIRST = SPRINT.uniform().layout
CONTROLS = {c.label: c for controls in page.CONTROLS.values() for c in controls}
LONGEST = 120.0  # [s] that a slow machine may take
CANVAS = "canvas[role=application]"
PRESS = ("pointer_down",), ("pointer_up",)
SCRIPT = """
function all(root) {
  const found = [...root.querySelectorAll('*')];
  return found.concat(...found.filter(e => e.shadowRoot).map(e => all(e.shadowRoot)));
}
const find = (selector, text) =>
  all(document).find(e => e.matches(selector) && (!text || e.textContent.trim() == text));
const models = [...window.Bokeh?.documents[0]?._all_models.values() ?? []];
const row = models.find(m => m.data?.attributes?.state)?.data.attributes.state;
const pointer = models.find(m => m.name == 'pointer');
const gaps = models.find(m => m.type == 'Figure' && m.title.text.startsWith('Gap'));
const frame = () => Bokeh.index.find_one_by_id(gaps.id).frame;
const box = () => Bokeh.index.find_one_by_id(gaps.id).el.getBoundingClientRect();
"""
# place of a point on the screen
POINT = """
const { x, y } = gaps.renderers[0].data_source.data, k = arguments[0];
return [box().left + frame().x_scale.compute(x[k]), box().top + frame().y_scale.compute(y[k])];
"""
# place of a domino near its base: the canvas has the scale and the margins of the figures
DOMINO = f"""
return [box().left + frame().x_scale.compute(arguments[0]) - 3,
        find('{CANVAS}').getBoundingClientRect().bottom - 25];
"""
COUNT_NODES = """
window.nodes = 0;
const make = AudioContext.prototype.createBufferSource;
AudioContext.prototype.createBufferSource = function() { nodes++; return make.call(this); };
"""


@pytest.mark.parametrize(
    "name", ["sprint", "relay", "table", "downhill", "jitter", "magnify", "hills"]
)
def test_the_value_of_a_control_gives_the_same_scene(name: str) -> None:
    scene = de.load_scene(name)
    draft = Draft(scene, best_known()[name].layout)
    shown = {label: c for label, c in CONTROLS.items() if c.read(scene) is not None}
    assert ("Placement noise [mm]" in shown) == (name == "jitter")
    assert ("Gaps of the run-out [mm]" in shown) == (name == "relay")
    assert ("Slope [°], positive downhill" in shown) == (name != "hills")
    assert ("Smallest gap [mm]" in shown) == (name != "magnify")  # in heights of a domino
    for control in shown.values():
        changed = control.change(draft, control.read(scene)).scene
        assert changed.replace(name=name, title=scene.title) == scene, control.label


class Tab:
    """A tab of the browser with the page of a studio.

    All is read from the page, not from the server's thread, which may be at work.
    """

    def __init__(self, window: Any, url: str) -> None:
        self.window = window
        window.switch_to.new_window("tab")
        self.open(url)

    def open(self, url: str) -> None:
        self.window.get(url)
        self.wait(lambda: self.settled)

    def wait(self, condition: Callable[[], Any]) -> None:
        """Wait until a condition holds."""
        end = time.monotonic() + LONGEST
        while not condition():
            assert time.monotonic() < end, f"not in time: {self.result} {self.status}"
            time.sleep(0.05)

    def run(self, script: str, *arguments: Any) -> Any:
        return self.window.execute_script(SCRIPT + script, *arguments)

    @property
    def status(self) -> str:
        return self.run("return find('[role=status]')?.textContent || ''")

    @property
    def result(self) -> str:
        return self.run("return find('.number')?.textContent || ''")

    @property
    def layout(self) -> de.Layout:
        """The layout in the address of the page."""
        return open_draft(self.window.current_url).layout

    @property
    def settled(self) -> bool:
        """True if the result is complete, and that of the draft in the address."""
        if "design=" not in self.window.current_url:
            return False
        draft = open_draft(self.window.current_url)
        return f"{draft.score:.3f} m/s" in self.result and "the best equal gaps" in self.result

    def click(self, name: str) -> None:
        """Click a link, a button that is enabled or the title of a card, once it is there."""
        script = "const found = find('a', '{0}') || find('button:enabled, h3', '{0}');"
        self.wait(lambda: self.run(f"{script.format(name)} found?.click(); return found"))

    def choose(self, option: str) -> None:
        """Choose an option of the selection that has it."""
        self.run(
            "const has = e => [...(e.options ?? [])].some(o => o.value == arguments[0]);"
            "const select = all(document).find(has);"
            "select.value = arguments[0]; select.dispatchEvent(new Event('change'))", option,
        )  # fmt: skip

    def send(self, selector: str, *keys: str) -> None:
        self.run("return find(arguments[0])", selector).send_keys(*keys)

    def pointer(self, place: Any, *moves: tuple[Any, ...]) -> None:
        """Move the pointer to a place, then move and press it."""
        from selenium.webdriver import ActionChains

        chain = ActionChains(self.window, duration=10)
        for name, *values in [("move_to_location", *map(int, place)), *moves]:
            getattr(chain.w3c_actions.pointer_action, name)(*values)
        chain.perform()

    def drag(
        self, place: Any, across: int, up: int, callback: Callable[[], Any] = lambda: None
    ) -> None:
        """Drag from a place on the screen by some pixels, and call `callback` after each step."""
        before, (x, y) = self.layout, place
        self.pointer(place, ("pointer_down",))
        for k in range(1, 9):
            self.pointer((x + across * k / 8, y - up * k / 8))
            callback()
        self.pointer((x + across, y - up), ("pointer_up",))
        self.wait(lambda: self.layout != before and self.settled)

    def domino(self, index: int) -> Any:
        """Return the place of a domino on the screen, near its base."""
        return self.run(DOMINO, float(self.layout.pivots[index, 0]))

    def changed_gaps(self) -> list[int]:
        """Return the gaps that differ from the first layout."""
        return np.flatnonzero(abs(self.layout.spacing - FIRST.spacing) > 1e-6).tolist()

    def undo(self) -> None:
        """Undo until the first layout is shown."""
        while self.layout != FIRST:
            before = self.layout
            self.click("Undo")
            self.wait(lambda before=before: self.layout != before and self.settled)


@pytest.fixture(scope="module")
def served() -> Iterator[Studio]:
    """A studio that is served as the command serves it."""
    made, ready = studio(SPRINT), threading.Event()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(server, "LIFETIME", 10_000)
        thread = threading.Thread(target=made.serve, args=(lambda _: ready.set(),), daemon=True)
        thread.start()
        assert ready.wait(LONGEST)
        yield made


@pytest.fixture(scope="module")
def tab(chromium: Any, served: Studio) -> Iterator[Tab]:
    tab = Tab(chromium, served.url)
    yield tab
    assert "SEVERE" not in [entry["level"] for entry in chromium.get_log("browser")]


def test_a_push_is_heard_and_space_pauses(tab: Tab) -> None:
    tab.run(COUNT_NODES)
    tab.pointer(tab.domino(0), *PRESS)
    place = "return pointer.visible && pointer.location"
    tab.wait(lambda: tab.run(place) > 0.1)
    tab.send(CANVAS, " ")
    paused = tab.run(place)
    later = "setTimeout(() => arguments[0](pointer.location), 200)"
    assert tab.window.execute_async_script(SCRIPT + later) == paused
    tab.send(CANVAS, " ")
    tab.wait(lambda: tab.run(place) == pytest.approx(FIRST.pivots[-1, 0]))
    assert tab.run("return nodes") == 39


def test_dragging_a_domino_or_a_point_changes_gaps_and_result(tab: Tab) -> None:
    before = tab.result
    tab.drag(tab.domino(12), 8, 0)
    assert tab.changed_gaps() == [11, 12]
    assert tab.layout.length == pytest.approx(FIRST.length)
    tab.undo()
    assert tab.result == before
    tab.drag(tab.run(POINT, 12), 3, 35)  # which goes up and down only
    assert tab.changed_gaps() == [12]
    assert tab.layout.spacing[12] > 0.022
    tab.undo()


def test_dominoes_are_inserted_and_removed(tab: Tab) -> None:
    from selenium.webdriver.common.keys import Keys

    x, y = tab.domino(5)
    tab.pointer((x + 12, y), *PRESS, *PRESS)
    tab.wait(lambda: tab.layout.count == 41 and tab.settled)
    tab.pointer(tab.domino(9), *PRESS)
    tab.send(CANVAS, Keys.DELETE)
    tab.wait(lambda: tab.layout.count == 40 and tab.settled)
    assert tab.layout != FIRST
    tab.undo()


def test_a_search_ends_by_itself_or_by_a_drag_and_keeps_what_it_found(tab: Tab) -> None:
    tab.click("Make it faster")
    tab.wait(lambda: "best of" in tab.status and tab.settled)
    assert "3.18% faster than the best equal gaps" in tab.result
    tab.click("Search thoroughly")
    tab.wait(lambda: "layouts" in tab.status)
    tab.click("Stop")
    tab.wait(lambda: "stopped" in tab.status)
    tab.undo()
    tab.click("Make it faster")
    tab.wait(lambda: "faster than" in tab.result)
    tab.pointer(tab.domino(0), *PRESS)  # a push ends the search, and the row goes on falling
    tab.wait(lambda: tab.run("return pointer.visible && pointer.location") > 0.5)
    tab.click("Make it faster")
    tab.wait(lambda: "searching:" in tab.status)
    tab.drag(tab.domino(20), 4, 0)
    assert len(tab.changed_gaps()) > 20
    tab.click("Make it faster")  # as no search runs any more
    tab.click("Stop")
    tab.undo()


def test_a_race_a_saved_file_and_a_wrong_one(
    tab: Tab, tmp_path: Path, output_of: Callable[..., str]
) -> None:
    tab.window.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    tab.drag(tab.run(POINT, 0), 0, 60)
    tab.choose("best known row")
    tab.wait(lambda: tab.run("return row.other") == "best known row")
    assert "later than best known row; the row is" in tab.run("return row.verdict")
    for label, name in (("Layout (CSV)", "layout.csv"), ("Scene (TOML)", "scene.toml")):
        tab.click(label)
        tab.wait(lambda name=name: (tmp_path / name).exists())
    score = open_draft(tab.window.current_url).score
    assert f"score {score:.6f} m/s on 'sprint'" in output_of("simulate", tmp_path / "layout.csv")
    path, layout = tmp_path / "wrong.csv", tab.layout
    path.write_text("spacing_mm,thickness_mm\n18,5,7.5\n,7.5\n")
    tab.send("input[type=file]", str(path))
    tab.wait(lambda: "wrong.csv, line 2: more cells" in tab.status)
    assert tab.layout == layout
    uniform = de.Layout.uniform(40, spacing=0.012)
    uniform.to_csv(path)
    tab.send("input[type=file]", str(path))
    tab.wait(lambda: "opened wrong.csv" in tab.status and tab.layout == uniform)
    tab.window.refresh()
    tab.wait(lambda: tab.settled and tab.layout == uniform)
    linked = Tab(tab.window, tab.window.current_url)
    linked.click("Equal gaps")
    linked.wait(lambda: linked.layout == FIRST)
    tab.window.close()
    tab.window.switch_to.window(tab.window.window_handles[-1])
    assert tab.layout == uniform  # tabs do not disturb each other


def test_settings_change_the_scene_and_keep_the_best_equal_gaps(tab: Tab, served: Studio) -> None:
    from selenium.webdriver.common.keys import Keys

    tab.open(served.url)
    tab.click("Dominoes")
    tab.wait(lambda: tab.run("return find('input.bk-input[type=text]')?.offsetParent"))
    tab.send("input.bk-input[type=text]", Keys.CONTROL, "a", Keys.NULL, "42", Keys.ENTER)
    tab.wait(lambda: tab.layout.count == 42 and "as fast as the best" in tab.result)
    tab.undo()


def test_a_stopped_row_is_repaired_and_checked(tab: Tab, served: Studio) -> None:
    wide = SPRINT.replace(spacing=(0.002, 0.06), count=20)
    draft = Draft.uniform(wide).with_size("spacing", 10, 0.055)
    tab.window.get(served.url + make_link(draft))
    tab.wait(lambda: "stops at domino 10" in tab.result)
    tab.click("Repair the gap where it stops")
    tab.wait(lambda: "m/s" in tab.result)
    tab.click("Will it work?")
    tab.wait(lambda: "Yes. Placed to ±0.5 mm, 100% of 256 rows fall" in tab.status)
    assert "20 of 20 dominoes fall" in tab.status


def test_a_row_on_a_floor_is_scored_there(tab: Tab, served: Studio) -> None:
    draft = Draft.uniform(SPRINT.replace(count=6, floor_friction=0.4))
    tab.open(served.url + make_link(draft))


@pytest.mark.usefixtures("phone")
def test_scenes_of_the_gallery_open_on_a_phone_too(tab: Tab) -> None:
    tab.open(tab.run("return find('a[href*=\"scene=hills\"]').href"))
    tab.wait(lambda: tab.run("return document.documentElement.scrollWidth") <= 390)


@pytest.mark.usefixtures("phone")
def test_a_swipe_over_the_gaps_scrolls_the_page(tab: Tab, served: Studio) -> None:
    tab.open(served.url)
    x, y, before = (
        200,
        tab.run("return find('.bk-events').getBoundingClientRect().y + 80"),
        tab.layout,
    )
    for kind, points in (
        ("touchStart", [{"x": x, "y": y}]),
        *(("touchMove", [{"x": x + k, "y": y - 10 * k}]) for k in range(1, 16)),
        ("touchEnd", []),
    ):
        touch = {"type": kind, "touchPoints": points}
        tab.window.execute_cdp_cmd("Input.dispatchTouchEvent", touch)
    tab.wait(lambda: tab.run("return scrollY") > 50)
    assert tab.layout == before


def test_a_damaged_link_shows_an_error(tab: Tab, served: Studio) -> None:
    tab.window.get(f"{served.url}?design=AAAA")
    tab.wait(lambda: "copy the whole link" in tab.status)


def test_closing_the_last_tab_ends_the_server(tab: Tab, served: Studio) -> None:
    assert served.url
    tab.window.close()
    tab.window.switch_to.window(tab.window.window_handles[0])
    tab.wait(lambda: not served.url)


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
    made = page.Page(Draft.uniform(SPRINT), lambda _: None)
    try:
        slope = CONTROLS["Slope [°], positive downhill"]
        made._call(made._edit, slope.change, 5.0)
        made._call(made._edit, slope.change, 14.0)
        assert "tips over by itself" in made.message.object
        assert made.draft.scene.ground == de.Ground(slope=5.0)
        assert made.controls[slope].value == 5.0
        made._call(made._edit, slope.change, 0.0)
        assert made.message.object.endswith("></p>")
        assert made.draft.scene.ground is None
    finally:
        made.close()
