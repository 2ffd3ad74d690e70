"""Page: row, result, curves and settings of a draft, for one tab of a browser."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import lru_cache, partial
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import panel as pn
from bokeh.models import Range1d

from domino_env.physics.motion import Motion, outlines
from domino_env.rigid.simulation import simulate_standing
from domino_env.scenes.io.reading import load_scene, scene_names
from domino_env.scenes.placement import placement_noise
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import UniformBaseline
from optimize.interactive.draft import NAMED, SPACING, THICKNESS, Draft, known_best
from optimize.interactive.exchange import FILES, make_file, make_link, read_files
from optimize.interactive.figures import MM, TITLES, Curve
from optimize.interactive.jobs import Found, SearchProcess
from optimize.interactive.row import Row
from optimize.searching import with_baseline

MAX_LINK_LENGTH = 30_000  # characters that servers and browsers accept in an address
FLOOR_SECONDS = 60.0  # [s] for the uniform baseline on a floor
PLACED, FLOOR = 0.0005, 0.5  # [m], friction with which `Will it work?` is answered
LIKELY = 0.95  # fraction of rows, or of dominoes, that has to fall for "Probably"
DRAWN = 100  # dominoes in a picture of the gallery
WIDE = {"sizing_mode": "stretch_width"}
STYLE = Path(__file__).with_name("page.css").read_text("utf-8")
UNIFORM, BEST, KEPT = "best equal gaps", "best known row", "kept row"

Schedule = Callable[[Callable[[], object]], object]
"""Function that schedules another one in the thread of the page."""


class Control(NamedTuple):
    """Control of a number in the tables of a scene's file.

    Attributes
    ----------
    label
        Label on the page, with the unit.
    table, key
        Place of the number. The control is hidden in scenes that do not have it.
    unit
        Value on the page over that in the table.
    step
        Step of the widget; an integer for integers.
    is_optional
        True if 0 on the page stands for no such key.
    """

    label: str
    table: str
    key: str
    unit: float = MM
    step: float = 0.1
    is_optional: bool = False

    def read(self, scene: Scene) -> float | None:
        """Return the value on the page; None for a scene that does not have the number."""
        values = scene.document().get(self.table, {})
        value = values.get(self.key, 0.0 if self.is_optional else None)
        # not a length in heights of a domino, nor the slope of a curve
        is_other = bool(values.keys() & {"of", "profile"})
        return None if value is None or is_other else round(self.unit * value, 9)

    def change(self, draft: Draft, value: float) -> Draft:
        """Return the draft with the scene that has this value on the page."""
        document = draft.scene.document()
        values = document.get(self.table, {})
        values[self.key] = value / self.unit if self.unit != 1 else value
        if self.is_optional and not value:
            del values[self.key]
        if self.key == "fixed":  # thickness, also of the first domino
            del document["row"]["first_thickness"]
        document |= {self.table: values or None} | NAMED
        return draft.with_scene(Scene.from_document(document))


CONTROLS = {
    "Dominoes": (
        Control("Number of dominoes", "row", "count", 1, 1),
        Control("Height [mm]", "row", "height"),
        Control("Width [mm]", "row", "width"),
        Control("Thickness [mm]", "thickness", "fixed"),
    ),
    "Ground, floor and friction": (
        Control("Push of the first domino [rad/s]", "physics", "push", 1),
        Control("Friction between dominoes", "physics", "friction", 1, 0.01),
        Control("Slope [°], positive downhill", "ground", "slope", 1, is_optional=True),
        Control("Floor friction (0: fixed pivots)", "physics", "floor_friction", 1, 0.05, True),
    ),
    "Rules": (
        Control("Smallest gap [mm]", "spacing", "min"),
        Control("Largest gap [mm]", "spacing", "max"),
        Control("Smallest thickness [mm]", "thickness", "min"),
        Control("Largest thickness [mm]", "thickness", "max"),
        Control("Length [mm] (0: any)", "row", "length", is_optional=True),
        Control("Dominoes of the run-out", "run_out", "count", 1, 1),
        Control("Gaps of the run-out [mm]", "run_out", "spacing"),
        Control("Placement noise [mm]", "placement", "deviation", step=0.01),
    ),
}
"""Controls of the scene, by the title of their group."""


class Page:
    """Contents of one tab of a browser.

    Parameters
    ----------
    draft
        The first draft.
    schedule
        Function that schedules another one in the thread of the page.

    Attributes
    ----------
    draft
        The draft that is shown; during a drag or a search it is not yet in the history.
    view
        Panel object of the page; its row, curves and widgets are the other public attributes.
    """

    def __init__(self, draft: Draft, schedule: Schedule) -> None:
        self.draft, self._schedule = draft, schedule
        self._steps, self._position = [draft], 0  # the history, and the step that is shown
        self._pending: dict[Callable[..., object], Any] = {}  # arguments of scheduled calls
        self._process: SearchProcess | None = None
        self._is_searching = False
        self._scene: Scene | None = None  # the last one with a computed uniform baseline
        self._lock = threading.Lock()  # one baseline is computed at a time
        self._kept: Draft | None = None
        self._pushed: Draft | None = None  # the last one
        self.row, self._range = Row(margin=0, **WIDE), Range1d(-1.0, 1.0)
        self.curves = {quantity: Curve(self._range, quantity) for quantity in TITLES}
        for quantity in (SPACING, THICKNESS):
            drag = partial(self._do_newest, self.preview, Draft.with_size, quantity)
            self.curves[quantity].enable_drag(drag, partial(self._do, self._commit))
        self.view = self._make_view()
        self._settle()

    def _make_view(self) -> Any:
        """Return the page: scenes, row, result and actions, curves, settings."""

        def line(*parts: Any) -> Any:
            return pn.FlexBox(*parts, align_items="center", gap="8px", margin=(3, 10), **WIDE)

        def card(title: str, *parts: Any) -> Any:
            return pn.Card(pn.FlexBox(*parts), title=title, collapsed=True, margin=2, **WIDE)

        def html(text: str = "") -> Any:
            return pn.pane.HTML(text, stylesheets=[STYLE], **WIDE)

        def button(name: str, action: Callable[..., object], *values: Any, **style: Any) -> Any:
            widget = pn.widgets.Button(name=name, margin=0, **style)
            widget.on_click(lambda _: self._do(action, *values))
            return widget

        def receive(message: Any) -> None:
            name, *values = message.data
            if name == "drag":
                self._do_newest(self.preview, Draft.with_shift, *values)
            else:
                self._do(actions[name], *values)

        def change(control: Control, event: Any) -> None:
            if event.new not in (None, control.read(self.draft.scene)):
                self._do(self._edit, control.change, event.new)

        def toggle(_: Any) -> None:
            if self._is_searching:
                self._do(self.notify, "stopped; this is the best so far")
            else:
                self._do(self._search)

        actions: dict[str, Callable[..., object]] = {
            "push": self._push,
            "commit": self._commit,
            "insert": partial(self._edit, Draft.with_domino),
            "remove": partial(self._edit, Draft.without_domino),
            "touch": self._use_touch,
        }
        self.row.on_msg(receive)
        self.title, self.result, self.message, self.link = html(), html(), html(), html()
        self.compare = pn.widgets.Select(name="", options=[UNIFORM], width=150, margin=0)
        self.compare.param.watch(lambda _: self._schedule(self._draw), "value")
        pace = pn.widgets.Select.from_param(self.row.param.pace, name="", width=110, margin=0)
        sound = pn.widgets.Checkbox.from_param(self.row.param.sound, name="sound", margin=0)
        self.faster = pn.widgets.Button(
            button_type="primary", width=200, height=48, margin=0,
            stylesheets=["button { font-size: 18px !important }"],
        )  # fmt: skip
        self.faster.on_click(toggle)
        self.repair = button("Repair the gap where it stops", self._edit, Draft.repaired)
        self.undo, self.redo = button("Undo", self._move, -1), button("Redo", self._move, 1)
        upload = pn.widgets.FileInput(accept=".csv,.json,.toml", multiple=True, **WIDE)
        upload.param.watch(lambda e: self._do(self._open, upload.filename, e.new), "value")
        self.controls, groups = {}, []
        for title, controls in CONTROLS.items():
            for control in controls:
                kind = pn.widgets.IntInput if control.step == 1 else pn.widgets.FloatInput
                widget = self.controls[control] = kind(
                    name=control.label, step=control.step, width=210
                )
                widget.param.watch(partial(change, control), "value")
            groups.append(card(title, *(self.controls[c] for c in controls)))
        downloads = [
            pn.widgets.FileDownload(
                filename=name, label=label, callback=partial(self._make_file, name)
            ) for name, (label, _) in FILES.items()
        ]  # fmt: skip
        hint = "Open a layout (.csv, .json), a scene (.toml), or one of each:"
        return pn.Column(
            card("Scenes and files", html(gallery()), hint, upload),
            self.title, self.row, self.result,
            line(self.faster, self.undo, self.redo,
                 button("Equal gaps", self._edit, self._make_uniform), self.repair,
                 button("Will it work?", self._check),
                 button("Search thoroughly", self._search, True)),
            line("Race against", self.compare, button("Keep this row", self._keep), pace, sound),
            self.message, *(curve.figure for curve in self.curves.values()),
            card("Print and save", *downloads, self.link), *groups, **WIDE,
        )  # fmt: skip

    def _use_touch(self) -> None:
        """Let a swipe over a curve only scroll the page; gaps then follow dominoes."""
        for curve in self.curves.values():
            curve.follows_pointer = False

    # calls --------------------------------------------------------------------------------------

    def _do(self, action: Callable[..., object], *values: Any) -> None:
        """Schedule an action, which then has the lock of the document."""
        self._schedule(partial(self._call, action, *values))

    def _do_newest(self, action: Callable[..., object], *values: Any) -> None:
        """Schedule an action; newer values replace those of a scheduled one."""
        self._pending[action] = values

        def call() -> None:
            if action in self._pending:
                self._call(action, *self._pending.pop(action))

        self._schedule(call)

    def _call(self, action: Callable[..., object], *values: Any) -> None:
        """End a search, call a function, and show the message of its error, if any."""
        try:
            self._end_search()
            action(*values)
        except (ValueError, ArithmeticError) as error:
            self._settle()
            self.notify(str(error).replace("row.", ""), "error")  # the table of a scene's file

    def _in_thread(self, work: Callable[[], Callable[[], object]]) -> None:
        """Run `work` in a thread, and what it returns, or the message of its error, in the page."""

        def run() -> None:
            try:
                reply = work()
            except (ValueError, ArithmeticError) as error:
                reply = partial(self.notify, str(error), "error")
            self._schedule(reply)

        threading.Thread(target=run, daemon=True).start()

    def notify(self, text: str, kind: str = "") -> None:
        """Show a message.

        Parameters
        ----------
        text
            The message; empty to remove the last one.
        kind
            "error" for the colour of errors.
        """
        self.message.object = f'<p role="status" class="message {kind}">{escape(text)}</p>'

    # from the draft to the page -----------------------------------------------------------------

    def _draw(self) -> None:
        """Draw the draft: row, result and curves; a row that was pushed goes on falling."""
        draft, uniform, name = self.draft, self._uniform, self.compare.value
        scene, is_step = draft.scene, draft is self._steps[self._position]
        other = {UNIFORM: uniform, BEST: known_best(scene), KEPT: self._kept}[name]
        moves = draft is self._pushed
        self.row.show(draft, other, name, moves=moves, keep_scale=not is_step)
        extent = self.row.state["extent"]
        self._range.update(start=extent["low"], end=extent["high"])
        schedule = scene.tempo.schedule(scene.count) if scene.tempo else None
        for curve in self.curves.values():
            curve.draw((draft, other), schedule)
        number, sentence = draft.headline(uniform)
        self.result.object = (
            f'<p class="number"><b>{escape(number)}</b> {escape(sentence)}</p>'
            f'<p class="details">{escape(draft.details(uniform))}</p>'
        )
        self.repair.visible = draft.stop is not None

    def _settle(self) -> None:
        """Show the present step of the history; slow computations run in threads."""
        self.notify("")
        draft = self.draft = self._steps[self._position]
        scene = draft.scene
        self.title.object = f"<h1>{escape(str(scene.title))}</h1>"
        for control, widget in self.controls.items():
            value = control.read(scene)
            widget.visible, widget.value = value is not None, value
        scale = MM * (float(draft.layout.height.max()) if scene.in_heights else 1.0)
        for quantity, free in ((SPACING, scene.free_spacing), (THICKNESS, scene.free_thickness)):
            self.curves[quantity].figure.visible = free
            self.curves[quantity].fit(*(scale * bound for bound in getattr(scene, quantity)))
        link = make_link(draft)
        self.row.address = link if len(link) < MAX_LINK_LENGTH else "?"
        self.link.object = f'<a href="{link}" target="_blank">Link to this row</a>'
        if self.row.address == "?":
            self.link.object = "The row is too long for a link: save layout and scene."
        self.undo.disabled = self._position == 0
        self.redo.disabled = self._position == len(self._steps) - 1
        is_kept = self._kept is not None and self._kept.scene.ground == scene.ground
        has = {UNIFORM: True, BEST: known_best(scene) is not None, KEPT: is_kept}
        self.compare.options = [name for name in has if has[name]]
        self.faster.name = "Make it faster"
        if self._uniform is None or not draft.is_scored:
            self._in_thread(partial(self._complete, draft))
        self._draw()

    def _complete(self, draft: Draft) -> Callable[[], None]:
        """Compute score and uniform baseline of a draft, unless another one is shown by now."""
        with self._lock:
            if draft is self.draft:
                assert draft.score is not None  # which the draft keeps
                self._scene = with_baseline(draft.scene, FLOOR_SECONDS)
        return self._draw

    @property
    def _uniform(self) -> UniformBaseline | None:
        """Uniform baseline of the present scene; None if it is not computed yet."""
        scene = self._scene
        return scene.uniform() if scene and scene == self.draft.scene else None

    # from the page to the draft -----------------------------------------------------------------

    def preview(self, change: Callable[..., Draft], *values: Any) -> None:
        """Show the present step of the history with a change, such as `Draft.with_size`."""
        self.draft = change(self._steps[self._position], *values)
        self._draw()

    def _edit(self, change: Callable[..., Draft], *values: Any) -> None:
        """Change the draft, as a step of the history."""
        self.draft = change(self.draft, *values)
        self._commit()

    def _push(self) -> None:
        """Let the row fall."""
        self._pushed = self.draft
        self._draw()

    def _make_uniform(self, draft: Draft) -> Draft:
        """Return the best equal gaps, or those on fixed pivots while the best are computed."""
        known = self._uniform
        return Draft(draft.scene, known.layout) if known else Draft.uniform(draft.scene)

    def _commit(self) -> None:
        """Add the draft to the history, unless nothing has changed."""
        if self.draft != self._steps[self._position]:
            self._position += 1
            self._steps[self._position :] = [self.draft]
        self._settle()

    def _move(self, steps: int) -> None:
        """Show another step of the history."""
        self._position = min(max(self._position + steps, 0), len(self._steps) - 1)
        self._settle()

    def _keep(self) -> None:
        """Keep the layout as a row to race against."""
        self._kept = self.draft
        self._settle()
        self.compare.value = KEPT

    def _open(self, names: list[str], data: list[bytes] | None) -> None:
        """Open uploaded files; None: the upload was reset."""
        if data:
            files = dict(zip(names, data, strict=True))
            self._edit(lambda draft: read_files(files, draft.scene))
            self.notify(f"opened {', '.join(names)}")

    def _make_file(self, name: str) -> Any:
        """Return a file of the draft to download; empty after an error, which is shown."""
        try:
            return make_file(self.draft, name)
        except ValueError as error:
            self.notify(str(error), "error")
            return BytesIO()

    # in the background --------------------------------------------------------------------------

    def open(self) -> None:
        """Start the process of searches."""
        self._process = self._process or SearchProcess()

    def close(self) -> None:
        """End the process of searches."""
        if self._process:
            self._process.close()
            self._process = None

    def _end_search(self) -> None:
        """End a running search, and add what it has found to the history."""
        if self._is_searching:
            self.close()
            self.open()
            self._is_searching = False
            self._commit()

    def _search(self, thorough: bool = False) -> None:
        """Search, and show layouts that are better than the present one."""
        self.open()
        first, process = self.draft, self._process
        scene = (self._scene if self._uniform else None) or first.scene  # with its baseline
        self._is_searching, self.faster.name = True, "Stop"
        self.notify("searching …")

        def show(found: Found) -> None:
            if process is not self._process:  # the search was ended
                return
            is_better = found.layout is not None and found.score > first.score
            if found.layout is not None:
                self.draft = Draft(first.scene, found.layout) if is_better else first
            if found.is_done:
                self._end_search()
                is_new = is_better or found.layout is None
                self.notify(found.text if is_new else f"no better row was found; {found.text}")
            else:
                self._draw()
                self.notify(f"searching: {found.text} …")

        def work() -> Callable[[], None]:
            assert process is not None
            assert first.score is not None  # computed here, as it takes a second on a floor
            for found in process.run(scene, thorough=thorough):
                self._schedule(partial(show, found))
            return self._draw

        self._in_thread(work)

    def _check(self) -> None:
        """Simulate placement noise and a floor in a thread, and show the verdict."""
        draft, scene = self.draft, self.draft.scene
        floor = scene.floor_friction or FLOOR
        self.notify("placing the row 256 times, and letting it fall on a floor …")

        def work() -> Callable[[], None]:
            noise = placement_noise(draft.wave, scene.ground, PLACED)
            rigid = simulate_standing(draft.wave.layout, draft.wave.physics, floor)
            count, share = rigid.layout.count, noise["completes"]
            least = min(share, rigid.toppled / count)
            answer = "Yes" if least == 1.0 else "Probably" if least > LIKELY else "No"
            text = (
                f"{answer}. Placed to ±{MM * PLACED:g} mm, {share:.0%} of {noise['draws']} rows "
                f"fall to the end. On a floor of friction {floor:g}, {rigid.toppled} of {count} "
                "dominoes fall"
            )
            text += f", at {rigid.mean_speed:.3f} m/s." if rigid.mean_speed else "."
            return partial(self.notify, text if self.draft is draft else "")

        self._in_thread(work)


@lru_cache(1)
def gallery() -> str:
    """Return pictures of the shipped scenes, each a link that opens it."""
    entries = []
    for name in scene_names():
        scene = load_scene(name)
        wave = (known_best(scene) or Draft.uniform(scene)).wave
        last = min(wave.hit, DRAWN) - 1
        leans = Motion(wave.layout, scene.physics).angles([0.5 * wave.arrival_times[last]])[0]
        corners = MM * outlines(wave.layout, leans)[:DRAWN]
        path = "".join(f"M{' '.join(f'{x:.0f},{-z:.0f}' for x, z in four)}z" for four in corners)
        (left, low), (right, high) = corners.min((0, 1)), corners.max((0, 1))
        box = f"{left:.0f} {-high:.0f} {right - left:.0f} {high - low:.0f}"
        entries.append(
            f'<a href="?scene={name}"><svg viewBox="{box}"><path d="{path}"/></svg>'
            f"<b>{name}</b> {escape(str(scene.title))}</a>"
        )
    return f'<div class="gallery">{"".join(entries)}</div>'
