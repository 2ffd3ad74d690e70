"""The page: its parts in Python, and the story of a row in a real browser where there is one."""

import base64
import re
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recordings import record

import domino_env as de
from domino_env.physics.physics import released_push
from domino_env.scenes.io.link import layout_document, make_link, read_link
from domino_env.scenes.io.reading import read_layout
from domino_env.view.sound import write_wav
from optimize import studio
from optimize.experiments.best_known import best_known
from optimize.studio import page as pages

SPRINT, COURSE = de.load_scene("sprint"), de.load_scene("course")
RELEASED = released_push(0.048, 0.0075, 9.81)  # [rad/s] in this scene
FIRST = SPRINT.uniform().layout
BEST = best_known()["sprint"].layout
SCENES = len(de.scene_names())
LONGEST = 60.0  # [s] that a slow machine may take
SIZES = {"desk": (1440, 900), "phone": (390, 844)}
PLACES = {
    "domino": "const { px, pz, own } = domino.state.row.state;"
    "return [px(own.x[{0}]) - 2, pz(own.z[{0}] + 0.5 * own.layout.height[{0}])]",
    "gap": "return domino.state.curves.spacing.place({0})",
}
CONTROL = (
    "[...document.querySelectorAll('#controls label')]"
    ".find(e => e.textContent.trim() == arguments[0])"
)
BOXES = {"domino": "#row", "gap": "#spacing canvas"}


class Tab:
    """The page in a tab of the browser."""

    def __init__(self, window: Any, path: Path) -> None:
        self.window, self.address = window, path.as_uri()

    def open(self, fragment: str = "") -> None:
        self.window.get("about:blank")
        self.window.get(self.address + fragment)
        self.wait(lambda: self.text("number"))

    def run(self, script: str, *arguments: Any) -> Any:
        return self.window.execute_script(script, *arguments)

    def wait(self, condition: Callable[[], Any]) -> None:
        end = time.monotonic() + LONGEST
        while not condition():
            assert time.monotonic() < end, f"not in time: {self.result}: {self.text('message')}"
            time.sleep(0.02)

    def text(self, name: str) -> str:
        return self.run("return document.getElementById(arguments[0])?.textContent", name) or ""

    @property
    def result(self) -> str:
        return f"{self.text('number')} {self.text('sentence')}"

    @property
    def layout(self) -> de.Layout:
        return de.Layout(**self.run("return domino.layout()"))

    def click(self, name: str) -> None:
        self.run("document.getElementById(arguments[0]).click()", name)

    def set(self, name: str, value: object) -> None:
        self.run(
            "const e = document.getElementById(arguments[0]); e.value = arguments[1];"
            "e.dispatchEvent(new Event('change'))", name, value,
        )  # fmt: skip

    def setting(self, label: str, value: object) -> None:
        """Set a number of the scene."""
        self.run(
            f"const input = ({CONTROL}).querySelector('input'); input.value = arguments[1];"
            "input.dispatchEvent(new Event('change'))", label, value,
        )  # fmt: skip

    def tick(self, label: str) -> None:
        """Click a checkbox of the scene."""
        self.run(f"({CONTROL}).querySelector('input').click()", label)

    def upload(self, *paths: Path) -> None:
        self.run("document.getElementById('scenes').open = true")
        field = self.window.find_element("id", "files")
        field.send_keys("\n".join(map(str, paths)))

    def place(self, kind: str, index: int) -> tuple[float, float]:
        """Return the place of a domino, or of the point of a gap, on the screen."""
        box = f"document.querySelector('{BOXES[kind]}')"
        self.run(f"{box}.scrollIntoView({{ block: 'center' }})")
        x, y = self.run(PLACES[kind].replace("{0}", str(index)))
        left, top = self.run(f"const b = {box}.getBoundingClientRect(); return [b.x, b.y]")
        return left + x, top + y

    def drag(self, kind: str, index: int, by: tuple[int, int], touch: bool = False) -> None:
        """Drag something in eight steps, by mouse or by a finger."""
        x, y = self.place(kind, index)
        path = [(x + by[0] * k / 8, y + by[1] * k / 8) for k in range(9)]
        names = ("touchStart", "touchMove", "touchEnd")
        if not touch:
            names = ("mousePressed", "mouseMoved", "mouseReleased")
        self._send(names[0], *path[0])
        for point in path[1:]:
            self._send(names[1], *point)
        self._send(names[2], *path[-1])

    def press(self, kind: str, index: int) -> None:
        self.drag(kind, index, (0, 0))

    def _send(self, kind: str, x: float, y: float) -> None:
        if kind.startswith("touch"):
            points = [] if kind == "touchEnd" else [{"x": x, "y": y}]
            event: dict[str, Any] = {"type": kind, "touchPoints": points}
            self.window.execute_cdp_cmd("Input.dispatchTouchEvent", event)
        else:
            event = {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1, "buttons": 1}
            self.window.execute_cdp_cmd("Input.dispatchMouseEvent", event)

    def changed_gaps(self, before: de.Layout = FIRST) -> list[int]:
        return np.flatnonzero(abs(self.layout.spacing - before.spacing) > 1e-6).tolist()


@pytest.fixture(scope="module")
def tab(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    """The page from a file, without network."""
    path = tmp_path_factory.mktemp("page") / "studio.html"
    assert pages.write_page(path, SPRINT) <= 450_000
    chromium.execute_cdp_cmd("Network.enable", {})
    offline = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
    chromium.execute_cdp_cmd("Network.emulateNetworkConditions", offline)
    chromium.get_log("browser")
    made = Tab(chromium, path)
    made.open()
    yield made
    chromium.execute_cdp_cmd("Network.disable", {})
    assert [e["message"] for e in chromium.get_log("browser") if e["level"] == "SEVERE"] == []


@pytest.fixture(params=SIZES)
def size(request: pytest.FixtureRequest, tab: Tab) -> Iterator[str]:
    width, height = SIZES[request.param]
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    tab.window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    touch = {"enabled": width < 500}
    tab.window.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", touch)
    tab.open()
    yield request.param
    tab.window.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
    tab.window.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


# in Python ---------------------------------------------------------------------------------------


def test_sources_of_the_page(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    BEST.to_csv(folder / "layout.csv")
    scene, layout = pages.read_source(folder)
    assert (scene.name, layout) == ("own", BEST)
    (folder / "scene.toml").write_text(SPRINT.to_toml())
    for source in (folder, folder / "layout.csv", f"file:///a.html#{make_link(SPRINT, BEST)}"):
        assert pages.read_source(source) == (SPRINT, BEST)
    assert pages.read_source("sprint") == pages.read_source(SPRINT) == (SPRINT, None)
    wide = de.Layout(np.linspace(0.001, 0.045, 11), 0.008)
    assert pages.read_source(wide)[0].spacing == (0.001, 0.045)
    (folder / "scene.toml").write_text(COURSE.to_toml())
    with pytest.raises(ValueError, match="40 dominoes, and the scene 60"):
        pages.read_source(folder)
    with pytest.raises(ValueError, match="give a layout of two or more"):
        pages.read_source(de.Layout.uniform(1, spacing=0.01))


@pytest.mark.parametrize("content", [
    "", "€", "AAAA", b"[1, 2", b"{}", b"[" * 10**6, b" " * 10**8, b'{"scene": 1, "layout": []}',
])  # fmt: skip
def test_a_damaged_link_is_rejected(content: str | bytes) -> None:
    if isinstance(content, bytes):
        content = base64.urlsafe_b64encode(zlib.compress(content)).decode()
    with pytest.raises(ValueError, match="the row in the link: "):
        read_link(f"#design={content}")


def test_the_command_keeps_the_page_and_a_notebook_shows_it(
    tmp_path: Path, output_of: Callable[..., str]
) -> None:
    path = tmp_path / "row.html"
    printed = output_of("studio", "sprint", "--out", path, "--no-browser")
    assert printed.strip() == str(path)
    frame = studio("sprint")._repr_html_()
    assert frame.startswith('<iframe srcdoc="&lt;!doctype html&gt;')
    assert path.read_text("utf-8").startswith("<!doctype html>")


def test_modules_become_functions() -> None:
    text = pages._bundle(pages.LIBRARY) + pages._bundle(pages.PAGE)
    for name in set(re.findall(r"= (\$\w+);", text)):
        assert f"const {name} = (() => {{" in text, f"{name} is not in the page"


# in the browser ----------------------------------------------------------------------------------


def test_a_domino_and_a_point_are_dragged(tab: Tab, size: str) -> None:
    touch = size == "phone"
    tab.drag("domino", 6, (8, 0), touch)
    assert tab.changed_gaps() == [5, 6]
    assert tab.layout.length == pytest.approx(FIRST.length)
    tab.click("undo")
    assert tab.layout == FIRST
    tab.drag("gap", 12, (0, -35), touch)
    assert tab.changed_gaps() == [12]
    assert tab.layout.spacing[12] > 0.022
    tab.click("undo")
    tab.click("redo")
    assert tab.changed_gaps() == [12]
    if touch:  # a swipe beside the points scrolls
        tab.run("scrollTo(0, 0)")
        tab.drag("gap", 12, (0, 0), touch)
        assert tab.run("return document.documentElement.scrollWidth") <= 390


def test_a_push_is_heard_and_space_pauses(tab: Tab) -> None:
    tab.open()
    tab.run(
        "window.nodes = 0; const make = AudioContext.prototype.createBufferSource;"
        "AudioContext.prototype.createBufferSource = function() { nodes++; return make.call(this) }"
    )
    tab.set("pace", "0.1")
    tab.press("domino", 0)
    state = "return domino.state.row.state"
    tab.wait(lambda: tab.run(f"{state}.now") > 0.01)
    canvas = tab.window.find_element("id", "row")
    canvas.send_keys(" ")
    assert not tab.run(f"{state}.playing")
    canvas.send_keys(" ")
    tab.set("pace", "1")
    tab.wait(lambda: tab.run("const s = domino.state.row.state; return s.now == s.end"))
    assert tab.run("return nodes") == 39


def test_dominoes_are_inserted_removed_and_moved_by_keys(tab: Tab) -> None:
    tab.open()
    x, y = tab.place("domino", 5)
    tab.run(
        "document.getElementById('row').dispatchEvent(new MouseEvent('dblclick', "
        "{clientX: arguments[0], clientY: arguments[1]}))", x + 12, y,
    )  # fmt: skip
    assert tab.layout.count == 41
    tab.press("domino", 9)
    canvas = tab.window.find_element("id", "row")
    canvas.send_keys("\ue017")  # Delete
    assert tab.layout.count == 40
    tab.click("undo")
    tab.click("undo")
    tab.press("domino", 9)
    canvas.send_keys("\ue014\ue013")  # right: domino 10; up: forward by 0.5 mm
    assert tab.changed_gaps() == [9, 10]
    assert tab.layout.spacing[9] - FIRST.spacing[9] == pytest.approx(0.0005)
    with_control = {"bubbles": True, "ctrlKey": True, "key": "z"}
    tab.run("document.body.dispatchEvent(new KeyboardEvent('keydown', arguments[0]))", with_control)
    assert tab.layout == FIRST


def test_a_search_ends_by_itself_or_by_a_touch_and_keeps_what_it_found(tab: Tab, size: str) -> None:
    tab.click("faster")
    tab.wait(lambda: "faster than" in tab.result)
    tab.press("domino", 0)  # a push ends the search, and the row falls
    assert tab.run("return domino.state.search") is None
    found = tab.layout
    assert SPRINT.score(found) > SPRINT.score(FIRST)
    tab.click("undo")
    assert tab.layout == FIRST
    if size == "desk":
        tab.click("faster")
        tab.wait(lambda: "best row" in tab.text("message"))
        assert "3.18% faster than the best equal gaps" in tab.result
        assert "100% of the gain" in tab.text("details")
        tab.click("thorough")
        tab.wait(lambda: tab.text("faster") == "Stop")
        tab.click("faster")
        assert "stopped" in tab.text("message")


def test_a_race(tab: Tab) -> None:
    tab.open()
    tab.drag("gap", 0, (0, 30))
    tab.set("against", "best known row")
    state = "return domino.state.row.state"
    assert tab.run(f"{state}.other") == "best known row"
    tab.click("keep")
    tab.click("equal")
    assert tab.layout == FIRST
    assert tab.run("return document.getElementById('against').value") == "kept row"
    tab.set("pace", "1")
    tab.run("domino.state.row.setSound(false); domino.state.row.push()")
    tab.wait(lambda: tab.run("const s = domino.state.row.state; return s.now == s.end"))


def test_rows_of_runs_are_raced_and_a_frame_shows_the_page(tab: Tab, tmp_path: Path) -> None:
    run = {"name": "run-1", "layout": layout_document(BEST), "document": SPRINT.document()}
    pages.write_page(tmp_path / "rows.html", SPRINT, rows=[run])
    (tmp_path / "frame.html").write_text(studio(SPRINT)._repr_html_(), "utf-8")
    other = Tab(tab.window, tmp_path / "rows.html")
    other.open()
    other.set("against", "run-1")
    assert other.run("return domino.state.row.state.other") == "run-1"
    tab.window.get((tmp_path / "frame.html").as_uri())
    tab.window.switch_to.frame(0)
    tab.wait(lambda: "as fast as" in tab.result)
    tab.window.switch_to.default_content()


def test_a_scene_that_the_page_cannot_search_names_the_command(tab: Tab) -> None:
    tab.open("#scene=stock")
    tab.click("faster")
    assert "domino optimize stock" in tab.text("message")
    tab.drag("gap", 3, (0, 20))
    assert "slower than the best equal gaps" in tab.result
    tab.open("#scene=table")
    tab.wait(lambda: "on a floor of friction 0.4 as fast as the best equal gaps" in tab.result)


def rectangles(pdf: bytes) -> list[list[tuple[float, ...]]]:
    """Return the rectangles [mm] of each page of a PDF that Chromium has written."""
    sheets = []
    for match in re.finditer(rb"stream\r?\n(.*?)\r?\nendstream", pdf, re.DOTALL):
        try:
            text = zlib.decompress(match[1]).decode("latin1")
        except zlib.error:
            continue
        matrix, stack, found = np.eye(3), list[Any](), []
        for line in text.splitlines():
            *numbers, operator = line.split() or [""]
            if operator == "q":
                stack.append(matrix)
            elif operator == "Q":
                matrix = stack.pop()
            elif operator == "cm":
                a, b, c, d, e, f = map(float, numbers)
                matrix = np.array([[a, b, 0], [c, d, 0], [e, f, 1]]) @ matrix
            elif operator == "re":
                x, y, w, h = map(float, numbers)
                corners = np.array([[x, y, 1], [x + w, y + h, 1]]) @ matrix * 25.4 / 72
                found.append((*corners[0, :2], *corners[1, :2]))
        sheets += [found] if found else []
    return sheets


@pytest.mark.parametrize(("paper", "height"), [
    ("a4", 210.0), ("letter", 215.9), ("roll", 210.0),
])  # fmt: skip
def test_a_printed_row_has_the_gaps_of_the_layout(tab: Tab, paper: str, height: float) -> None:
    tab.open("#" + make_link(SPRINT, BEST))
    tab.set("paper", paper)
    tab.set("safety", 200)
    answer = tab.window.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})
    pdf = base64.b64decode(answer["data"])
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", pdf)
    across = [float(h) * 25.4 / 72 for _, h in boxes]
    assert across == pytest.approx([height] * len(boxes), abs=0.3)
    starts, ends = [], []
    for sheet in rectangles(pdf):
        # filled boxes are drawn twice
        sheet = {tuple(round(float(x), 3) for x in r) for r in sheet}
        dominoes = [r for r in sheet if abs(abs(r[3] - r[1]) - 24.0) < 0.05]
        assert all(abs(abs(r[2] - r[0]) - 7.5) < 0.05 for r in dominoes)
        for y in sorted({round(r[1]) for r in dominoes}, reverse=True):  # strips
            strip = sorted(r for r in dominoes if round(r[1]) == y)
            starts.append([r[0] for r in strip])
            ends.append([r[2] for r in strip])
    strips = zip(starts, ends, strict=True)
    gaps = [b - a for s, e in strips for a, b in zip(e[:-1], s[1:], strict=True)]
    expected = iter(1e3 * BEST.spacing)
    # a domino at the end of a strip may be on the next one too; all gaps come in order
    for gap in gaps:
        assert any(abs(gap - other) < 0.1 for other in expected), "a gap is wrong or missing"
    assert len(gaps) >= 39 - len(starts) + 1


@pytest.mark.parametrize("options", [{}, {"tolerance": 0.5, "piece": 120, "safety": 100}])
def test_a_strip_has_a_slot_for_each_domino(tab: Tab, options: dict[str, float]) -> None:
    tab.open("#" + make_link(SPRINT, BEST))
    for name, value in options.items():
        tab.set(name, value)
    svg = tab.run(
        "const make = URL.createObjectURL; let blob;"
        "URL.createObjectURL = (b) => { blob = b; return make(b) };"
        "document.getElementById('strip').click(); URL.createObjectURL = make; return blob.text()"
    )
    parts = re.findall(r'<rect x="([\d.-]+)" y="([\d.-]+)" width="([\d.]+)" .*?class="(\w+)"', svg)
    tolerance, begin, fronts = options.get("tolerance", 0.3), -17.5, []
    length = 0.0
    for x, _, width, kind in parts:
        if kind == "piece":
            begin, length = begin + length, float(width)
            assert length <= options.get("piece", 300)
        else:
            assert float(width) == pytest.approx(7.5 + tolerance)
            fronts.append(begin + float(x) + float(width) - 0.5 * tolerance)
    assert fronts == pytest.approx(1e3 * BEST.positions, abs=0.01)
    tab.set("tolerance", 3)
    tab.click("strip")
    assert re.search(r"gap \d+ is 2\.00 mm wide: .* give a smaller tolerance", tab.text("message"))


def test_saved_files_are_read_by_the_commands_and_by_the_page(
    tab: Tab, tmp_path: Path, output_of: Callable[..., str]
) -> None:
    tab.open()
    tab.window.execute_cdp_cmd(
        "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)}
    )
    tab.drag("domino", 6, (8, 0))
    layout, score = tab.layout, tab.run("return domino.state.draft.score")
    files = {"csv": "layout.csv", "json": "layout.json", "toml": "scene.toml"}
    for button, name in files.items():
        tab.click(button)
        tab.wait(lambda name=name: (tmp_path / name).exists())
    assert f"score {score:.6f} m/s on 'sprint'" in output_of("simulate", tmp_path / "layout.csv")
    assert read_layout(tmp_path / "layout.json", None) == layout
    assert de.load_scene(tmp_path / "scene.toml") == SPRINT
    tab.wait(lambda: "#design=" in tab.run("return location.href"))
    tab.wait(lambda: read_link(tab.run("return location.href")) == (SPRINT, layout))
    tab.open()
    tab.upload(tmp_path / "scene.toml", tmp_path / "layout.json")
    tab.wait(lambda: "opened" in tab.text("message"))
    assert tab.layout == layout
    assert tab.run("return domino.state.draft.score") == score
    uniform = de.Layout.uniform(25, spacing=0.012)
    uniform.to_csv(tmp_path / "other.csv")
    tab.upload(tmp_path / "other.csv")
    tab.wait(lambda: tab.text("message") == "opened other.csv")
    assert tab.layout == uniform
    assert tab.text("title") == "your own scene"


BAD = {
    "row.csv": b"spacing_mm,thickness_mm\n18,5,7.5\n,7.5\n",
    "words.csv": b"hello",
    "no-gap.csv": b"spacing_mm,thickness_mm\n18,7.5\n,7.5\n,7.5\n",
    "text.csv": b"spacing_mm;thickness_mm\n18;seven\n;7,5\n",
    "empty.csv": b"",
    "negative.csv": b"spacing,thickness\n-0.01,0.0075\n,0.0075\n",
    "row.json": b'{"spacing": [0.01], "thicknes": 0.008}',
    "zero.json": b'{"spacing": [0.01, 0], "thickness": 0.008}',
    "mine.toml": b"objective = 3",
    "latin.toml": b"title = '\xe9'",
    "key.toml": b"[row]\ncount = 40\nhight = 0.05\n[spacing]\nmin = 0.002\nmax = 0.04",
    "one.toml": b"[row]\ncount = 1\n[spacing]\nmin = 0.002\nmax = 0.04\n[thickness]\nfixed = 0.007",
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_has_the_message_of_the_commands(tab: Tab, name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(BAD[name])
    before = tab.layout
    with pytest.raises(ValueError, match=name) as error:
        pages.read_source(path)
    tab.run("document.getElementById('message').textContent = ''")
    tab.upload(path)
    tab.wait(lambda: tab.text("message"))
    expected = str(error.value).replace(f"{tmp_path}/", "").replace(": row.", ": ")
    assert tab.text("message") == expected
    assert tab.layout == before


def test_other_files_and_damaged_links_are_rejected(tab: Tab, tmp_path: Path) -> None:
    (tmp_path / "x.txt").write_text("")
    tab.upload(tmp_path / "x.txt")
    tab.wait(lambda: "x.txt: give a layout (.csv or .json)" in tab.text("message"))
    tab.open("#design=AAAA")
    assert "copy the whole link" in tab.text("message")
    tab.open("#scene=spint")
    assert "scene = spint: choose one of course" in tab.text("message")


def test_links_of_python_and_of_the_gallery_open(tab: Tab, size: str) -> None:
    scene = SPRINT.replace(count=20, spacing=(0.002, 0.06), name="own")
    layout = scene.layout(np.where(np.arange(19) == 10, 0.055, 0.014))
    tab.open("#" + make_link(scene, layout))
    assert tab.layout == layout
    assert "stops at domino 10" in tab.result
    tab.click("repair")
    tab.wait(lambda: "m/s" in tab.result)
    tab.click("check")
    tab.wait(lambda: "Yes. Placed to ±0.5 mm, 256 of 256 rows fall" in tab.text("message"))
    assert "20 of 20 dominoes fall" in tab.text("message")
    tab.run("document.getElementById('scenes').open = true")
    tab.wait(lambda: tab.run("return document.querySelectorAll('.gallery path').length") == SCENES)
    tab.run("document.querySelector('a[href=\"#scene=hills\"]').click()")
    tab.wait(lambda: tab.text("title") == de.load_scene("hills").title)
    hills = de.load_scene("hills").uniform().layout
    assert tab.layout.spacing == pytest.approx(hills.spacing)
    assert tab.layout.rise == pytest.approx(hills.rise, abs=1e-12)
    assert tab.run("return document.documentElement.scrollWidth <= innerWidth")


def test_settings_change_the_scene_and_keep_the_best_equal_gaps(tab: Tab) -> None:
    tab.open("#scene=sprint")
    tab.setting("Number of dominoes", 42)
    tab.wait(lambda: tab.layout.count == 42 and "as fast as the best" in tab.result)
    scene = SPRINT.replace(count=42)
    assert tab.layout.spacing[0] == pytest.approx(scene.uniform().layout.spacing[0], abs=2e-6)
    tab.setting("Slope [°], positive downhill", 14)
    tab.wait(lambda: "tips over by itself" in tab.text("message"))
    assert tab.run("return domino.state.draft.scene.document.ground ?? null") is None
    tab.drag("gap", 3, (0, -20))
    tab.setting("Height [mm]", 60)
    tab.wait(lambda: tab.layout.height[0] == 0.06)
    assert tab.layout.spacing[3] > tab.layout.spacing[5] + 0.002  # the shape is kept


def test_a_released_start_is_a_checkbox(tab: Tab) -> None:
    tab.open("#scene=sprint")
    tab.setting("Push of the first domino [rad/s]", 7)
    pushed = "return domino.state.draft.wave.physics.push"
    for value, push in (("released", RELEASED), (7.0, 7.0)):
        tab.tick("released, not pushed")
        tab.wait(lambda push=push: tab.run(pushed) == pytest.approx(push, rel=1e-12))
        assert tab.run("return domino.state.draft.scene.document.physics.push") == value
        hidden = tab.run(f"return {CONTROL}.hidden", "Push of the first domino [rad/s]")
        assert hidden == (value == "released")
    tab.open("#scene=course-released")  # its document has the number
    tab.setting("Thickness [mm]", 10)
    expected = released_push(0.048, 0.01, 9.81)
    tab.wait(lambda: tab.run(pushed) == pytest.approx(expected, rel=1e-12))
    assert tab.text("message") == ""


def test_a_setting_that_is_computed_is_not_lost_to_a_search(tab: Tab) -> None:
    tab.open("#scene=course")
    tab.setting("Number of dominoes", 50)  # at once followed by
    tab.click("faster")
    tab.wait(lambda: tab.text("faster") == "Stop" or "best row found" in tab.text("message"))
    assert tab.layout.count == 50
    tab.click("undo")
    tab.setting("Number of dominoes", 55)
    tab.click("undo")  # drops a setting that is computed
    time.sleep(0.5)
    assert tab.layout.count != 55
    tab._send("mouseMoved", *tab.place("gap", tab.layout.count - 2))  # a point that is soon gone
    tab.setting("Number of dominoes", 30)
    tab.wait(lambda: tab.layout.count == 30 and "as fast as the best" in tab.result)


def test_the_console_agrees_with_python(tab: Tab) -> None:
    tab.open()
    spacing = np.random.default_rng(1).uniform(0.006, 0.02, 29)
    wave = de.simulate(de.Layout(spacing, 0.0075), de.Physics(push=8.0))
    found = tab.run(
        "return domino.simulate({spacing: arguments[0], thickness: 0.0075, push: 8})",
        spacing.tolist(),
    )
    assert found["outcome"] == "PROPAGATED"
    assert found["arrivalTimes"] == pytest.approx(wave.arrival_times, rel=1e-12)
    assert found["meanSpeed"] == pytest.approx(wave.mean_speed, rel=1e-12)
    found = tab.window.execute_async_script(
        "domino.search('sprint', {seconds: 0.5, seed: 0}).then(arguments[0])"
    )
    score = SPRINT.score(SPRINT.layout(found["spacing"]))
    assert found["score"] == pytest.approx(score, rel=1e-6)
    assert found["gain"] > 0.01
    tab.run("return domino.open(arguments[0])", layout_document(de.Layout(spacing, 0.0075)))
    assert tab.layout == de.Layout(spacing, 0.0075)


def test_a_recording_of_the_row_gives_its_friction_and_push(tab: Tab, tmp_path: Path) -> None:
    tab.open("#scene=sprint")
    wave = de.simulate(FIRST, de.Physics(friction=0.19, push=7.0))
    write_wav(0.3 * record(wave.arrival_times, 1), tmp_path / "own.wav")
    (tmp_path / "broken.wav").write_bytes(b"RIFF")
    files = "\n".join(str(tmp_path / name) for name in ("broken.wav", "own.wav"))
    tab.window.find_element("id", "recordings").send_keys(files)
    tab.wait(lambda: "the model explains the hits" in tab.text("measured"))
    assert "broken.wav: this browser finds no sound in it" in tab.text("measured")
    tab.run("document.querySelector('#measured button').click()")
    physics = tab.run("return domino.state.draft.scene.document.physics")
    assert physics["friction"] == pytest.approx(0.19, abs=0.002)
    assert physics["push"] == pytest.approx(7.0, abs=1.0)
    assert tab.layout.spacing == pytest.approx(FIRST.spacing)
