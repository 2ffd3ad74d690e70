"""Page: pictures, numbers, controls and actions of a design, for one tab of a browser."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import panel as pn
from bokeh.models import Range1d

from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.motion import Motion
from domino_env.physics.wave import Wave
from domino_env.rigid.simulation import RigidWave, simulate_standing
from domino_env.scenes.run_out import RunOut
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import UniformBaseline
from domino_env.view.comparison import ComparedLayout, headline
from domino_env.view.report import UNIFORM_NAME
from domino_env.view.summaries import noise_summary, placement_noise, rigid_summary
from optimize.interactive.design import SPACING, THICKNESS, StudioDesign, known_best
from optimize.interactive.exchange import exports, make_file, make_link, receive
from optimize.interactive.figures import MM, TITLES, ChainPicture, Curve, set_view
from optimize.interactive.jobs import improvement_method, run_search
from optimize.methods.registry import Method
from optimize.searching import with_baseline

FRAMES, INTERVAL = 150, 40  # frames of the animation, [ms] from one to the next
MAX_LINK_LENGTH = 30_000  # characters that servers and browsers accept in an address
FLOOR_SECONDS = 60.0  # [s] of a search on a floor; half of it may go into the uniform baseline
UNIFORM_DELAY = 0.3  # [s] without a change of the scene before its uniform baseline is computed
WIDE = {"sizing_mode": "stretch_width"}
STYLE = Path(__file__).with_name("page.css").read_text("utf-8")
# at the bottom of the window, visible wherever the page is scrolled
FOOT = {"position": "fixed", "bottom": "0", "left": "0", "z-index": "9"}
NOTHING, KEPT = "nothing", "kept layout"  # choices of "Compare with"

Schedule = Callable[[Callable[[], None]], object]
"""Function that schedules another one in the thread of the page."""


class Control(NamedTuple):
    """Control of a number of the scene, or of a pair of bounds.

    Attributes
    ----------
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


CONTROLS = (
    Control("Number of dominoes", 2, 200, 1, lambda s: None if s.stock else s.count,
            lambda _, v: {"count": int(v)}, pn.widgets.EditableIntSlider),
    Control("Height [mm]", 5, 200, 0.1, lambda s: _mm(s.height), lambda _, v: {"height": v / MM}),
    Control("Width [mm]", 5, 200, 0.1, lambda s: _mm(s.width), lambda _, v: {"width": v / MM}),
    Control("Thickness [mm]", 1, 50, 0.1, _one_thickness,
            lambda _, v: {THICKNESS: (v / MM, v / MM), "first_thickness": v / MM}),
    Control("Allowed gaps [mm]", 0.5, 100, 0.1, *_bounds(SPACING), pn.widgets.EditableRangeSlider),
    Control("Allowed thicknesses [mm]", 1, 50, 0.1, *_bounds(THICKNESS),
            pn.widgets.EditableRangeSlider),
    Control("Length [mm] (0: any)", 0, 5000, 0.5,
            lambda s: _mm(s.length or 0), lambda _, v: {"length": v / MM or None}),
    Control("Push of the first domino [rad/s]", 0.1, 40, 0.1, lambda s: s.physics.push,
            lambda s, v: {"physics": s.physics.replace(push=v)}),
    Control("Friction between dominoes", 0, 1, 0.01, lambda s: s.physics.friction,
            lambda s, v: {"physics": s.physics.replace(friction=v)}),
    Control("Dominoes of the run-out (0: none)", 0, 200, 1, _run_out_count,
            _change_run_out, pn.widgets.EditableIntSlider),
    Control("Gaps of the run-out [mm]", 0.5, 100, 0.1,
            lambda s: _mm(s.run_out.spacing) if s.run_out else None,
            lambda s, v: {"run_out": s.run_out and s.run_out.replace(spacing=v / MM)}),
    Control("Slope [°], positive downhill", -15, 15, 0.1,
            lambda s: s.ground.slope if s.ground else 0.0,
            lambda _, v: {"ground": Ground(slope=v) if v else None}),
    Control("Floor friction (0: fixed pivots)", 0, 1.5, 0.05,
            lambda s: s.floor_friction or 0, lambda _, v: {"floor_friction": v or None}),
)  # fmt: skip


class Page:
    """Contents of one tab of a browser: pictures, numbers and controls of a design.

    Parameters
    ----------
    design
        The design that the page changes.
    schedule
        Function that schedules another one in the thread of the page.

    Attributes
    ----------
    design
        The design.
    view
        Panel object of the page; its figures and widgets are the other public attributes.
    """

    def __init__(self, design: StudioDesign, schedule: Schedule) -> None:
        self.design, self._schedule = design, schedule
        self._pending: dict[Callable[..., None], Any] = {}  # arguments of scheduled calls
        self._stop_event: threading.Event | None = None  # stops the running search; None: no search
        self._last_control: Control | None = None  # its next change replaces its last one
        self._uniform_scene: Scene | None = None  # scene whose uniform baseline was requested
        self._kept_layout: Layout | None = None  # choice `KEPT` of "Compare with"
        self._waves: list[Wave] = []  # of the design, and of the layout that it is compared with
        self._motions: list[Motion] = []  # of these waves; empty until the player is used
        self._view = Range1d(-1.0, 1.0)
        self.chain, self.compared = ChainPicture(self._view), ChainPicture(self._view)
        self.chain.figure.title.text = "Your layout"
        self.curves = {quantity: Curve(self._view, quantity) for quantity in TITLES}
        for quantity in (SPACING, THICKNESS):
            self._enable_drag(quantity)
        self.view = self._make_view()
        self._show()

    # contents -----------------------------------------------------------------------------------

    def _make_view(self) -> Any:
        """Return the page: pictures and actions, and beside or below them the scene."""

        def line(*parts: Any) -> Any:
            return pn.FlexBox(*parts, align_items="end", gap="6px", **WIDE)

        def card(title: str, *parts: Any) -> Any:
            return pn.Column(pn.pane.HTML(f"<h2>{title}</h2>", stylesheets=[STYLE]), *parts, **WIDE)

        def connect(widget: Any, handler: Callable[[Any], None]) -> Any:
            widget.param.watch(lambda event: self._call_newest(handler, event.new), "value")
            return widget

        def button(name: str, action: Callable[..., Any], *values: Any) -> Any:
            kind = "primary" if name in ("Improve", "Search") else "default"
            widget = pn.widgets.Button(name=name, button_type=kind)
            widget.on_click(lambda _: self._schedule(lambda: self._call(action, *values)))
            self.buttons[name] = widget
            return widget

        self.title, self.numbers, self.message, self.link = (
            pn.pane.HTML(stylesheets=[STYLE], **WIDE) for _ in range(4)
        )
        self.message.param.update(styles=FOOT, margin=0)
        self.clock = pn.pane.HTML(width=150)
        self.progress = pn.indicators.Progress(value=-1, visible=False, **WIDE)  # -1: unknown
        player = pn.widgets.Player(
            start=0, end=FRAMES, interval=INTERVAL, loop_policy="once", show_loop_controls=False,
            visible_buttons=["first", "pause", "play", "last"], name="Time", width=260, height=72,
        )  # fmt: skip
        self.player = connect(player, self._draw_chains)
        compare = pn.widgets.Select(name="Compare with", options=[NOTHING], **WIDE)
        self.compare = connect(compare, lambda _: self._show())
        self.controls = {}
        for control in CONTROLS:
            widget = control.kind(
                name=control.label, start=control.low, end=control.high, step=control.step, **WIDE
            )
            self.controls[control] = connect(widget, partial(self._change, control))
        self.floor, self.noise = (
            pn.widgets.FloatInput(name=name, value=0.5, start=0.0, step=0.1, width=150)
            for name in ("Floor friction", "Placement noise [mm]")
        )
        self.buttons: dict[str, Any] = {}
        upload = pn.widgets.FileInput(accept=".csv,.json,.toml", multiple=True, **WIDE)
        connect(upload, lambda data: self._receive(upload.filename, data))
        self.download = pn.widgets.FileDownload(filename="layout", styles={"display": "none"})
        main = pn.Column(
            self.title, self.numbers,
            line(
                button("Undo", self._edit, self.design.move, -1),
                button("Redo", self._edit, self.design.move, 1),
                button("Reset", self._edit, self.design.open, *self.design.first_step),
                button("Equal gaps", self._edit, self._equal_gaps),
                button("Improve", lambda: self._run(improvement_method(self.design.committed))),
                button("Search", self._run, "auto"),
                button("Stop", self._stop_here),
            ),
            self.progress, self.message, line(self.player, self.clock),
            self.chain.figure, self.compared.figure,
            *(curve.figure for curve in self.curves.values()),
            styles={"flex": "4 1 560px"}, min_width=0,
        )  # fmt: skip
        side = pn.Column(
            card("Scene", *self.controls.values()),
            card("Compare", self.compare, button("Keep to compare", self._keep)),
            card(
                "Will it work?",
                line(self.floor, button("Check on a floor", self._check_floor)),
                line(self.noise, button("Try the noise", self._try_noise)),
            ),
            card(
                "Build and save",
                line(*(button(name, self._save, name) for name in exports(self.design))),
                self.link, self.download,
            ),
            card("Open", "A layout (.csv, .json) or a scene (.toml): choose it or drop it here.",
                 upload),
            styles={"flex": "1 1 270px"}, min_width=0,
        )  # fmt: skip
        return pn.FlexBox(main, side, align_items="flex-start", **WIDE)

    def _enable_drag(self, quantity: str) -> None:
        """Make gaps or thicknesses follow the points of their curve that are dragged."""
        points, offset = self.curves[quantity].sources[0], 0.0  # [mm] from the pointer to the point

        def begin(event: Any) -> None:
            nonlocal offset
            self.stop()
            designed = points.data["x"][: self.design.scene.count - 1]  # without the run-out
            nearest = int(np.argmin(np.abs(designed - event.x)))
            offset = points.data["y"][nearest] - event.y
            self.player.param.update(direction=0, value=0)
            points.selected.indices = [nearest]

        def move(event: Any) -> None:
            index = int(points.data["index"][points.selected.indices[0]])
            self._call_newest(self.drag, quantity, index, max(event.y + offset, 0.0) / MM)

        def end(_: Any) -> None:
            points.selected.indices = []
            self._call_newest(self._edit, self.design.commit)  # after a drag that is scheduled

        self.curves[quantity].enable_drag(begin, move, end)

    # calls --------------------------------------------------------------------------------------

    def _call_newest(self, function: Callable[..., None], *values: Any) -> None:
        """Schedule a call with values; newer values replace those of a scheduled call.

        Scheduled calls have the lock of the document, which Panel's watchers may lack.
        """
        is_pending = function in self._pending
        self._pending[function] = values
        if not is_pending:
            self._schedule(lambda: self._call(function, *self._pending.pop(function)))

    def _in_thread(self, work: Callable[[], Any], function: Callable[[Any], None]) -> None:
        """Run `work` in a thread, then call the function with its result in that of the page.

        If `work` raises an error, its message is shown instead.
        """

        def run() -> None:
            try:
                reply = partial(function, work())
            except (ValueError, ArithmeticError) as error:
                reply = partial(self.notify, str(error), "error")
            self._schedule(reply)

        threading.Thread(target=run, daemon=True).start()

    def _call(self, action: Callable[..., Any], *values: Any) -> None:
        """Call a function, and show the message of its error, if any."""
        try:
            action(*values)
        except (ValueError, ArithmeticError) as error:
            self.notify(str(error), "error")

    def notify(self, text: str, kind: str = "") -> None:
        """Show a message.

        Parameters
        ----------
        text
            The message; empty to remove the last one.
        kind
            "error" for the colour of errors.
        """
        message = f'<p role="status" class="message {kind}">{escape(text)}</p>'
        self.message.object = message if text else ""

    # from the design to the page ----------------------------------------------------------------

    def _show(self) -> None:
        """Show the design after a step of the history; slow computations run in threads."""
        design, scene, wave = self.design, self.design.scene, self.design.wave
        self.title.object = f"<h1>Domino studio: {escape(str(scene.title))}</h1>"
        for control, widget in self.controls.items():
            value = control.read(scene)
            widget.visible = value is not None
            if value is not None:
                low, high = min(control.low, np.min(value)), max(control.high, np.max(value))
                widget.param.update(start=low, end=high, value=value)
        scale = MM * (float(design.layout.height.max()) if scene.in_heights else 1.0)
        for quantity, free in ((SPACING, scene.free_spacing), (THICKNESS, scene.free_thickness)):
            self.curves[quantity].figure.visible = free
            self.curves[quantity].fit(*(scale * bound for bound in getattr(scene, quantity)))
        link = make_link(design)
        self.link.object = (
            f'<a href="{link}" target="_blank">Link that contains this layout</a>'
            if len(link) < MAX_LINK_LENGTH else "The layout is too long for a link: save its files."
        )  # fmt: skip
        for name, steps in (("Undo", -1), ("Redo", 1)):
            self.buttons[name].disabled = not design.can_move(steps)
        self.buttons["Stop"].disabled = self._stop_event is None
        if scene != self._uniform_scene:
            self._uniform_scene, design.uniform = scene, None
            self._complete("uniform", lambda: self._uniform(scene), lambda: design.scene == scene)
        if design.score is None:
            self._complete("score", lambda: scene.score(wave), lambda: design.wave is wave)
        self._redraw()
        self._fit_view()

    def _uniform(self, scene: Scene) -> UniformBaseline | None:
        """Return the uniform baseline after `UNIFORM_DELAY`; None if the scene has then changed."""
        time.sleep(UNIFORM_DELAY)
        if scene != self.design.scene:
            return None
        return with_baseline(scene, FLOOR_SECONDS).uniform()

    def _complete(self, name: str, work: Callable[[], Any], is_current: Callable[[], bool]) -> None:
        """Set an attribute of the design to the result of `work`, which runs in a thread.

        The result is dropped if it is not current any more when `work` ends.
        """

        def update(value: Any) -> None:
            if is_current():
                setattr(self.design, name, value)
                self._redraw()

        self._in_thread(work, update)

    def _redraw(self) -> None:
        """Show the layout: its numbers, its curves and its picture."""
        design, scene, uniform = self.design, self.design.scene, self.design.uniform
        best, kept_layout = known_best(scene), self._kept_layout
        layouts = {
            UNIFORM_NAME: uniform.layout if uniform else None,
            "best known layout": best.layout if best else None,
            KEPT: kept_layout if kept_layout and not scene.violations(kept_layout) else None,
        }
        # the uniform baseline can be chosen while it is computed
        self.compare.options = [NOTHING, UNIFORM_NAME, *(n for n in [*layouts][1:] if layouts[n])]
        compared = layouts.get(self.compare.value)
        other = None if compared is None else scene.simulate(compared)
        for curve in self.curves.values():
            curve.draw((design.wave, uniform.wave if uniform else None, other))
        waves = {"your layout": design.wave} | ({self.compare.value: other} if other else {})
        self._waves, self._motions = [*waves.values()], []
        self.compared.figure.visible = other is not None
        self.compared.figure.title.text = self.compare.value.capitalize()
        compared_layouts = [ComparedLayout(name, wave) for name, wave in waves.items()]
        verdict = f"<p><b>{escape(headline(compared_layouts)['winner'])}</b></p>" if other else ""
        numbers = design.numbers().items()
        cells = (f"<div><b>{escape(text)}</b><br>{escape(name)}</div>" for name, text in numbers)
        self.numbers.object = (
            f'<div class="numbers">{"".join(cells)}</div>'
            f"<p>{escape(design.wave.explanation)}</p>{verdict}"
        )
        self._draw_chains()

    def _draw_chains(self, frame: int | None = None) -> None:
        """Draw the dominoes at the time of the player; with a frame, follow the leader."""
        layouts, fraction = [wave.layout for wave in self._waves], self.player.value / FRAMES
        poses, clock = [(layout.tilt, -1) for layout in layouts], "0 s"  # leans, leader (-1: none)
        if fraction:  # no motion is computed for a chain at rest, so that a drag is fast
            self._motions = self._motions or [Motion(w.layout, w.physics) for w in self._waves]
            end = max(motion.end for motion in self._motions)
            times = [fraction * end]
            poses = [(m.angles(times)[0], int(m.leader(times)[0][0])) for m in self._motions]
            clock = f"{times[0]:.3f} s of {end:.3f} s"
        self.clock.object = clock
        stops = (self.design.stop, None)
        for chain, layout, pose, stop in zip(
            (self.chain, self.compared), layouts, poses, stops, strict=False
        ):
            chain.draw(layout, *pose, stop)
        if frame is not None:
            self._fit_view(float(layouts[0].pivots[max(poses[0][1], 0), 0]))

    def _fit_view(self, leader: float | None = None) -> None:
        """Show the longest chain, or its part around a leader at this x [m]."""
        longest = max((wave.layout for wave in self._waves), key=lambda layout: layout.length)
        set_view(self._view, longest, leader)

    # from the page to the design ----------------------------------------------------------------

    def drag(self, quantity: str, index: int, value: float) -> None:
        """Change a gap or a thickness, see `StudioDesign.drag`, and show the design."""
        self.design.drag(quantity, index, value)
        self._redraw()

    def _edit(self, action: Callable[..., Any], *values: Any) -> None:
        """Call a function that changes the design, and show the design."""
        self.stop()
        self.notify("")
        self._last_control = None
        self._call(action, *values)
        self._show()

    def _change(self, control: Control, value: Any) -> None:
        """Change the scene; consecutive changes by one control are one step of the history."""
        scene = self.design.scene
        if value is not None and value != control.read(scene):
            if self._last_control is control:
                self.design.move(-1)
            self._edit(lambda: self.design.change(**control.fields(scene, value)))
            self._last_control = control if self.design.scene != scene else None

    def _equal_gaps(self) -> None:
        """Change the layout to the uniform baseline."""
        if self.design.uniform is None:
            raise ValueError("the best equal gaps are still being computed: try again")
        self.design.show(self.design.uniform.layout)
        self.design.commit()

    def _keep(self) -> None:
        """Keep the layout as a choice of "Compare with", and compare with it."""
        self._kept_layout = self.design.layout
        self._redraw()
        self.compare.value = KEPT

    def _receive(self, names: list[str], data: list[bytes] | None) -> None:
        """Open uploaded files; None: the upload was reset."""
        if data:
            files = dict(zip(names, data, strict=True))
            self._edit(lambda: self.notify(receive(self.design, files)))

    def _save(self, name: str) -> None:
        """Send a file to the browser, which saves it."""
        ending, write = exports(self.design)[name]
        filename = f"{self.design.scene.name}{ending}"

        def send(data: BytesIO) -> None:
            self.download.param.update(file=data, filename=filename)
            self.download._clicks += 1  # as a click on its hidden button does
            self.notify(f"saved {filename} in the downloads of the browser")

        self._in_thread(lambda: make_file(write, filename), send)

    # actions in the background ------------------------------------------------------------------

    def stop(self) -> None:
        """End a search and discard its result."""
        self._stop_here()
        self._stop_event, self.progress.visible = None, False

    def _stop_here(self) -> None:
        """End a search with its best layout so far."""
        if self._stop_event is not None:
            self._stop_event.set()

    def _run(self, method: str | Method) -> None:
        """Run a search, and show its best layouts so far."""
        self.stop()
        self.notify("")
        stop_event = self._stop_event = threading.Event()
        design, first_score = self.design, self.design.score
        self.progress.param.update(visible=True, value=-1)
        self.buttons["Stop"].disabled = False

        def show(layout: Layout, fraction: float) -> None:
            if self._stop_event is stop_event:
                self.progress.value = round(100 * fraction) or -1
                design.show(layout)
                self._redraw()

        def update(result: tuple[Layout, str]) -> None:
            if self._stop_event is not stop_event:
                return
            layout, text = result
            design.show(layout)
            if first_score is not None and design.score is not None and design.score < first_score:
                design.show(design.committed)
                text = f"no better layout was found; {text}"
            self._edit(design.commit)
            self.notify(text)

        show_newest = partial(self._call_newest, show)
        self._in_thread(lambda: run_search(design.scene, method, stop_event, show_newest), update)

    def _check_floor(self) -> None:
        """Simulate the free-standing dominoes in a thread, and show a summary."""
        wave, friction = self.design.wave, self.floor.value
        self.notify("simulating the free-standing dominoes …")

        def update(rigid: RigidWave) -> None:
            if self.design.wave is wave:
                _, title, *lines = rigid_summary(rigid, wave)
                self.notify(f"{title} {'; '.join(lines)}.")

        self._in_thread(lambda: simulate_standing(wave.layout, wave.physics, friction), update)

    def _try_noise(self) -> None:
        """Simulate placement noise in a thread, and show a summary."""
        wave, scene, deviation = self.design.wave, self.design.scene, self.noise.value / MM
        self._in_thread(lambda: noise_summary(placement_noise(wave, scene, deviation)), self.notify)
