"""Page: row, result, curves and settings of a design, for one tab of a browser."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import lru_cache, partial
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import panel as pn
from bokeh.models import Range1d

from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.motion import Motion, outlines
from domino_env.rigid.simulation import simulate_standing
from domino_env.scenes.io.reading import load_scene, scene_names
from domino_env.scenes.placement import placement_noise
from domino_env.scenes.run_out import RunOut
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import UniformBaseline
from optimize.experiments.best_known import best_known
from optimize.interactive.design import NAME, SPACING, THICKNESS, Design, known_best
from optimize.interactive.exchange import exports, make_file, make_link, receive
from optimize.interactive.figures import MM, SPEED, TITLES, Curve
from optimize.interactive.jobs import Result, SearchProcess
from optimize.interactive.row import Row
from optimize.searching import with_baseline

MAX_LINK_LENGTH = 30_000  # characters that servers and browsers accept in an address
FLOOR_SECONDS = 60.0  # [s] for the uniform baseline on a floor
UNIFORM_DELAY = 0.3  # [s] without a change of the scene before its uniform baseline is computed
PLACED, FLOOR = 0.0005, 0.5  # [m], friction with which `Will it work?` is answered
REACTION = 0.7  # [s] after the end of a search in which a click on its button does nothing
LIKELY = 0.95  # fraction of rows, or of dominoes, that has to fall for "Probably"
DRAWN = 100  # dominoes in a picture of the gallery
WIDE = {"sizing_mode": "stretch_width"}
STYLE = Path(__file__).with_name("page.css").read_text("utf-8")
UNIFORM, BEST, KEPT, ALONE = "best equal gaps", "best known row", "kept row", "no other row"
FASTER, STOP, THOROUGH = "Make it faster", "Stop", "Search thoroughly"
LINK = "Link to this row"
WORDS = {  # of the page, for words of scene files in messages
    f"scene '{NAME}'": "this scene", "row.length": "a length", "row.count": "a number of dominoes",
}  # fmt: skip

Schedule = Callable[[Callable[[], None]], object]
"""Function that schedules another one in the thread of the page."""


class Control(NamedTuple):
    """Control of a number of the scene, or of a pair of bounds.

    Attributes
    ----------
    group
        Title of its group.
    label
        Label on the page, with the unit.
    low, high
        Range of the widget, widened to values outside of it.
    step
        Step of the widget.
    read
        Function that returns the value in a scene, or None if the scene has no such number.
    fields
        Function that returns the new fields of a scene for a new value.
    kind
        Class of the widget.
    """

    group: str
    label: str
    low: float
    high: float
    step: float
    read: Callable[[Scene], Any]
    fields: Callable[[Scene, Any], dict[str, Any]]
    kind: Any = pn.widgets.EditableFloatSlider


def _bounds(quantity: str) -> tuple[Callable[[Scene], Any], Callable[[Scene, Any], dict[str, Any]]]:
    """Return `read` and `fields` of a control for the bounds of gaps or thicknesses [mm]."""

    def read(scene: Scene) -> Any:
        free = getattr(scene, f"free_{quantity}") and not (quantity == THICKNESS and scene.stock)
        low, high = getattr(scene, quantity)
        return (_mm(low), _mm(high)) if free and not scene.in_heights else None

    return read, lambda _, v: {quantity: (v[0] / MM, v[1] / MM), f"{quantity}_values": None}


def _mm(value: float) -> float:
    """Return a length [m] in millimetres, without the rounding error of the conversion."""
    return round(MM * value, 9)


def _one_thickness(scene: Scene) -> float | None:
    """Return the thickness of all dominoes [mm]; None if they may differ."""
    varies = scene.free_thickness or scene.stock or scene.in_heights
    return None if varies else _mm(scene.thickness[0])


def _run_out_count(scene: Scene) -> int | None:
    """Return the number of dominoes of the run-out; None if the scene cannot have one."""
    if scene.stock or scene.growth or scene.tempo:
        return None
    return scene.run_out.count if scene.run_out else 0


def _change_run_out(scene: Scene, count: float) -> dict[str, Any]:
    """Return the change of the scene to a run-out of `count` dominoes, first at a middle gap."""
    spacing = scene.run_out.spacing if scene.run_out else 0.2 * scene.height
    return {"run_out": RunOut(int(count), spacing) if count else None}


DOMINOES, PLACE, RULES = "Dominoes", "Ground, floor and friction", "Rules"
INTEGER, RANGE = pn.widgets.EditableIntSlider, pn.widgets.EditableRangeSlider
CONTROLS = (
    Control(DOMINOES, "Number of dominoes", 2, 200, 1, lambda s: None if s.stock else s.count,
            lambda _, v: {"count": int(v)}, INTEGER),
    Control(DOMINOES, "Height [mm]", 5, 200, 0.1,
            lambda s: _mm(s.height), lambda _, v: {"height": v / MM}),
    Control(DOMINOES, "Width [mm]", 5, 200, 0.1,
            lambda s: _mm(s.width), lambda _, v: {"width": v / MM}),
    Control(DOMINOES, "Thickness [mm]", 1, 50, 0.1, _one_thickness,
            lambda _, v: {THICKNESS: (v / MM, v / MM), "first_thickness": v / MM}),
    Control(PLACE, "Push of the first domino [rad/s]", 0.1, 40, 0.1, lambda s: s.physics.push,
            lambda s, v: {"physics": s.physics.replace(push=v)}),
    Control(PLACE, "Friction between dominoes", 0, 1, 0.01, lambda s: s.physics.friction,
            lambda s, v: {"physics": s.physics.replace(friction=v)}),
    Control(PLACE, "Slope [°], positive downhill", -15, 15, 0.1,
            lambda s: s.ground.slope if s.ground else 0.0,
            lambda _, v: {"ground": Ground(slope=v) if v else None}),
    Control(PLACE, "Floor friction (0: fixed pivots)", 0, 1.5, 0.05,
            lambda s: s.floor_friction or 0, lambda _, v: {"floor_friction": v or None}),
    Control(RULES, "Allowed gaps [mm]", 0.5, 100, 0.1, *_bounds(SPACING), RANGE),
    Control(RULES, "Allowed thicknesses [mm]", 1, 50, 0.1, *_bounds(THICKNESS), RANGE),
    Control(RULES, "Length [mm] (0: any)", 0, 5000, 0.5,
            lambda s: _mm(s.length or 0), lambda _, v: {"length": v / MM or None}),
    Control(RULES, "Dominoes of the run-out (0: none)", 0, 200, 1, _run_out_count,
            _change_run_out, INTEGER),
    Control(RULES, "Gaps of the run-out [mm]", 0.5, 100, 0.1,
            lambda s: _mm(s.run_out.spacing) if s.run_out else None,
            lambda s, v: {"run_out": s.run_out and s.run_out.replace(spacing=v / MM)}),
    Control(RULES, "Placement noise [mm]", 0.01, 5, 0.01,
            lambda s: _mm(s.placement.deviation) if s.placement else None,
            lambda s, v: {"placement": s.placement and s.placement.replace(deviation=v / MM)}),
)  # fmt: skip


class Page:
    """Contents of one tab of a browser.

    Parameters
    ----------
    design
        The first design.
    schedule
        Function that schedules another one in the thread of the page.

    Attributes
    ----------
    design
        The design that is shown; during a drag or a search it is not yet in the history.
    view
        Panel object of the page; its row, curves and widgets are the other public attributes.
    """

    def __init__(self, design: Design, schedule: Schedule) -> None:
        self.design, self._schedule = design, schedule
        self._steps, self._position = [design], 0  # the history, and the step that is shown
        self._pending: dict[Callable[..., None], Any] = {}  # arguments of scheduled calls
        self.process = SearchProcess()
        self._search: object | None = None  # identity of the running search
        self._ended = 0.0  # [s] clock at the end of the last search; 0 before the first
        self._last_control: Control | None = None  # its next change replaces its last one
        self._uniform: UniformBaseline | None = None  # of the scene below; None: not computed yet
        self._uniform_scene: Scene | None = None
        self._uniform_lock = threading.Lock()  # one baseline is computed at a time
        self._kept: Design | None = None
        self._has_touch = False
        self.row, self._range = Row(margin=0, **WIDE), Range1d(-1.0, 1.0)
        self.curves = {quantity: Curve(self._range, quantity) for quantity in TITLES}
        for quantity in (SPACING, THICKNESS):
            self._enable_drag(quantity)
        self.view = self._make_view()
        self._settle()

    def _make_view(self) -> Any:
        """Return the page: scenes, row, result and actions, curves, settings."""

        def line(*parts: Any) -> Any:
            return pn.FlexBox(*parts, align_items="center", gap="8px", margin=(3, 10), **WIDE)

        def card(title: Any, *parts: Any, **style: Any) -> Any:
            return pn.Card(
                *parts, title=title, collapsed=True, hide_header=False, margin=2, **style
            )

        def connect(widget: Any, handler: Callable[[Any], None]) -> Any:
            widget.param.watch(lambda event: self._call_newest(handler, event.new), "value")
            return widget

        def button(name: str, action: Callable[..., Any], *values: Any, **style: Any) -> Any:
            widget = pn.widgets.Button(name=name, margin=0, **style)
            widget.on_click(lambda _: self._schedule(lambda: self._call(action, *values)))
            return widget

        def do(message: Any) -> None:
            actions: dict[str, Callable[..., None]] = {
                "drop": self._commit, "stop": self._commit,
                "insert": lambda gap: self._edit(lambda: self.design.with_domino(gap)),
                "remove": lambda index: self._edit(lambda: self.design.without_domino(index)),
                "undo": self._move, "touch": self._use_touch,
            }  # fmt: skip
            name, *values = message.data
            if name == "drag":
                self._call_newest(self.drag_domino, *values)
            else:
                self._schedule(lambda: self._call(actions[name], *values))

        self.row.on_msg(do)
        self.title, self.result, self.message = (
            pn.pane.HTML(stylesheets=[STYLE], **WIDE) for _ in range(3)
        )
        self.compare = connect(
            pn.widgets.Select(name="", options=[UNIFORM, ALONE], width=150, margin=0),
            lambda _: self._draw(moves=self._search is None),
        )
        pace = pn.widgets.Select.from_param(self.row.param.pace, name="", width=110, margin=0)
        sound = pn.widgets.Checkbox.from_param(self.row.param.sound, name="sound", margin=0)
        self.faster = button(FASTER, self._search_or_stop, button_type="primary", width=200)
        self.faster.param.update(height=48, stylesheets=["button { font-size: 18px !important }"])
        self.mend = button("Mend the gap where it stops", self._mend, button_type="warning")
        self.thorough = button(THOROUGH, self._start_search, True)
        self.undo, self.redo = button("Undo", self._move, -1), button("Redo", self._move, 1)
        self.equal = button("Equal gaps", self._equal_gaps)
        names = [*exports(self.design), LINK]
        save = pn.widgets.MenuButton(name="Print and save", items=names, width=180, margin=0)
        save.on_click(lambda event: self._schedule(lambda: self._call(self._save, event.new)))
        upload = pn.widgets.FileInput(accept=".csv,.json,.toml", multiple=True, **WIDE)
        connect(upload, lambda data: self._receive(upload.filename, data))
        self.download = pn.widgets.FileDownload(filename="layout", styles={"display": "none"})
        self.controls = {}
        for control in CONTROLS:
            widget = control.kind(
                name=control.label, start=control.low, end=control.high, step=control.step, **WIDE
            )
            self.controls[control] = connect(widget, partial(self._change, control))
        settings = [
            card(title, *(self.controls[c] for c in CONTROLS if c.group == title),
                 styles={"flex": "1 1 300px"}) for title in (DOMINOES, PLACE, RULES)
        ]  # fmt: skip
        scenes = card(
            "Scenes and files", pn.pane.HTML(gallery(), stylesheets=[STYLE], **WIDE),
            "Open a layout (.csv, .json), a scene (.toml), or one of each:", upload, **WIDE,
        )  # fmt: skip
        return pn.Column(
            scenes, self.title, self.row, self.result,
            line(self.faster, self.undo, self.redo, self.equal, self.mend,
                 button("Will it work?", self._check), save, self.thorough),
            line(pn.pane.HTML("Race against", margin=0), self.compare,
                 button("Keep this row", self._keep), pace, sound),
            self.message, *(curve.figure for curve in self.curves.values()),
            pn.FlexBox(*settings, align_items="flex-start", **WIDE), self.download, **WIDE,
        )  # fmt: skip

    def _enable_drag(self, quantity: str) -> None:
        """Make gaps or thicknesses follow the points of their curve that are dragged."""
        points, offset = self.curves[quantity].sources[0], 0.0  # [mm] from the pointer to the point

        def begin(event: Any) -> None:
            nonlocal offset
            if self._has_touch:
                return
            designed = points.data["x"][: self.design.scene.count - 1]  # without the run-out
            nearest = int(np.argmin(np.abs(designed - event.x)))
            offset = points.data["y"][nearest] - event.y
            points.selected.indices = [nearest]

        def move(event: Any) -> None:
            if points.selected.indices:
                index = int(points.data["index"][points.selected.indices[0]])
                self._call_newest(self.drag, quantity, index, max(event.y + offset, 0.0) / MM)

        def end(_: Any) -> None:
            if points.selected.indices:
                points.selected.indices = []
                self._schedule(self._commit)  # after a drag that is scheduled

        self.curves[quantity].enable_drag(begin, move, end)

    def _use_touch(self) -> None:
        """Let a swipe over a curve scroll the page; gaps then follow dominoes only."""
        self._has_touch = True
        for curve in self.curves.values():
            curve.figure.toolbar.active_drag = None

    # calls --------------------------------------------------------------------------------------

    def _call_newest(self, function: Callable[..., None], *values: Any) -> None:
        """Schedule a call with values; newer values replace those of a scheduled call.

        Scheduled calls have the lock of the document, which Panel's watchers may lack.
        """
        self._pending[function] = values

        def call() -> None:
            if function in self._pending:
                self._call(function, *self._pending.pop(function))

        self._schedule(call)

    def _in_thread(
        self,
        work: Callable[[], Any],
        function: Callable[[Any], None],
        is_current: Callable[[], bool] = lambda: True,
    ) -> None:
        """Run `work` in a thread, then call the function with its result in that of the page.

        If `work` raises an error, its message is shown instead. A result that is not current any
        more is dropped.
        """

        def run() -> None:
            try:
                reply = partial(function, work())
            except (ValueError, ArithmeticError) as error:
                reply = partial(self.notify, str(error), "error")
            self._schedule(lambda: reply() if is_current() else None)

        threading.Thread(target=run, daemon=True).start()

    def _call(self, action: Callable[..., Any], *values: Any) -> None:
        """Call a function, and show the message of its error, if any."""
        try:
            action(*values)
        except (ValueError, ArithmeticError) as error:
            message = str(error)
            for key, words in WORDS.items():
                message = message.replace(key, words)
            self._keep_found()
            self._settle()
            self.notify(message, "error")

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

    # from the design to the page ----------------------------------------------------------------

    def _draw(self, *, moves: bool = False) -> None:
        """Draw the design: row, result and curves; with `moves`, the row can be pushed."""
        design, scene = self.design, self.design.scene
        rivals = {UNIFORM: self._uniform, BEST: known_best(scene), KEPT: self._kept}
        chosen = rivals.get(self.compare.value)
        rival = chosen.wave if chosen else None
        waves = design.wave, rival
        low, high = self.row.show(design, rival, self.compare.value, moves=moves)
        self._range.update(start=low, end=high)
        schedule = scene.tempo.schedule(scene.count) if scene.tempo else None
        for quantity, curve in self.curves.items():
            curve.draw(waves, schedule if quantity == SPEED else None)
        number, sentence = design.headline(self._uniform)
        self.result.object = (
            f'<p class="number"><b>{escape(number)}</b> {escape(sentence)}</p>'
            f'<p class="details">{escape(design.details(self._uniform))}</p>'
        )
        self.mend.visible = design.stop is not None

    def _settle(self) -> None:
        """Show the present step of the history; slow computations run in threads."""
        self.notify("")
        design = self.design = self._steps[self._position]
        scene = design.scene
        self.title.object = f"<h1>{escape(str(scene.title))}</h1>"
        for control, widget in self.controls.items():
            value = control.read(scene)
            widget.visible = value is not None
            if value is not None:
                low, high = min(control.low, np.min(value)), max(control.high, np.max(value))
                widget.param.update(start=low, fixed_start=low, end=high, value=value)
        scale = MM * (float(design.layout.height.max()) if scene.in_heights else 1.0)
        for quantity, free in ((SPACING, scene.free_spacing), (THICKNESS, scene.free_thickness)):
            self.curves[quantity].figure.visible = free
            self.curves[quantity].fit(*(scale * bound for bound in getattr(scene, quantity)))
        link = make_link(design)
        self.row.address = link if len(link) < MAX_LINK_LENGTH else "?"
        self.undo.disabled = self._position == 0
        self.redo.disabled = self._position == len(self._steps) - 1
        is_kept = self._kept is not None and self._kept.scene.ground == scene.ground
        has = {UNIFORM: True, BEST: known_best(scene) is not None, KEPT: is_kept, ALONE: True}
        self.compare.options = [name for name in has if has[name]]
        self.faster.name = STOP if self._search else FASTER
        self.thorough.visible = self._ended > 0.0 and not self._search
        if scene != self._uniform_scene:
            self._uniform_scene, self._uniform = scene, None

            def set_uniform(based: Scene) -> None:
                self._uniform_scene, self._uniform = based, based.uniform()
                self._draw(moves=self._search is None)

            self._in_thread(
                lambda: self._compute_uniform(scene), set_uniform,
                lambda: self._uniform_scene == scene,
            )  # fmt: skip
        if not design.is_scored:  # the design keeps its score
            self._in_thread(
                lambda: design.score, lambda _: self._draw(moves=True),
                lambda: self.design is design,
            )  # fmt: skip
        self._draw(moves=True)

    def _compute_uniform(self, scene: Scene) -> Scene:
        """Return the scene with its uniform baseline, unless it changes within `UNIFORM_DELAY`."""
        time.sleep(UNIFORM_DELAY)
        with self._uniform_lock:
            return with_baseline(scene, FLOOR_SECONDS) if scene == self._uniform_scene else scene

    # from the page to the design ----------------------------------------------------------------

    def drag(self, quantity: str, index: int, value: float) -> None:
        """Show the present step with another gap or thickness, see `Design.with_size`."""
        self._keep_found()
        self.design = self._steps[self._position].with_size(quantity, index, value)
        self._draw()

    def drag_domino(self, index: int, shift: float, following: bool = False) -> None:
        """Show the present step with a domino moved, see `Design.with_shift`."""
        self._keep_found()
        design = self._steps[self._position]
        self.design = design.with_shift(index, shift, following=following)
        self._draw()

    def _commit(self) -> None:
        """Add the design to the history, unless nothing has changed, and end a search."""
        self._end_search()
        self._last_control = None
        if self.design != self._steps[self._position]:
            self._position += 1
            self._steps[self._position :] = [self.design]
        self._settle()

    def _edit(self, change: Callable[[], Design]) -> None:
        """Replace the design as a step of the history."""
        self._keep_found()
        self.design = change()
        self._commit()

    def _move(self, steps: int) -> None:
        """Show another step of the history."""
        self._keep_found()
        self._position = min(max(self._position + steps, 0), len(self._steps) - 1)
        self._last_control = None
        self._settle()

    def _change(self, control: Control, value: Any) -> None:
        """Change the scene; consecutive changes by one control are one step of the history."""
        present = control.read(self.design.scene)
        if value is not None and present is not None and value != present:
            self._keep_found()
            is_same = self._last_control is control
            before = self._steps[self._position - is_same]
            design = before.with_scene(**control.fields(before.scene, value))
            self._position -= is_same
            del self._steps[self._position + 1 :]
            self._edit(lambda: design)
            self._last_control = control if self._steps[self._position] is design else None

    def _equal_gaps(self) -> None:
        """Change the layout to the uniform baseline."""
        if self._uniform is None:
            raise ValueError("the best equal gaps are still being computed: try again")
        uniform, scene = self._uniform, self.design.scene
        self._edit(lambda: Design(scene, uniform.layout))

    def _mend(self) -> None:
        """Change the gap at which the wave stops to that of the uniform baseline."""
        design, stop = self.design, self.design.stop
        if self._uniform is None or stop is None:
            raise ValueError("the best equal gaps are still being computed: try again")
        gap = min(stop, design.scene.count - 2)
        size = float(self._uniform.layout.spacing[gap])
        self._edit(lambda: design.with_size(SPACING, gap, size))

    def _keep(self) -> None:
        """Keep the layout as a row to race against."""
        self._keep_found()
        self._kept = self.design
        self._settle()
        self.compare.value = KEPT

    def _receive(self, names: list[str], data: list[bytes] | None) -> None:
        """Open uploaded files; None: the upload was reset."""
        if data:
            design, message = receive(self.design, dict(zip(names, data, strict=True)))
            self._edit(lambda: design)
            self.notify(message)

    def _save(self, name: str) -> None:
        """Send a file to the browser, which saves it, or show the link."""
        if name == LINK:
            if self.row.address == "?":
                raise ValueError("the row is too long for a link: save layout and scene")
            self.message.object = (
                f'<p role="status" class="message"><a href="{self.row.address}" target="_blank">'
                "Open the row in another tab</a>: the address contains it, as that of this page</p>"
            )
            return
        ending, write = exports(self.design)[name]
        filename = f"{self.design.scene.name}{ending}"

        def send(data: BytesIO) -> None:
            self.download.param.update(file=data, filename=filename)
            self.download._clicks += 1  # as a click on its hidden button does
            self.notify(f"saved {filename} in the downloads of the browser")

        self._in_thread(lambda: make_file(write, filename), send)

    # in the background --------------------------------------------------------------------------

    def close(self) -> None:
        """End the process of searches."""
        self.process.close()

    def _end_search(self) -> None:
        """Stop a running search; its later results are dropped."""
        if self._search is not None:
            self._search, self._ended = None, time.monotonic()
            self.process.close()
            self.process.start()  # for the next search

    def _keep_found(self) -> None:
        """End a running search, and add what it has found to the history."""
        if self._search is not None:
            self._commit()

    def _search_or_stop(self) -> None:
        """Begin a search, or end the running one."""
        if self._search is not None:
            self._commit()
            self.notify("stopped; this is the best so far")
        elif time.monotonic() > self._ended + REACTION:  # not a click on Stop that came too late
            self._start_search()

    def _start_search(self, thorough: bool = False) -> None:
        """Search, and show layouts that are better than the present one."""
        if self._search is not None:
            return
        first, search = self.design, object()
        self._search = search
        scene = self._uniform_scene or first.scene  # with its baseline, once that is computed
        self.faster.name, self.thorough.visible = STOP, False
        self.notify("searching …")

        def show(layout: Layout, score: float, text: str) -> None:
            if self._search is search:
                self.notify(f"searching: {text} …")
                if score > first.score:
                    self.design = Design(first.scene, layout)
                    self._draw()

        def update(result: Result) -> None:
            layout, score, text = result
            is_better = layout is not None and score > first.score
            if layout is not None:
                self.design = Design(first.scene, layout) if is_better else first
            self._search, self._ended = None, time.monotonic()
            self._commit()
            self.notify(text if is_better or not layout else f"no better row was found; {text}")

        def run() -> Result:
            assert first.score is not None  # computed here, as it takes a second on a floor
            newest = partial(self._call_newest, show)
            return self.process.run(scene, thorough=thorough, show=newest)

        self._in_thread(run, update, lambda: self._search is search)

    def _check(self) -> None:
        """Simulate placement noise and a floor in a thread, and show the verdict."""
        design = self.design
        floor = design.scene.floor_friction or FLOOR
        self.notify("placing the row 256 times, and letting it fall on a floor …")

        def work() -> str:
            noise = placement_noise(design.wave, design.scene.ground, PLACED)
            rigid = simulate_standing(design.wave.layout, design.wave.physics, floor)
            fallen, share = rigid.toppled / rigid.layout.count, noise["completes"]
            least, speed = min(share, fallen), ""
            answer = "Yes" if least == 1.0 else "Probably" if least > LIKELY else "No"
            if rigid.mean_speed > 0.0:
                speed = f", at {rigid.mean_speed:.3f} m/s"
            return (
                f"{answer}. Placed to ±{MM * PLACED:g} mm, {share:.0%} of {noise['draws']} rows "
                f"fall to the end. On a floor of friction {floor:g}, {rigid.toppled} of "
                f"{rigid.layout.count} dominoes fall{speed}."
            )

        self._in_thread(work, self.notify, lambda: self.design is design)


@lru_cache(1)
def gallery() -> str:
    """Return pictures of the shipped scenes, each a link that opens it."""
    entries = []
    for name in scene_names():
        scene, best = load_scene(name), best_known().get(name)
        wave = scene.simulate(best.layout) if best else scene.uniform().wave
        layout = wave.layout
        shown = slice(0, min(DRAWN, layout.count))
        time = wave.arrival_times[min(wave.hit, shown.stop) // 2]
        corners = MM * outlines(layout, Motion(layout, scene.physics).angles([time])[0])[shown]
        path = "".join(f"M{' '.join(f'{x:.0f},{-z:.0f}' for x, z in four)}z" for four in corners)
        (left, low), (right, high) = corners.reshape(-1, 2).min(0), corners.reshape(-1, 2).max(0)
        box = f"{left:.0f} {-high:.0f} {right - left:.0f} {high - low:.0f}"
        entries.append(
            f'<a href="?scene={name}"><svg viewBox="{box}"><path d="{path}"/></svg>'
            f"<b>{name}</b> {escape(str(scene.title))}</a>"
        )
    return f'<div class="gallery">{"".join(entries)}</div>'
