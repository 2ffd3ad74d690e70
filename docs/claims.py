"""Check published claims about domino waves: python docs/claims.py.

It writes the tables of claims.md, its pictures and claims.csv in half a minute; then
``python docs/pages.py`` writes the numbers in the text. Rigid-body simulations are read from
claims.csv; ``--simulate`` makes them anew in 20 minutes.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterator
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

import domino_env as de
from domino_env.core.colours import COLOURS, INK, PALE
from domino_env.core.plot_style import LEGEND, new_axes, new_figure, own_style, style, write_png
from domino_env.core.tables import fill_tables, markdown_table, write_csv
from domino_env.core.types import Floats
from domino_env.rigid.engine import simulate_in_engine
from domino_env.rigid.simulation import simulate_standing
from domino_env.validation.source import shipped_sources

Line = dict[str, Any]
PATH = Path(__file__).with_suffix(".csv")
COLUMNS = "quantity", "friction", "floor", "gap", "value", "error", "toppled"
STANDARD = 7.5 / 48.0  # thickness of a standard domino [height]
FRICTIONS = (0.0, 0.1, 0.25)
GAPS, THICKNESSES = np.linspace(0.1, 0.8, 8), np.linspace(0.05, 0.3, 6)  # of steady waves [height]
PARTS = {"all": (0.0, 1.0), "0.1 to 0.4": (0.0, 0.45), "0.5 to 0.8": (0.45, 1.0)}
# frictions between free-standing dominoes, gaps [mm], frictions of the floor
MAP = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5), (3, 5, 8, 12, 16, 20, 24, 28, 33, 38), (0.3, 1.0)
CHAINS = {
    "speed": MAP, "floors": ((0.05,), (8, 20), (0.1, 0.2, 0.5, 2.0)),
    "engine": ((0.05,), (12, 38), MAP[2]),
}  # fmt: skip
MEASURED = [(chain.x, chain.value) for chain in shipped_sources()["mclachlan"].chains]
LENGTH, TIME = 30.0, 4.21  # of the record of 2008 [m], [s]
PUSH = 8.0 * np.sqrt(0.048 / 9.81)  # 8 rad/s for a standard domino, in √(gravity/height)


def units(friction: float, push: float = 100.0) -> de.Physics:
    """Return physics in units of the height and √(gravity/height)."""
    return de.Physics(friction=friction, gravity=1.0, push=push)


def steady_speed(gap: Any, friction: float, thickness: Any = STANDARD) -> Any:
    """Return the speed of the steady wave in √(gravity · height); sizes in heights."""
    return de.steady_wave(gap + thickness, thickness, 1.0, units(friction)).speed


def largest(function: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Return the largest value of a function between two gaps, and its gap."""
    best = minimize_scalar(lambda gap: -function(gap), bounds=(low, high))
    return -best.fun, best.x


def label(axes: Any, heading: str, x: str, y: str = "", **legend: Any) -> None:
    """Style axes, set their labels and draw the legend."""
    style(axes, heading)
    axes.set(xlabel=x, ylabel=y)
    axes.legend(**LEGEND | legend)


# 1. scaling of the speed -------------------------------------------------------------------------


def fit(logs: Floats, values: Floats) -> tuple[Floats, Floats, float]:
    """Return slopes, their standard errors and the RMS residual of a linear least-squares fit."""
    design = np.vstack([np.ones_like(values), logs]).T
    solution = np.linalg.lstsq(design, values, rcond=None)[0]
    residual = values - design @ solution
    variance = residual @ residual / (len(values) - len(solution))
    errors = np.sqrt(variance * np.diag(np.linalg.inv(design.T @ design)))
    return solution[1:], errors[1:], float(np.sqrt(np.mean(residual**2)))


def scaling(friction: float, part: str = "all", pitch: bool = False) -> tuple[Any, ...]:
    """Return the fit of a power law to a part of the grid, and how far the claimed law is off.

    The latter is the constant of the law and the largest factor to it. With `pitch`, the distance
    in it is the pitch instead of the gap.
    """
    gap, thickness = np.meshgrid(GAPS, THICKNESSES)
    speed, (low, high) = steady_speed(gap, friction, thickness), PARTS[part]
    chosen = (speed > 0.0) & (gap > low) & (gap < high)
    gap, thickness, logs = gap[chosen], thickness[chosen], np.log(speed[chosen])
    over = logs - 0.5 * np.log((gap + pitch * thickness) * thickness)
    off = np.exp(over.mean()), np.exp(np.abs(over - over.mean()).max())
    return *fit(np.log([gap, thickness]), logs), *off, len(gap)


def scaling_table() -> list[str]:
    """Return the table of fitted exponents."""
    cells = []
    for friction, part in product(FRICTIONS, PARTS):
        slopes, errors, residual, _, factor, count = scaling(friction, part)
        powers = (f"{slope:.2f} ± {error:.2f}" for slope, error in zip(slopes, errors, strict=True))
        cells.append((f"{friction:g}", part, count, *powers, f"{residual:.1%}", f"{factor:.1f}"))
    names = "friction", "gaps [height]", "layouts", "exponent of the gap", "of the thickness"
    return markdown_table((*names, "residual", "largest factor to the law"), cells)


@own_style()
def draw_scaling() -> Any:
    """Draw speeds over the gap, with the claimed law dashed."""
    figure, gaps = new_figure(7.5, 3.9), np.linspace(0.1, 0.8, 60)
    for axes, friction in zip(figure.subplots(1, 2), FRICTIONS[::2], strict=True):
        for thickness, colour in zip(THICKNESSES[:5:2], COLOURS, strict=False):
            speeds, law = steady_speed(gaps, friction, thickness), np.sqrt(gaps * thickness)
            axes.plot(gaps, speeds, color=colour, label=f"thickness {thickness:g}")
            axes.plot(gaps, scaling(friction)[3] * law, "--", color=colour, linewidth=1.2)
        axes.plot(*zip(*MEASURED, strict=True), "o", color=INK, label="measured, thickness 0.179")
        axes.set_ylim(0.0, 4.4)
        title = f"Friction {friction:g}; dashed: the claimed law"
        label(axes, title, "gap [height]", "speed [√(gravity · height)]")
    return figure


# 2. friction of the floor ------------------------------------------------------------------------


def simulate_floor(friction: float, gap: float, floor: float, quantity: str = "speed") -> Line:
    """Return the speed from domino 11 to 30, 0 if the wave stops, and its relative error.

    Gaps are in mm; the quantity "engine" is simulated by Chipmunk.
    """
    chain = de.Layout.uniform(30, spacing=1e-3 * gap), de.Physics(friction=friction), floor
    wave = simulate_in_engine(*chain) if quantity == "engine" else simulate_standing(*chain, 2e-4)
    (first, last), speed, error = wave.arrival_times[[10, -1]], 0.0, 0.0
    if wave.propagated:
        speed = np.ptp(wave.layout.positions[10:]) / (last - first)
        error = wave.error_estimate * (first + last) / (last - first)
    cells = quantity, friction, floor, gap, f"{speed:.5f}", f"{error:.1e}", wave.toppled
    return dict(zip(COLUMNS, cells, strict=True))


def ratios(lines: list[Line], quantity: str = "speed") -> tuple[Floats, Floats]:
    """Return by how much chains are faster on the first floor than on the last, and the error [%].

    Both have shape (frictions, gaps); nan where the wave stops on a floor.
    """
    shape, chosen = map(len, CHAINS[quantity]), [x for x in lines if x["quantity"] == quantity]
    numbers = np.array([(float(x["value"]) or np.nan, float(x["error"])) for x in chosen])
    speed, error = numbers.T.reshape(2, *shape)
    ratio = 100.0 * (speed[..., 0] / speed[..., -1] - 1.0)
    return ratio, 100.0 * (error[..., 0] + error[..., -1]) + 0.0 * ratio


@own_style()
def draw_floors(lines: list[Line]) -> Any:
    """Draw the map of the ratio of speeds on the two floors."""
    (ratio, error), title = ratios(lines), "How much faster the wave is on a floor of friction 0.3"
    figure, axes = new_axes(
        7.5, 3.6, f"{title} than on one of 1.0 [%]", facecolor=PALE,
        xlabel="gap [mm]; lines: around cells in which the smoother floor is faster",
        ylabel="friction between dominoes",
    )  # fmt: skip
    axes.grid(visible=False)
    axes.pcolormesh(np.clip(ratio, -4.5, 4.5), cmap="RdBu_r", vmin=-9.0, vmax=9.0)
    is_faster = np.kron(ratio > error, np.ones((20, 20)))
    axes.contour(is_faster, [0.5], extent=(0, 10, 0, 6), colors=INK, linewidths=2.0)
    for (y, x), one in np.ndenumerate(ratio):
        text = "stops" if np.isnan(one) else f"{one:+.1f}" if abs(one) > error[y, x] else "≈ 0"
        axes.text(x + 0.5, y + 0.5, text, ha="center", va="center", color=INK, size=9)
    axes.set_xticks(np.arange(10) + 0.5, [*map(str, MAP[1])])
    axes.set_yticks(np.arange(6) + 0.5, [*map(str, MAP[0])])
    return figure


# 3. magnification --------------------------------------------------------------------------------


def growing(factor: float, gap: float, thickness: float = STANDARD, count: int = 40) -> de.Layout:
    """Return dominoes that are `factor` times as large as those before; sizes in heights."""
    heights = factor ** np.arange(count)
    return de.Layout(gap * heights[:-1], thickness * heights, heights)


def largest_factor(gap: float, physics: de.Physics, *sizes: Any) -> float:
    """Return the largest factor with which all dominoes topple, to 1e-5; 1 if there is none."""
    low, high = 1.0, 4.0
    while high - low > 1e-5:
        factor = 0.5 * (low + high)
        wave = de.simulate(growing(factor, gap, *sizes), physics)
        low, high = (factor, high) if wave.outcome == de.Outcome.PROPAGATED else (low, factor)
    return low


@cache
def best_factor(friction: float, thickness: float = STANDARD) -> tuple[float, float]:
    """Return the largest factor over all gaps, and its gap in heights of the domino before."""
    return largest(lambda gap: largest_factor(gap, units(friction), thickness), 0.4, 0.99)


def simulate_growing() -> Iterator[Line]:
    """Yield how many dominoes topple in rigid-body simulations near the largest factor."""
    for friction in FRICTIONS:
        best, gap = best_factor(friction)
        for floor, part in ((None, 0.95), (None, 1.05), (1.0, 0.95)):
            layout = growing(part * best, gap, count=8)
            wave = simulate_standing(layout, units(friction, 1.4), floor, 1e-2)
            cells = friction, floor, f"{gap:.4f}", f"{part * best:.4f}", None, wave.toppled
            yield dict(zip(COLUMNS, ("growth", *cells), strict=True))


def growth_table(lines: list[Line]) -> list[str]:
    """Return the table of largest factors, and of dominoes that topple as rigid bodies."""
    toppled = [line["toppled"] for line in lines if line["quantity"] == "growth"]
    cells = []
    for k, friction in enumerate(FRICTIONS):
        best, gap = best_factor(friction)
        others = (f"{best_factor(friction, thickness)[0]:.2f}" for thickness in (0.1, 0.25))
        cells.append((f"{friction:g}", f"{best:.3f}", f"{gap:.2f}", *others, *toppled[3 * k :][:3]))
    names = (
        "friction", "largest factor", "at gap [height]", "largest at thickness 0.1",
        "at thickness 0.25", "of 8 topple, factor 5 % less", "5 % more", "5 % less, floor 1",
    )  # fmt: skip
    return markdown_table(names, cells)


@own_style()
def draw_growth() -> Any:
    """Draw the largest factor over gap and over friction."""
    figure, gaps, frictions = new_figure(7.5, 3.7), np.linspace(0.1, 0.99, 90), np.arange(9) / 16
    left, right = figure.subplots(1, 2, sharey=True)
    for friction, colour in zip(FRICTIONS, COLOURS, strict=False):
        factors = [largest_factor(gap, units(friction)) for gap in gaps]
        left.plot(gaps, factors, color=colour, label=f"friction {friction:g}")
    for thickness, colour in zip((0.1, STANDARD, 0.25), COLOURS[3:], strict=False):
        factors = [best_factor(friction, thickness)[0] for friction in frictions]
        right.plot(frictions, factors, color=colour, label=f"thickness {thickness:.3g}")
    right.plot(0.0, 2.0, "o", color=INK, label="van Leeuwen, as reported", clip_on=False)
    title, y = "Standard proportions (thickness 0.156)", "largest factor between neighbours"
    label(left, title, "gap [height of the domino before]", y)
    label(right, "Best gap for each friction", "friction between dominoes")
    return figure


# 4. the record of 2008 ---------------------------------------------------------------------------


@cache
def fastest(friction: float) -> tuple[float, float]:
    """Return speed and gap of the fastest steady wave, in √(gravity · height) and heights."""
    return largest(lambda gap: steady_speed(gap, friction), 0.002, 0.5)


def needed_height(speed: float) -> float:
    """Return the height [m] with which a speed in √(gravity · height) is that of the record."""
    return float((LENGTH / TIME / speed) ** 2 / 9.81)


def started_height(friction: float) -> float:
    """Return the least height [m] of a row with equal gaps that takes the time with its start."""
    gaps = np.arange(0.04, 0.8, 0.004)[:, None]
    spacing = np.repeat(gaps, 299, axis=1)
    waves = de.simulate_batch(spacing, STANDARD, units(friction, PUSH), height=1)
    heights = LENGTH / ((gaps + STANDARD) * np.arange(1, 300))  # the row ends at domino 2, 3, …
    return float(heights[waves.arrival_times[:, 1:] * np.sqrt(heights / 9.81) <= TIME].min())


def record_table() -> list[str]:
    """Return the table of heights of stones that are as fast as the record."""
    cells = []
    for friction in (*FRICTIONS, 0.5):
        speed, gap = fastest(friction)
        speeds = speed, *steady_speed(np.array([0.2, 0.4, 0.6]), friction)
        heights = *map(needed_height, speeds), started_height(friction)
        cells.append((f"{friction:g}", f"{gap:.3f}", *(f"{height:.2f}" for height in heights)))
    names = (
        "friction", "best gap [height]", "height there [m]", "at gap 0.2 [m]", "at gap 0.4 [m]",
        "at gap 0.6 [m]", "row of 30 m from a push [m]",
    )  # fmt: skip
    return markdown_table(names, cells)


@own_style()
def draw_record() -> Any:
    """Draw the speed of endless chains over the height of the stones."""
    figure, axes = new_axes(7.5, 3.9, xlim=(0.0, 5.0), ylim=(0.0, 14.0))
    heights, record = np.linspace(0.0, 5.0, 200), LENGTH / TIME
    for friction, colour in zip((*FRICTIONS, 0.5), COLOURS, strict=False):
        best, wide = fastest(friction)[0], steady_speed(0.4, friction)
        speeds, height = best * np.sqrt(9.81 * heights), needed_height(best)
        axes.plot(heights, speeds, color=colour, label=f"friction {friction:g}: {height:.2f} m")
        axes.plot(heights, wide / best * speeds, "--", color=colour, linewidth=1.2)
        axes.plot([height], [record], "o", color=colour)
    axes.axhline(record, color=INK, linewidth=1.0, label=f"record: {record:.2f} m/s")
    title = "Endless chains of standard proportions: best gap; dashed: gap of 0.4 heights"
    label(axes, title, "height of the stones [m]", "speed [m/s]", title="height for the record")
    return figure


# page --------------------------------------------------------------------------------------------


def tables(lines: list[Line]) -> dict[str, list[str]]:
    """Return the tables of the page by name."""
    return {"scaling": scaling_table(), "growth": growth_table(lines), "record": record_table()}


def quoted(lines: list[Line]) -> list[Line]:
    """Return a line for each number in the text of the page."""
    (slope,), (slope_error,), _ = fit(np.log(MEASURED)[:, :1].T, np.log(MEASURED)[:, 1])
    (ratio, error), floors = ratios(lines), ratios(lines, "floors")[0]
    off = ([scaling(mu, pitch=pitch)[4] for mu in FRICTIONS] for pitch in (False, True))
    values = dict(zip(("law", "law.pitch"), (f"{max(one):.1f}" for one in off), strict=True))
    values |= {"measured": f"{slope:.2f}", "measured.error": f"{slope_error:.2f}"}
    values |= {"most": f"{np.nanmax(ratio):.1f}", "least": f"{-np.nanmin(ratio):.1f}"}
    values |= {"error": f"{np.nanmedian(error):.2f}", "floors": f"{floors.min():.1f}"}
    row = MAP[0].index(CHAINS["engine"][0][0])
    for gap, engine in zip(CHAINS["engine"][1], ratios(lines, "engine")[0][0], strict=True):
        values[f"engine.{gap}"] = f"{engine:+.1f}"
        values[f"reference.{gap}"] = f"{ratio[row, MAP[1].index(gap)]:+.1f}"
    for friction in FRICTIONS[::2]:
        values[f"factor.{friction:g}"] = f"{best_factor(friction)[0]:.2f}"
        values[f"height.{friction:g}"] = f"{needed_height(fastest(friction)[0]):.2f}"
        values[f"started.{friction:g}"] = f"{started_height(friction):.1f}"
    return [{"quantity": name, "value": value} for name, value in values.items()]


def simulated() -> Iterator[Line]:
    """Yield the lines of all rigid-body simulations."""
    for quantity, axes in CHAINS.items():
        yield from (simulate_floor(*chain, quantity) for chain in product(*axes))
    yield from simulate_growing()


def read_lines() -> list[Line]:
    """Return the lines of simulations in claims.csv."""
    lines = csv.DictReader(PATH.read_text("utf-8").splitlines())
    return [line for line in lines if line["gap"]]


if __name__ == "__main__":
    LINES = list(simulated()) if "--simulate" in sys.argv else read_lines()
    write_csv(PATH, COLUMNS, ([x.get(name) for name in COLUMNS] for x in quoted(LINES) + LINES))
    PAGE = PATH.with_suffix(".md")
    PAGE.write_text(fill_tables(PAGE.read_text("utf-8"), tables(LINES)), "utf-8")
    drawn = {"scaling": draw_scaling(), "floors": draw_floors(LINES)}
    for name, figure in (drawn | {"growth": draw_growth(), "record": draw_record()}).items():
        write_png(figure, PATH.with_name(f"claims-{name}.png"))
