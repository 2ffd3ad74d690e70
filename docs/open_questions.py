"""Answer the open questions of Chapman's article: python docs/open_questions.py.

It writes the tables and pictures of open-questions.md and open-questions.csv in a minute; then
``python docs/pages.py`` writes the numbers in the text. Lengths are in heights, times in
√(height/gravity), unless a unit is given.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

import domino_env as de
from domino_env.core.colours import COLOURS, INK
from domino_env.core.plot_style import (
    LEGEND,
    label_plainly,
    new_figure,
    own_style,
    style,
    write_png,
)
from domino_env.core.tables import fill_tables, markdown_table, write_csv
from domino_env.core.types import Floats
from domino_env.validation import chapman
from domino_env.validation.chapman import FRICTION, HEIGHT, THICKNESS
from domino_env.validation.measured import floor_factor
from domino_env.validation.source import shipped_sources
from optimize.experiments.best_known import best_known

PATH = Path(__file__).with_name("open-questions.csv")
STANDARD = THICKNESS / HEIGHT
THICKNESSES = (0.05, 0.1, STANDARD, 0.2, 0.25, 0.3)
GAPS = (0.05, *np.arange(1, 10) / 10)
RANGE, SMOOTH = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6), (0.0, 0.1, 0.25)  # frictions
DEPTH = 300  # dominoes of a stack
SCENES, LAYOUTS = ("sprint", "course"), {False: "equal", True: "best"}


def units(friction: float, push: float = 3.0) -> de.Physics:
    """Return physics in units of the height and √(gravity/height)."""
    return de.Physics(friction=friction, gravity=1.0, push=push)


@cache
def waves(frictions: tuple[float, ...], gaps: tuple[float, ...] = GAPS) -> Floats:
    """Return the steady waves that exist on the grid of thicknesses, gaps and frictions.

    The lines of the array (6, K) are thickness, gap, friction, the angular velocities after and
    before a hit, and speed.
    """
    thickness, gap = map(np.ravel, np.meshgrid(THICKNESSES, gaps, indexing="ij"))
    parts = []
    for friction in frictions:
        wave = de.steady_wave(gap + thickness, thickness, 1.0, units(friction), rtol=1e-8)
        numbers = wave.omega_release, wave.omega_impact, wave.speed
        parts.append(np.array([thickness, gap, 0.0 * gap + friction, *numbers])[:, wave.exists])
    return np.concatenate(parts, axis=1)


def largest(errors: Floats, chosen: Any = slice(None)) -> str:
    """Return the largest magnitude of relative errors, in percent."""
    return f"{100.0 * np.abs(errors[chosen]).max():.2f}"


def rms(errors: Floats) -> str:
    """Return the root mean square of relative errors, in percent."""
    return f"{100.0 * np.sqrt(np.mean(errors**2)):.2f}"


@own_style()
def new_panels(*headings: str, height: float = 3.6) -> tuple[Any, list[Any]]:
    """Return a figure with panels side by side."""
    figure = new_figure(7.5, height)
    panels = figure.subplots(1, len(headings), squeeze=False)[0]
    for axes, heading in zip(panels, headings, strict=True):
        style(axes, heading)
    return figure, list(panels)


# 1. theory of friction ---------------------------------------------------------------------------


def stack(thickness: Floats, pitch: Floats, friction: Floats, angle: Floats) -> Floats:
    """Return leans, factors J and weights w of the stack behind a leader; (3, DEPTH, K)."""
    lean, factor, weight = angle + 0.0 * pitch, np.ones_like(pitch), np.ones_like(pitch)
    lines = []
    for _ in range(DEPTH):
        lines.append((lean, factor, weight))
        sine = pitch * np.cos(lean) - thickness
        cosine = np.sqrt(1.0 - sine**2)
        arm = cosine - pitch * np.sin(lean)
        is_closed = arm > -1e-9  # else the contact has separated
        weight = is_closed * weight * (arm - friction * thickness) / (cosine + friction * sine)
        factor = is_closed * factor * np.maximum(arm, 0.0) / cosine
        lean = lean + np.arcsin(sine)
    return np.array(lines).swapaxes(0, 1)


def last_separation(thickness: Floats, pitch: Floats, end: Floats) -> Floats:
    """Return the leader's angle at which a contact of its stack separates; `end` if none does."""
    cosine = (pitch**2 + thickness**2 - 1.0) / (2.0 * pitch * thickness)
    angle = np.where(cosine < 1.0, np.arccos(np.clip(cosine, -1.0, 1.0)), end)
    angle = np.where(pitch**2 - thickness**2 < 1.0, end, angle)
    for _ in range(3):  # from a contact to the one before it
        across, up = pitch - np.sin(angle), np.cos(angle)
        before = np.arctan2(up, across) - np.arccos(thickness / np.hypot(across, up))
        angle = np.where(angle > end + 1e-12, before, angle)
    return angle


def interval(sizes: tuple[Floats, Floats, Floats], start: Floats, end: Floats) -> Any:
    """Return gain and offset of u between two angles of the leader, from three values."""
    thickness = sizes[0]
    stacks = [stack(*sizes, angle) for angle in (start, 0.5 * (start + end), end)]
    slopes = [
        3.0 / (1.0 + thickness**2) * np.sum(w * (np.sin(lean) - thickness * np.cos(lean)), axis=0)
        for lean, _, w in stacks
    ]

    def trapezoid(i: int, k: int) -> tuple[Floats, Floats]:
        (_, factor, weight), (_, next_factor, next_weight) = stacks[i], stacks[k]
        turn = 0.5 * np.sum(next_weight * factor - weight * next_factor, axis=0)
        work = 0.25 * (k - i) * (end - start) * (slopes[i] + slopes[k])
        mass = np.sum(next_weight * next_factor, axis=0) - turn
        return (np.sum(weight * factor, axis=0) + turn) / mass, work / mass

    (first, lift), (second, drop), (gain, offset) = (
        trapezoid(i, k) for i, k in ((0, 1), (1, 2), (0, 2))
    )
    return (4.0 * first * second - gain) / 3.0, (4.0 * (lift * second + drop) - offset) / 3.0


def from_map(sizes: tuple[Floats, Floats, Floats], gain: Floats, offset: Floats) -> Any:
    """Return the angular velocities after and before a hit, of the fixed point."""
    _, factor, weight = stack(*sizes, 0.0 * sizes[0])
    kept = (1.0 - 1.0 / np.sum(weight * factor, axis=0)) ** 2
    impact = offset / (1.0 - gain * kept)
    return np.sqrt(kept * impact), np.sqrt(impact)


def three_values(thickness: Floats, gap: Floats, friction: Floats) -> Any:
    """Return both angular velocities from J and w at start, middle and end of an interval."""
    sizes, end = (thickness, gap + thickness, friction), np.arcsin(gap)
    between = last_separation(thickness, sizes[1], end)
    gain, offset = interval(sizes, 0.0 * end, between)
    after, more = interval(sizes, np.minimum(between + 1e-7, end), end)
    is_split = between < end
    after, more = np.where(is_split, after, 1.0), np.where(is_split, more, 0.0)
    return from_map(sizes, gain * after, offset * after + more)


def two_values(thickness: Floats, gap: Floats, friction: Floats) -> Any:
    """Return both angular velocities from the means of η at start and end of an interval."""
    sizes, end = (thickness, gap + thickness, friction), np.arcsin(gap)
    begin, final = stack(*sizes, 0.0 * end), stack(*sizes, end)
    passed, heights = [], []
    for lean, factor, weight in (begin, final):
        passed.append(np.maximum(weight, 0.0) / np.maximum(factor, 1e-9))
        heights.append(0.5 * (np.cos(lean) + thickness * np.sin(lean)))
    released = np.sum((passed[0] + passed[1]) * (heights[0] - heights[1]), axis=0)
    masses = [np.sum(weight * factor, axis=0) for _, factor, weight in (begin, final)]
    return from_map(sizes, masses[0] / masses[1], 3.0 * released / (1.0 + thickness**2) / masses[1])


THEORIES = {"two values": two_values, "three values": three_values}


def equation_13(thickness: float, gap: float, friction: float) -> float:
    """Return the speed by equation 13, which has no friction."""
    speed = chapman.equation_13((gap + thickness) * HEIGHT, thickness * HEIGHT)
    return speed / chapman.SPEED_UNIT * float(np.sqrt(3.0))


ESTIMATES: dict[str, Callable[[float, float, float], float]] = {
    "speed_estimate": lambda d, s, mu: de.speed_estimate(s + d, d, 1.0, units(mu)),
    "equation 13 · (1 + μ)^−0.4": lambda d, s, mu: equation_13(d, s, mu) * (1.0 + mu) ** -0.4,
}


def estimate_errors() -> tuple[Floats, dict[str, Floats]]:
    """Return the waves in the range of `speed_estimate`, and errors of the estimates by name."""
    known = waves((0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3), (0.1, 0.15, *GAPS[2:8]))
    known = known[:, known[1] >= 0.5 * known[0] - 1e-9]
    speeds = {name: [f(*chain) for chain in known[:3].T] for name, f in ESTIMATES.items()}
    return known, {name: np.array(values) / known[5] - 1.0 for name, values in speeds.items()}


def friction_table() -> list[str]:
    """Return the table of errors of the theory with sums and of the estimates without."""
    known, (near, estimates) = waves(RANGE), estimate_errors()
    box, lines = (known[1] < 0.75) & (known[2] < 0.35), []
    for name, theory in THEORIES.items():
        errors = theory(*known[:3])[1] / known[4] - 1.0
        lines.append((f"{name}, ω₊", known, errors, largest(errors, box)))
    lines += [(f"{name}, v", near, errors, largest(errors)) for name, errors in estimates.items()]
    cells = (
        (name, largest(e) if x is known else "", rms(e), most, largest(e, x[0] == STANDARD))
        for name, x, e, most in lines
    )
    names = "formula", "all waves", "RMS", "gap ≤ 0.7, friction ≤ 0.3", "standard dominoes"
    return markdown_table(names, cells)


@own_style()
def draw_friction() -> Any:
    """Draw the errors of the theory over the gap, and speeds of standard dominoes."""
    figure, (left, right) = new_panels("Largest error of ω₊ [%]", "Standard dominoes")
    known, gaps = waves(RANGE), np.linspace(0.1, 0.7, 25)
    for (name, theory), colour in zip(THEORIES.items(), COLOURS, strict=False):
        errors = 100.0 * np.abs(theory(*known[:3])[1] / known[4] - 1.0)
        worst = [errors[known[1] == gap].max() for gap in GAPS]
        left.plot(GAPS, worst, "o-", color=colour, markersize=4, label=name)
    left.set(yscale="log", xlabel="gap [height]")
    label_plainly(left.yaxis, (1,))
    left.legend(**LEGEND)
    for friction, colour in zip((0.0, 0.1, 0.3), COLOURS, strict=False):
        wave = de.steady_wave(gaps + STANDARD, STANDARD, 1.0, units(friction))
        right.plot(gaps, wave.speed, color=colour, label=f"friction {friction:g}")
        for form, estimate in zip(".:", ESTIMATES.values(), strict=True):
            speeds = [estimate(STANDARD, gap, friction) for gap in gaps]
            right.plot(gaps, speeds, form, color=colour, markersize=5)
    for form, name in zip(".:", ESTIMATES, strict=True):
        right.plot([], [], form, color=INK, label=name)
    right.set(xlabel="gap [height]", ylabel="speed [√(gravity · height)]", ylim=(0.9, 3.0))
    right.legend(**LEGEND)
    return figure


# 2. duration of an interval ----------------------------------------------------------------------

MEANS: dict[str, Callable[[Floats, Floats, Floats], Floats]] = {
    "geometric": lambda a, m, b: np.sqrt(a * b),
    "arithmetic": lambda a, m, b: 0.5 * (a + b),
    "logarithmic": lambda a, m, b: (b - a) / np.log(b / a),
    "of the first two": lambda a, m, b: 0.5 * (np.sqrt(a * b) + 0.5 * (a + b)),
    "Simpson": lambda a, m, b: 6.0 / (1.0 / a + 4.0 / m + 1.0 / b),
}


@cache
def mean_errors() -> tuple[Floats, dict[str, Floats]]:
    """Return waves, and by name the errors of means of the angular velocities of an interval.

    The velocity at half of the angle is that at which the last domino but one of a chain hits a
    domino that stands nearer.
    """
    known, middles = waves(SMOOTH, GAPS[1:]), []
    for friction in SMOOTH:
        thickness, gap = known[:2, known[2] == friction, None]
        spacing = np.hstack([np.repeat(gap, 160, axis=1), np.sin(0.5 * np.arcsin(gap))])
        sizes = np.repeat(thickness, 162, axis=1)
        middles.append(de.simulate_batch(spacing, sizes, units(friction), height=1).impact_velocity)
    middle = np.concatenate(middles)[:, 160]
    thickness, gap, _, release, impact, speed = known
    true = np.arcsin(gap) * speed / (gap + thickness)
    return known, {name: f(release, middle, impact) / true - 1.0 for name, f in MEANS.items()}


@own_style()
def draw_means() -> Any:
    """Draw the largest error of the means over the gap."""
    figure, (axes,) = new_panels("Largest error of means of ω over an interval [%]", height=3.4)
    known, errors = mean_errors()
    for (name, error), colour in zip(errors.items(), COLOURS, strict=False):
        worst = [100.0 * np.abs(error[known[1] == gap]).max() for gap in GAPS[1:]]
        axes.plot(GAPS[1:], worst, "o-", color=colour, markersize=4, label=name)
    axes.axhline(0.3, color=INK, linewidth=1.0)
    axes.set(yscale="log", xlabel="gap [height]; thickness 0.05 to 0.3, friction 0, 0.1 and 0.25")
    label_plainly(axes.yaxis, (1,))
    axes.legend(**LEGEND)
    return figure


# 3. the smallest gap -----------------------------------------------------------------------------


def endless_limit(thickness: float, friction: float) -> float:
    """Return the smallest gap of a steady wave over the thickness, to 1e-4."""
    low, high = 1e-5, 1.0
    while high > 1.0001 * low:
        gap = float(np.sqrt(low * high))
        chain = (1.0 + gap) * thickness, thickness, 1.0, units(friction)
        exists = de.steady_wave(*chain, rtol=1e-6).exists
        low, high = (low, gap) if exists else (gap, high)
    return high


def limit_formula(thickness: float, friction: float) -> float:
    """Return the limit of the steady wave by a formula, over the thickness."""
    square = thickness**2 + friction * (0.5 * thickness + 0.75 * thickness**2)
    return 2.0 * square / (1.0 - square)


@cache
def smallest_gap(thickness: float, friction: float, push: float) -> float:
    """Return the smallest gap of a hundred dominoes over the thickness.

    The push is a multiple of that which just tips one domino.
    """
    tipping = de.smallest_push(de.Layout([], thickness, 1.0), units(0.0))
    return de.smallest_gap(thickness, 1.0, units(friction, push * tipping)) / thickness


def gap_errors() -> tuple[Floats, Floats]:
    """Return the errors of the formulas for the limit of the steady wave and for a hundred."""
    frictions, pushes = (0.0, 0.1, 0.2, 0.3), (1.5, 2.0, 3.0, 6.0, 12.0, 25.0, 50.0)
    limits, gaps = [], []
    for case in product(THICKNESSES, frictions):
        limit = limit_formula(*case)
        limits.append(limit / endless_limit(*case) - 1.0)
        gaps += [np.hypot(limit, 1.35 / p) / smallest_gap(*case, p) - 1.0 for p in pushes]
    return np.array(limits), np.array(gaps)


@own_style()
def draw_gaps() -> Any:
    """Draw the smallest gap over the push."""
    figure, (axes,) = new_panels("Smallest gap of a hundred standard dominoes", height=3.7)
    pushes = np.geomspace(1.02, 60.0, 20)
    for friction, colour in zip(SMOOTH, COLOURS, strict=False):
        gaps = [smallest_gap(STANDARD, friction, float(push)) for push in pushes]
        axes.plot(pushes, gaps, color=colour, label=f"friction {friction:g}")
        axes.axhline(endless_limit(STANDARD, friction), color=colour, linestyle="--", linewidth=1.0)
        formula = np.hypot(limit_formula(STANDARD, friction), 1.35 / pushes)
        axes.plot(pushes[3:], formula[3:], ":", color=colour)
    axes.plot([], [], "--", color=INK, label="endless chain")
    axes.plot([], [], ":", color=INK, label="formula")
    axes.set(xscale="log", yscale="log", ylabel="gap / thickness")
    axes.set_xlabel("push, in pushes that just tip one domino")
    label_plainly(axes.xaxis, (1, 2, 5))
    label_plainly(axes.yaxis, (1, 2, 5))
    axes.legend(**LEGEND)
    return figure


# 5. placing errors -------------------------------------------------------------------------------

DEVIATIONS = np.array([0.25, 0.5, 1.0, 1.5, 2.0, 3.0])  # of the gaps [mm]
QUANTITIES = "loss", "loss.law", "scatter", "scatter.law", "stops"


@cache
def placed(name: str, best: bool) -> dict[str, Floats]:
    """Return loss and scatter of the speed and stops with errors of the gaps, in percent.

    The laws are of second order for the loss, with the Hessian from exact gradients one deviation
    apart, as the speed has kinks, and of first order for the scatter.
    """
    scene = de.load_scene(name)
    layout = best_known()[name].layout if best else scene.uniform().layout
    noise = np.random.default_rng(5).normal(size=(2000, layout.count - 1))
    gaps, sizes = layout.spacing, {"physics": scene.physics, "height": layout.height}

    def simulate(spacing: Floats, **options: Any) -> Any:
        thickness = np.tile(layout.thickness, (len(spacing), 1))
        return de.simulate_batch(spacing, thickness, **sizes, **options)

    def slopes(spacing: Floats) -> Floats:  # of the speed, from those of the time
        wave = simulate(spacing, gradient=True)
        speed = wave.mean_speed[:, None] / exact
        length = (spacing.sum(axis=1) + layout.thickness[1:].sum())[:, None]
        return speed / length * (1.0 - exact * speed * wave.gradient.spacing)

    exact, lines = de.simulate(layout, scene.physics).mean_speed, []
    for deviation in 1e-3 * DEVIATIONS:
        wave = simulate(np.maximum(gaps + deviation * noise, 1e-4), rtol=1e-5)
        speed = wave.mean_speed[wave.outcome == de.Outcome.PROPAGATED] / exact
        steps = np.minimum(deviation, 0.5 * gaps)
        above, below = (np.diag(slopes(gaps + np.diag(sign * steps))) for sign in (1.0, -1.0))
        law = -0.25 * deviation**2 * np.sum((above - below) / steps)
        first = deviation * np.linalg.norm(slopes(gaps[None]))
        lines.append((1.0 - speed.mean(), law, speed.std(), first, 1.0 - len(speed) / 2000))
    return dict(zip(QUANTITIES, 100.0 * np.array(lines).T, strict=True))


@own_style()
def draw_placing() -> Any:
    """Draw loss, scatter and probability of a stop over the deviation of the gaps."""
    figure, panels = new_panels("Loss of mean speed [%]", "Scatter [%]", "Stops [%]", height=3.2)
    for (name, best), form in zip(
        product(SCENES, (False, True)), ("-", "--", "-.", ":"), strict=True
    ):
        values, colour = placed(name, best), COLOURS[best]
        for axes, key in zip(panels, QUANTITIES[::2], strict=True):
            axes.plot(DEVIATIONS, values[key], form, color=colour, label=f"{name}, {LAYOUTS[best]}")
            if f"{key}.law" in values:
                axes.plot(DEVIATIONS, values[f"{key}.law"], "o", color=colour, markersize=3)
    for axes in panels:
        axes.set_xlabel("deviation of the gaps [mm]")
    panels[2].legend(**LEGEND | {"fontsize": 8})
    return figure


# 6. why real rows are faster ---------------------------------------------------------------------

SOURCE = shipped_sources()["chapman"]
ROWS = [f"{chain.value:g}/s at {1e3 * chain.x:g} mm" for chain in SOURCE.chains]
MEASURED, ERRORS = np.array([(chain.value, chain.uncertainty) for chain in SOURCE.chains]).T
FLOORS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 1.0)
HEADINGS = np.array([0.020, 0.007, 0.010])  # speed-up by headings off by 1 to 3° (MuJoCo)


def frequencies(friction: float = 0.25, base: float = 0.0, pitch: float = 0.0) -> Floats:
    """Return the hits per second of Chapman's rows.

    The base is narrower and the pitches are wider by so many millimetres.
    """
    pitches = np.array(chapman.PITCHES) + 1e-3 * pitch
    physics = de.Physics(friction, chapman.GRAVITY)
    return de.steady_wave(pitches, THICKNESS - 1e-3 * base, HEIGHT, physics, rtol=1e-8).frequency


@cache
def floor_factors() -> Floats:
    """Return the factors of speed on `FLOORS`, (F, 3)."""
    return np.array([
        [floor_factor(floor, SOURCE.setting, pitch, FRICTION) for pitch in chapman.PITCHES]
        for floor in FLOORS
    ])  # fmt: skip


def on_floor(friction: float) -> Floats:
    """Return the factors of speed on a floor of any friction."""
    return np.array([np.interp(friction, FLOORS, column) for column in floor_factors().T])


def started(push: float) -> Floats:
    """Return the factors of the mean frequency of a hundred dominoes to the steady one."""
    physics = de.Physics(FRICTION, chapman.GRAVITY, push)
    layouts = (de.Layout.uniform(100, pitch=pitch) for pitch in chapman.PITCHES)
    means = [de.simulate(x, physics).mean_speed / x.pitch[0] for x in layouts]
    return np.array(means) / frequencies()


Cause = tuple[str, float, float, Callable[[float], dict[str, Any]]]
CAUSES: dict[str, Cause] = {  # unit, lowest and highest value, arguments of `predicted`
    "friction": ("", 0.0, 0.4, lambda x: {"friction": x}),
    "narrower base": (" mm", -1.0, 4.0, lambda x: {"base": x}),
    "pitch": (" mm", -4.0, 2.0, lambda x: {"pitch": x}),
    "all frequencies": (" %", -30.0, 30.0, lambda x: {"factor": 1.0 + 0.01 * x}),
    "floor friction": ("", 0.1, 1.0, lambda x: {"factor": on_floor(x)}),
    "push": (" rad/s", 8.0, 60.0, lambda x: {"factor": started(x)}),
    "headings, times": ("", 0.0, 20.0, lambda x: {"factor": 1.0 + x * HEADINGS}),
}


def predicted(values: dict[str, float]) -> Floats:
    """Return the hits per second of Chapman's rows with these values of causes."""
    arguments = [CAUSES[name][3](value) for name, value in values.items()]
    factor = np.prod([np.broadcast_to(x.pop("factor", 1.0), 3) for x in arguments], axis=0)
    return frequencies(**{key: x[key] for x in arguments for key in x}) * factor


@cache
def best_values(names: tuple[str, ...]) -> tuple[tuple[float, ...], float]:
    """Return the values of causes that fit best, and χ²."""
    low, high = (np.array([CAUSES[name][k] for name in names]) for k in (1, 2))

    def deviations(x: Floats) -> Floats:
        values = dict(zip(names, (low + x * (high - low)).tolist(), strict=True))
        return (predicted(values) - MEASURED) / ERRORS

    starts = np.array([(0.2, 0.2), (0.5, 0.5), (0.8, 0.3)])[:, : len(names)]
    fits = (least_squares(deviations, x, bounds=(0.0, 1.0), diff_step=1e-4) for x in starts)
    best = min(fits, key=lambda fit: fit.cost)
    return tuple((low + best.x * (high - low)).tolist()), 2.0 * best.cost


def needed(name: str, row: int) -> str:
    """Return the value of a cause that explains a row alone, or why there is none."""
    unit, low, high, _ = CAUSES[name]
    values = np.linspace(low, high, 41)
    excess = np.array([predicted({name: x})[row] for x in values]) - MEASURED[row]
    (changes,) = np.nonzero(excess[:-1] * excess[1:] <= 0.0)
    if not len(changes):
        return "none"
    near = slice(changes[0], changes[0] + 2)
    order = np.argsort(excess[near])
    return f"{np.interp(0.0, excess[near][order], values[near][order]):.3g}{unit}"


@cache
def pairs() -> list[tuple[float, tuple[str, ...]]]:
    """Return χ² of all pairs of causes and their names, the best first."""
    return sorted((best_values(pair)[1], pair) for pair in combinations(CAUSES, 2))


def causes_table() -> list[str]:
    """Return the table of causes: what each row needs, the best value and its χ²."""
    lines = [("none", "", "", "", "", f"{np.sum(((frequencies() - MEASURED) / ERRORS) ** 2):.1f}")]
    for names in (*((name,) for name in CAUSES), *(pair for _, pair in pairs()[:2])):
        values, square = best_values(names)
        best = ", ".join(f"{x:.3g}{CAUSES[name][0]}" for name, x in zip(names, values, strict=True))
        cells = [needed(names[0], row) for row in range(3)] if len(names) == 1 else ("", "", "")
        lines.append((" and ".join(names), *cells, best, f"{square:.1f}"))
    return markdown_table(("cause", *(f"for {x}" for x in ROWS), "best for all", "χ²"), lines)


@own_style()
def draw_causes() -> Any:
    """Draw the rest that single causes and the best pair leave, in uncertainties."""
    title = "Model minus measurement, in standard uncertainties"
    figure, (axes,) = new_panels(title, height=3.6)
    pair = pairs()[0][1]
    fits: Sequence[tuple[str, ...]] = [(), *((name,) for name in CAUSES), pair]
    for k, names in enumerate(fits):
        values = dict(zip(names, best_values(names)[0] if names else (), strict=True))
        rest = (predicted(values) - MEASURED) / ERRORS
        for row, colour in enumerate(COLOURS[:3]):
            axes.barh(k + 0.25 * (row - 1), rest[row], 0.22, color=colour)
    labels = ["no change", *CAUSES, " and\n".join(pair)]
    axes.set_yticks(range(len(fits)), labels)
    axes.invert_yaxis()
    for row, colour in zip(ROWS, COLOURS, strict=False):
        axes.barh([0], [0], color=colour, label=row)
    axes.set_xlim(-9.0, 2.5)
    axes.legend(**LEGEND, loc="center left")
    return figure


# page --------------------------------------------------------------------------------------------


def standard_errors() -> dict[str, Floats]:
    """Return the errors of the theory for pitches of 10.5 to 42 mm and friction up to 0.4."""
    known = waves((0.0, 0.1, 0.25, 0.4), tuple(x / 48.0 for x in (3.0, 8.5, 16.5, 24.5, 34.5)))
    known = known[:, known[0] == STANDARD]
    return {name: f(*known[:3])[1] / known[4] - 1.0 for name, f in THEORIES.items()}


def tables() -> dict[str, list[str]]:
    """Return the tables of the page by name."""
    return {"friction": friction_table(), "causes": causes_table()}


def quoted() -> list[tuple[str, str]]:
    """Return the numbers in the text of the page by name; errors in percent."""
    known, errors = estimate_errors()
    (_, gap, friction, *_), means = mean_errors()
    limits, gaps = gap_errors()
    near, smooth = gap < 0.75, friction == 0.0
    values = {"waves": waves(RANGE).shape[1], "estimated": known.shape[1], "means": len(gap)}
    values |= {"limits": largest(limits), "gaps": largest(gaps)}
    values |= {f"{name.split()[0]}.standard": largest(x) for name, x in standard_errors().items()}
    values |= dict(zip(("estimate", "power"), map(largest, errors.values()), strict=True))
    values |= {f"mean.{name.split()[-1]}": largest(error) for name, error in means.items()}
    simpson = means["Simpson"]
    values |= {"simpson": largest(simpson, near), "simpson.smooth": largest(simpson, near & smooth)}
    values |= {"thirteen": largest(errors["equation 13 · (1 + μ)^−0.4"], known[2] == 0.0)}
    for scene, best in product(SCENES, (False, True)):
        name = f"{scene}.{LAYOUTS[best]}"
        values |= {f"{name}.{key}": f"{x[2]:.2f}" for key, x in placed(scene, best).items()}
    return [(name, str(value)) for name, value in values.items()]


if __name__ == "__main__":
    write_csv(PATH, ("quantity", "value"), quoted())
    PAGE = PATH.with_suffix(".md")
    PAGE.write_text(fill_tables(PAGE.read_text("utf-8"), tables()), "utf-8")
    for name, figure in {
        "friction": draw_friction(), "means": draw_means(), "gaps": draw_gaps(),
        "placing": draw_placing(), "causes": draw_causes(),
    }.items():  # fmt: skip
        write_png(figure, PATH.with_name(f"open-questions-{name}.png"))
