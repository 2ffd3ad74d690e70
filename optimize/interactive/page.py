"""Page: a design with its pictures, numbers, controls and actions, for one tab of a browser."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from html import escape
from typing import Any, NamedTuple

import numpy as np
import panel as pn

from domino_env.cli.simulate import noise_summary, placement_noise, rigid_summary
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.motion import Motion
from domino_env.physics.wave import Wave
from domino_env.rigid.simulation import simulate_standing
from domino_env.scenes.scene import Scene
from domino_env.view.race import Racer, headline
from optimize.interactive.design import SPACING, THICKNESS, Design, known_record
from optimize.interactive.exchange import exports, file_of, link_of, receive
from optimize.interactive.figures import Chain, Curve, let_drag, new_view, set_view
from optimize.interactive.jobs import Latest, Schedule, Work, find, improve, run_later

FRAMES, INTERVAL = 150, 40  # of the animation, and [ms] from one to the next
LONGEST_LINK = 30_000  # characters that servers and browsers accept in an address
FLOOR_SECONDS = 30.0  # [s] that a uniform baseline on a floor may take
MM = 1e3
WIDE = {"sizing_mode": "stretch_width"}
STYLE = """
h1 { font-size: 18px; margin: 0; } h2 { font-size: 15px; margin: 10px 0 2px; } p { margin: 2px 0; }
.numbers { display: flex; flex-wrap: wrap; gap: 4px 28px; font-size: 13px; color: #5c636d; }
.numbers b { font-size: 20px; color: #1d2126; }
.error { color: #b03a00; }
"""
WHOLE = ".bk-btn { padding: 0; } .bk-btn a { flex: 1; padding: 6px 12px; }"  # to be clicked
NOTHING, UNIFORM, KNOWN, KEPT = "nothing", "uniform baseline", "best known layout", "kept layout"


class Control(NamedTuple):
    """Number of a scene on the page.

    `read` returns its value, None where the scene has no such number; `fields` returns the fields
    of the scene that a new value changes.
    """

    label: str
    low: float
    high: float
    step: float
    read: Callable[[Scene], Any]
    fields: Callable[[Scene, Any], dict[str, Any]]


def _bounds(part: str) -> tuple[Callable[[Scene], Any], Callable[[Scene, Any], dict[str, Any]]]:
    """Return how the bounds of gaps or thicknesses are read and changed, in millimetres."""

    def read(scene: Scene) -> Any:
        free = getattr(scene, f"free_{part}") and not (part == THICKNESS and scene.stock)
        low, high = getattr(scene, part)
        return (_mm(low), _mm(high)) if free and not scene.in_heights else None

    return read, lambda _, v: {part: (v[0] / MM, v[1] / MM), f"{part}_values": None}


def _mm(value: float) -> float:
    return round(MM * value, 9)


def _one_thickness(scene: Scene) -> float | None:
    varies = scene.free_thickness or scene.stock or scene.in_heights
    return None if varies else _mm(scene.thickness[0])


def _slope(scene: Scene) -> float | None:
    return 0.0 if scene.ground is None else scene.ground.slope


CONTROLS = (
    Control("Number of dominoes", 2, 200, 1, lambda s: None if s.stock else s.count,
            lambda _, v: {"count": int(v)}),
    Control("Height [mm]", 5, 200, 0.1, lambda s: _mm(s.height), lambda _, v: {"height": v / MM}),
    Control("Thickness [mm]", 1, 50, 0.1, _one_thickness,
            lambda _, v: {THICKNESS: (v / MM, v / MM), "first_thickness": v / MM}),
    Control("Allowed gaps [mm]", 0.5, 100, 0.1, *_bounds(SPACING)),
    Control("Allowed thicknesses [mm]", 1, 50, 0.1, *_bounds(THICKNESS)),
    Control("Length, first to last pivot [mm]; 0 for any", 0, 5000, 0.5,
            lambda s: _mm(s.length or 0),
            lambda _, v: {"length": v / MM or None}),
    Control("Push of the first domino [rad/s]", 0.1, 40, 0.1, lambda s: s.physics.push,
            lambda s, v: {"physics": s.physics.replace(push=v)}),
    Control("Friction between dominoes", 0, 1, 0.01, lambda s: s.physics.friction,
            lambda s, v: {"physics": s.physics.replace(friction=v)}),
    Control("Slope [°], positive downhill", -15, 15, 0.1, _slope,
            lambda _, v: {"ground": Ground(slope=v) if v else None}),
    Control("Floor friction of the score; 0 for fixed pivots", 0, 1.5, 0.05,
            lambda s: s.floor_friction or 0, lambda _, v: {"floor_friction": v or None}),
)  # fmt: skip


class Page:
    """All that one tab shows of a design, and how the design follows it.

    Parameters
    ----------
    design
        The design that the page changes.
    schedule
        Function that runs another one in the thread of the page, soon.

    Attributes
    ----------
    design
        The design.
    view
        The page, an object of Panel.
    """

    def __init__(self, design: Design, schedule: Schedule) -> None:
        self.design, self._schedule = design, schedule
        self._stopped: threading.Event | None = None  # ends the action that runs
        self._uniform: tuple[Scene, Any] | None = None  # the uniform baseline, and its scene
        self._kept: Layout | None = None
        self._syncing = False  # the page sets its own controls
        self._held = (SPACING, 0, 0.0)  # part, number and offset [m] of a drag
        self._waves: list[Wave] = []  # of this layout, and of the other one in a race
        self._motions: list[Motion] = []  # theirs; empty until the time is more than 0
        self._drag = Latest(schedule, self._drag_to)
        self._search = Latest(schedule, self._show_search)
        self._control = Latest(schedule, self._change)
        self._frame = Latest(schedule, lambda _: self._draw_chains(follow=True))
        view = self._view = new_view(design.layout)
        self.chain, self.compared = Chain(view), Chain(view)
        self.curves = {
            SPACING: Curve(view, "gap [mm]"), THICKNESS: Curve(view, "thickness [mm]"),
            "speed": Curve(view, "local speed [m/s]"),
        }  # fmt: skip
        for part in (SPACING, THICKNESS):
            let_drag(self.curves[part], *self.handlers(part))
        self._make_controls()
        self.view = self._arranged()
        self._show_all()

    # what the page is made of -------------------------------------------------------------------

    def _make_controls(self) -> None:
        self.title, self.numbers, self.message, self.link = (
            pn.pane.HTML(stylesheets=[STYLE], **WIDE) for _ in range(4)
        )
        self.clock = pn.pane.HTML(width=150)
        self.progress = pn.indicators.Progress(value=-1, visible=False, **WIDE)
        self.player = pn.widgets.Player(
            start=0, end=FRAMES, interval=INTERVAL, loop_policy="once", show_loop_controls=False,
            visible_buttons=["first", "pause", "play", "last"], name="Time", width=260, height=60,
        )  # fmt: skip
        self.player.param.watch(lambda event: self._frame(event.new), "value")
        self.race = pn.widgets.Select(name="Race against", options=[NOTHING, UNIFORM], **WIDE)
        self.race.param.watch(lambda _: self._redraw(), "value")
        self.controls = {control: self._widget(control) for control in CONTROLS}
        self.pick = pn.widgets.IntInput(name="Gap number", start=0, value=0, width=110)
        size = {"step": 0.1, "format": "0.000", "width": 170}
        self.sizes = {
            SPACING: pn.widgets.FloatInput(name="Size of this gap [mm]", **size),
            THICKNESS: pn.widgets.FloatInput(name="Thickness after it [mm]", **size),
        }
        self.pick.param.watch(lambda _: self._show_sizes(), "value")
        for part, field in self.sizes.items():
            field.param.watch(lambda e, p=part: self._resize(p, e.new), "value")
        self.floor = pn.widgets.FloatInput(name="Floor friction", value=0.5, step=0.1, width=120)
        self.noise = pn.widgets.FloatInput(
            name="Placement noise [mm]", value=0.5, step=0.1, width=120
        )
        actions: dict[str, Callable[[], None]] = {
            "Undo": lambda: self._edit(self.design.undo),
            "Redo": lambda: self._edit(self.design.redo),
            "Reset": lambda: self._edit(lambda: self.design.open(*self.design.first)),
            "Equal gaps": lambda: self._edit(self._equal_gaps),
            "Improve": lambda: self._run(improve),
            "Search": lambda: self._run(find),
            "Stop": self._stop,
            "Keep to compare": self._keep,
            "Check on a floor": self._check_floor,
            "Try the noise": self._try_noise,
        }
        self.buttons = {}
        for name, action in actions.items():
            kind = "primary" if name in ("Improve", "Search") else "default"
            self.buttons[name] = button = pn.widgets.Button(name=name, button_type=kind)
            button.on_click(lambda _, a=action: self._guarded(a))
        self.upload = pn.widgets.FileInput(accept=".csv,.json,.toml", multiple=True, **WIDE)
        self.upload.param.watch(self._receive, "value")
        self.downloads = {
            name: pn.widgets.FileDownload(
                label=name,
                callback=lambda n=name: self._file(n),
                filename="layout",
                stylesheets=[WHOLE],
                **WIDE,
            )
            for name in exports(self.design)
        }

    def _widget(self, control: Control) -> Any:
        kind = pn.widgets.EditableFloatSlider
        if control.step == 1:
            kind = pn.widgets.EditableIntSlider
        elif "Allowed" in control.label:
            kind = pn.widgets.EditableRangeSlider
        label, low, high, step, *_ = control
        widget = kind(name=label, start=low, end=high, step=step, **WIDE)
        widget.param.watch(
            lambda e: None if self._syncing else self._control((control, e.new)), "value"
        )
        return widget

    def _arranged(self) -> Any:
        """Return the page: pictures and actions, and beside or below them the scene."""

        def card(title: str, *parts: Any) -> Any:
            return pn.Column(pn.pane.HTML(f"<h2>{title}</h2>", stylesheets=[STYLE]), *parts, **WIDE)

        def line(*parts: Any) -> Any:
            return pn.FlexBox(*parts, align_items="end", gap="6px", **WIDE)

        buttons, curves = self.buttons, self.curves
        first = ("Undo", "Redo", "Reset", "Equal gaps", "Improve", "Search", "Stop")
        actions = line(*(buttons[name] for name in first))
        main = pn.Column(
            self.title, self.numbers, actions, self.progress, self.message,
            line(self.player, self.clock), self.chain.figure, self.compared.figure,
            curves[SPACING].figure, curves[THICKNESS].figure, curves["speed"].figure,
            line(self.pick, *self.sizes.values()), styles={"flex": "4 1 560px"}, min_width=0,
        )  # fmt: skip
        side = pn.Column(
            card("Scene", *self.controls.values()),
            card("Compare", self.race, buttons["Keep to compare"]),
            card("Will it work?", line(self.floor, buttons["Check on a floor"]),
                 line(self.noise, buttons["Try the noise"])),
            card("Build and save", *self.downloads.values(), self.link),
            card("Open", "A layout (.csv, .json) or a scene (.toml): choose it or drop it here.",
                 self.upload),
            styles={"flex": "1 1 270px"}, min_width=0,
        )  # fmt: skip
        return pn.FlexBox(main, side, align_items="flex-start", **WIDE)

    # from the design to the page ----------------------------------------------------------------

    def _show_all(self) -> None:
        """Show a design whose scene may be another one."""
        scene = self.design.scene
        self.title.object = f"<h1>Domino studio: {escape(str(scene.title))}</h1>"
        self._syncing = True
        for control, widget in self.controls.items():
            value = control.read(scene)
            widget.visible = value is not None
            if value is not None:
                low, high = np.min(value), np.max(value)
                widget.param.update(
                    start=min(control.low, low), end=max(control.high, high), value=value
                )
        self.pick.param.update(end=scene.count - 2, value=min(self.pick.value, scene.count - 2))
        kept = self._kept is not None and not scene.violations(self._kept)
        choices = {UNIFORM: True, KNOWN: known_record(scene), KEPT: kept}
        self.race.options = [NOTHING, *(name for name, there in choices.items() if there)]
        self._syncing = False
        for name, (ending, _) in exports(self.design).items():
            self.downloads[name].filename = f"{scene.name}{ending}"
        for part, free in ((SPACING, scene.free_spacing), (THICKNESS, scene.free_thickness)):
            self.curves[part].figure.visible = self.sizes[part].visible = free
            low, high = getattr(scene, part)
            scale = float(self.design.layout.height.max()) if scene.in_heights else 1.0
            self.curves[part].fit(MM * low * scale, MM * high * scale)
        set_view(self._view, self.design.layout)
        if self._uniform is None or self._uniform[0] != scene:
            self._uniform = None
            run_later(
                lambda: (scene, scene.uniform(FLOOR_SECONDS)), self._take_uniform, self._schedule
            )
        self._settle()

    def _settle(self) -> None:
        """Show what a step of the history changes, after a drag for example."""
        design = self.design
        wave = design.wave
        if design.score is None:

            def take(score: Any) -> None:
                if design.wave is wave and isinstance(score, float):
                    design.score = score
                    self._redraw()

            run_later(lambda: design.scene.score(wave), take, self._schedule)
        link = link_of(design)
        self.link.object = (
            f'<a href="{link}" target="_blank">Link that contains this layout</a>'
            if len(link) < LONGEST_LINK else "The layout is too long for a link: save its files."
        )  # fmt: skip
        self.buttons["Undo"].disabled = not design.can_undo
        self.buttons["Redo"].disabled = not design.can_redo
        self.buttons["Stop"].disabled = self._stopped is None
        self._show_sizes()
        self._redraw()

    def _redraw(self) -> None:
        """Show the layout: its numbers, its curves and its picture."""
        design, compared = self.design, self._compared
        uniform = self._uniform[1] if self._uniform else None
        numbers = design.numbers(uniform.score if uniform else None)
        cells = (f"<div><b>{escape(v)}</b><br>{escape(name)}</div>" for name, v in numbers.items())
        explanation = escape(design.wave.explanation)
        self.numbers.object = f'<div class="numbers">{"".join(cells)}</div><p>{explanation}</p>'
        other = None if compared is None else design.scene.simulate(compared)
        for curve in self.curves.values():
            curve.draw((design.wave, uniform.wave if uniform else None, other))
        waves = {"your layout": design.wave} | ({self.race.value: other} if other else {})
        self._waves, self._motions = [*waves.values()], []
        self.compared.figure.visible = other is not None
        self.compared.figure.title.text = self.race.value
        racers = [Racer(name, wave) for name, wave in waves.items()]
        self.chain.figure.title.text = headline(racers)["who"] if other else "Your layout"
        self._draw_chains()

    def _draw_chains(self, *, follow: bool = False) -> None:
        """Draw the dominoes at the time of the player."""
        layouts, part = [wave.layout for wave in self._waves], self.player.value / FRAMES
        poses = [(layout.tilt, -1) for layout in layouts]
        self.clock.object = "0 s"
        if part:  # a drag of a chain at rest does not wait for its motion
            motions = self._motions or [Motion(wave.layout, wave.physics) for wave in self._waves]
            self._motions, end = motions, max(motion.end for motion in motions)
            now = [part * end]
            poses = [(m.angles(now)[0], int(m.leader(now)[0][0])) for m in motions]
            self.clock.object = f"{now[0]:.3f} s of {end:.3f} s"
        stops = (self.design.stop, None)
        chains = (self.chain, self.compared)
        for chain, layout, pose, stop in zip(chains, layouts, poses, stops, strict=False):
            chain.draw(layout, *pose, stop)
        if follow:
            set_view(self._view, layouts[0], float(layouts[0].pivots[max(poses[0][1], 0), 0]))

    def _show_sizes(self) -> None:
        layout, number = self.design.layout, self.pick.value
        self._syncing = True
        self.sizes[SPACING].value = _mm(float(layout.spacing[number]))
        self.sizes[THICKNESS].value = _mm(float(layout.thickness[number + 1]))
        self._syncing = False

    def tell(self, words: str, kind: str = "") -> None:
        """Show a sentence; the kind "error" has its own colour."""
        self.message.object = (
            f'<p role="status" class="{kind}">{escape(words)}</p>' if words else ""
        )

    @property
    def _compared(self) -> Layout | None:
        """Layout of the race against this one."""
        name, record = self.race.value, known_record(self.design.scene)
        if name == UNIFORM:
            return self._uniform[1].layout if self._uniform else None
        return record[0] if name == KNOWN and record else self._kept if name == KEPT else None

    def _take_uniform(self, found: Any) -> None:
        if isinstance(found, tuple) and found[0] == self.design.scene:
            self._uniform = found
            self._redraw()

    # from the page to the design ----------------------------------------------------------------

    def _guarded(self, action: Callable[[], object]) -> bool:
        """Do something and return True, or show why it cannot be done."""
        self.tell("")
        try:
            action()
        except (ValueError, ArithmeticError) as error:
            self.tell(str(error), "error")
            return False
        return True

    def _edit(self, action: Callable[[], object]) -> None:
        """Change the design, and show it."""
        self._abandon()
        if self._guarded(action):  # a control keeps a value that is rejected, until it is changed
            self._show_all()

    def _abandon(self) -> None:
        """End an action of which no result is wanted any more."""
        if self._stopped is not None:
            self._stopped.set()
            self._stopped, self.progress.visible = None, False
            self.buttons["Stop"].disabled = True

    close = _abandon

    def _stop(self) -> None:
        """End an action with the best so far."""
        if self._stopped is not None:
            self._stopped.set()

    def _change(self, change: tuple[Control, Any]) -> None:
        control, value = change
        fields = control.fields(self.design.scene, value)
        self._edit(lambda: self.design.change(**fields))

    def _equal_gaps(self) -> None:
        if self._uniform is None:
            raise ValueError("the best equal gaps are still being computed: try again")
        self.design.show(self._uniform[1].layout)
        self.design.commit()

    def _keep(self) -> None:
        self._kept = self.design.layout
        self._show_all()
        self.race.value = KEPT

    def handlers(self, part: str) -> Iterator[Callable[[Any], None]]:
        """Yield what happens at the begin, during and at the end of a drag."""
        places = self.curves[part].sources[0]

        def begin(event: Any) -> None:
            self._abandon()
            at = int(np.argmin(np.abs(places.data["x"] - event.x)))
            number = at + (part == THICKNESS)
            self._held = part, number, places.data["y"][at] - event.y
            self.player.param.update(direction=0, value=0)
            self.pick.value = at
            places.selected.indices = [at]

        def end(_: Any) -> None:
            self._drag.flush()
            self.design.commit()
            places.selected.indices = []
            self._settle()

        yield from (begin, lambda event: self._drag(event.y), end)

    def _drag_to(self, y: float) -> None:
        part, number, offset = self._held
        self.design.drag(part, number, max(y + offset, 0.0) / MM)
        self._redraw()

    def _resize(self, part: str, value: float) -> None:
        if not self._syncing and value is not None:
            number = self.pick.value + (part == THICKNESS)
            self.design.drag(part, number, value / MM)
            self.design.commit()
            self._settle()

    def _receive(self, event: Any) -> None:
        if event.new:
            names = self.upload.filename
            files = dict(zip(names, event.new, strict=True))
            self._edit(lambda: self.tell(receive(self.design, files)))

    def _file(self, name: str) -> Any:
        found: list[Any] = [None]
        _, write = exports(self.design)[name]
        filename = self.downloads[name].filename
        self._guarded(lambda: found.append(file_of(write, filename)))
        return found[-1]

    # actions in the background ------------------------------------------------------------------

    def _run(self, work: Work) -> None:
        """Run a search from the layout, and show how it climbs."""
        self._abandon()
        stopped = self._stopped = threading.Event()
        design, began = self.design, self.design.score
        self.progress.param.update(visible=True, value=-1)
        self.buttons["Stop"].disabled = False

        def show(found: tuple[Layout, float]) -> None:
            self._search((stopped, *found))

        def take(found: Any) -> None:
            self._search.flush()
            if self._stopped is stopped:
                self._abandon()
                layout, words = found if isinstance(found, tuple) else (None, str(found))
                if layout is not None:
                    design.show(layout)
                    if began is not None and design.score is not None and design.score < began:
                        design.show(design.kept)
                        words = f"no better layout was found; {words}"
                    design.commit()
                self.tell(words)
                self._settle()

        run_later(lambda: work(design.scene, design.kept, stopped, show), take, self._schedule)

    def _show_search(self, found: tuple[threading.Event, Layout, float]) -> None:
        stopped, layout, part = found
        if self._stopped is stopped:
            self.progress.value = round(100 * part) if part else -1
            self.design.show(layout)
            self._redraw()

    def _check_floor(self) -> None:
        wave, friction = self.design.wave, self.floor.value
        self.tell("simulating the free-standing dominoes …")

        def take(found: Any) -> None:
            if isinstance(found, Exception):
                self.tell(str(found), "error")
            elif self.design.wave is wave:
                self.tell(" ".join(f"{line}." for line in rigid_summary(found, wave) if line))

        run_later(
            lambda: simulate_standing(wave.layout, wave.physics, friction), take, self._schedule
        )

    def _try_noise(self) -> None:
        wave, scene = self.design.wave, self.design.scene
        self.tell(noise_summary(placement_noise(wave, scene, self.noise.value / MM)))
