"""Why the best layouts have wide gaps at both ends and narrow ones in between.

    python examples/why_the_bathtub_wins.py          # prints the tables of docs/why.md
    python examples/why_the_bathtub_wins.py --write  # writes them and the three pictures there

It takes a minute. Chains are those of the scene `sprint` unless a column says otherwise.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import domino_env as de
from domino_env.core.colours import COLOURS, INK, PALE
from domino_env.core.plot_style import LEGEND, new_axes, own_style, write_png
from domino_env.core.tables import fill_tables, markdown_table
from optimize import search
from optimize.experiments.best_known import best_known

DOCS = Path(__file__).resolve().parents[1] / "docs"
SPRINT, BEST = de.load_scene("sprint"), best_known()["sprint"].layout.spacing
EQUAL = SPRINT.uniform()
GAP = EQUAL.layout.spacing[0]
RELAY = de.load_scene("relay")
THICKNESS, NARROW, WIDE = 0.0075, 0.002, 0.040  # [m]
PARTS = {
    "start, 1 to 8": slice(0, 8),
    "middle, 9 to 28": slice(8, 28),
    "end, 29 to 39": slice(28, 39),
}
START = 12  # gaps that are free where the end effect is excluded
FRICTIONS = (0.0, 0.1, 0.25, 0.5)
BEHIND = 60  # dominoes that are added behind a layout
BUDGET = 2000  # evaluations of a search


def simulate(spacing, physics=SPRINT.physics):
    return de.simulate(de.Layout(spacing, THICKNESS), physics)


def simulate_equal(gaps, pairs, thickness=THICKNESS, physics=SPRINT.physics):
    """Return the waves of layouts with equal gaps [m], one for each gap."""
    return de.simulate_batch(np.repeat(gaps[:, None], pairs, axis=1), thickness, physics)


def percent(speed, reference):
    return f"{speed / reference - 1.0:+z.2%}"


# parts of the best layout -----------------------------------------------------------------------


def parts():
    """Return the table of gains with a part of the best known gaps alone, and with all others."""
    lines = []
    for name, part in (PARTS | {"all": slice(None)}).items():
        alone, without = EQUAL.layout.spacing.copy(), BEST.copy()
        alone[part], without[part] = BEST[part], GAP
        gains = [percent(simulate(one).mean_speed, EQUAL.score) for one in (alone, without)]
        leads = []  # [m] over a point that moves at the mean speed of the equal gaps
        for spacing in (EQUAL.layout.spacing, BEST):
            times = np.diff(simulate(spacing).arrival_times)
            leads.append((spacing + THICKNESS - EQUAL.score * times)[part].sum())
        lines.append((name, *gains, *(f"{1e3 * lead:+z.1f}" for lead in leads)))
    names = ("gaps", "applied alone", "all but these", "lead, equal gaps [mm]", "lead, best [mm]")
    return markdown_table(names, lines)


def fastest(sizes, starts, physics=SPRINT.physics):
    """Return the fastest spacing whose groups of gaps are equal, by local searches."""
    first = np.cumsum([0, *sizes[:-1]])

    def negative_speed(values):
        layout = de.Layout(np.repeat(1e-3 * values, sizes), THICKNESS)
        wave = de.simulate(layout, physics, gradient=True)
        if wave.outcome is not de.Outcome.PROPAGATED:
            return 0.0, np.zeros(len(values))
        gradient = np.add.reduceat(wave.gradient("speed").spacing, first)
        return -wave.mean_speed, -1e-3 * gradient

    bounds = [(1e3 * NARROW, 1e3 * WIDE)] * len(sizes)
    ends = (
        minimize(negative_speed, 1e3 * start[first], jac=True, method="L-BFGS-B", bounds=bounds)
        for start in starts
    )
    return np.repeat(1e-3 * min(ends, key=lambda end: end.fun).x, sizes)


def only_the_start(count, gap, physics=SPRINT.physics):
    """Return the fastest spacing of which all gaps but the first twelve are equal."""
    sizes = [1] * START + [count - 1 - START]
    rest = (np.full(count - 1 - START, factor * gap) for factor in (1.0, 0.6, 0.4))
    starts = [np.r_[BEST[:START], gaps] for gaps in rest]
    return fastest(sizes, starts, physics)


def freedom():
    """Return the table of gains if only some gaps may differ from the others."""
    count, lines = SPRINT.count - 1, []
    for name, first, last in (
        ("the first", 1, 0), ("the first 12", START, 0), ("the first 27", 27, 0),
        ("the last 3", 0, 3), ("the last 12", 0, 12), ("all", count, 0),
    ):  # fmt: skip
        sizes = [1] * first + [count - first - last] * (first + last < count) + [1] * last
        starts = []
        for middle, end in ((0.6 * GAP, BEST), (GAP, BEST), (GAP, np.roll(BEST, 2))):
            start = np.full(count, middle)
            start[:first], start[count - last :] = BEST[:first], end[count - last :]
            starts.append(start)
        lines.append((name, percent(simulate(fastest(sizes, starts)).mean_speed, EQUAL.score)))
    return markdown_table(("gaps that may differ", "gain"), lines)


def continued():
    """Return the table of gains of chains that continue with equal gaps behind the last domino."""
    layouts = {
        "equal gaps": EQUAL.layout.spacing,
        "best known": BEST,
        "start free, rest equal": only_the_start(SPRINT.count, GAP),
    }
    ends = [SPRINT.count - 1, SPRINT.count + 2, SPRINT.count - 1 + BEHIND]
    lines, equal = [], None
    for name, spacing in layouts.items():
        wave = simulate(np.r_[spacing, np.full(BEHIND, GAP)])
        speeds = wave.layout.positions[ends] / wave.arrival_times[ends]
        equal = speeds if equal is None else equal
        released = wave.release_velocity[SPRINT.count - 1]
        lines.append((name, f"{released:.1f} rad/s", *map(percent, speeds, equal)))
    names = ("first 39 gaps", "last domino starts with", *(f"to domino {end + 1}" for end in ends))
    return markdown_table(names, lines)


# equal gaps ---------------------------------------------------------------------------------------


def equal_gaps():
    """Return the table of equal gaps: speeds of forty dominoes and of an endless chain."""
    lines = []
    for gap in (0.003, 0.006, 0.011, 0.018, 0.025):
        steady = de.steady_wave(gap + THICKNESS, THICKNESS, physics=SPRINT.physics).speed
        forty, wave = (simulate(np.full(count, gap)) for count in (SPRINT.count - 1, 300))
        numbers = ["stops", "0", "–", "–"]
        if forty.outcome is de.Outcome.PROPAGATED:
            settled = np.flatnonzero(wave.local_speed < 0.99 * steady)[-1] + 1
            lost = wave.arrival_times[-1] - 300 * (gap + THICKNESS) / steady
            slowest = forty.release_velocity.min()
            numbers = [f"{forty.mean_speed:.3f}", f"{slowest:.1f}", settled, f"{1e3 * lost:.0f}"]
        lean = np.degrees(np.arcsin(gap / SPRINT.height))
        lines.append((f"{1e3 * gap:g}", f"{lean:.1f}°", f"{steady:.3f}", *numbers))
    names = ("gap [mm]", "lean at the hit", "endless chain [m/s]", "forty dominoes [m/s]")
    names += ("slowest start of a domino [rad/s]", "dominoes to within 1 % of steady")
    return markdown_table((*names, "time lost at the start [ms]"), lines)


def clock_started_late(late=200):
    """Return the fastest equal gap [m] of forty dominoes that follow many others."""
    gaps, last = np.arange(0.001, 0.025, 0.0001), late + SPRINT.count - 1
    times = simulate_equal(gaps, last, physics=de.Physics(push=60.0)).arrival_times
    return gaps[np.argmax((gaps + THICKNESS) / (times[:, last] - times[:, late]))]


def any_number(length):
    """Return the equal gap [m] of the fastest row of a length [m] with any number of dominoes."""
    gaps = length / np.arange(15, 120) - THICKNESS
    waves = (simulate(np.full(round(length / (gap + THICKNESS)), gap)) for gap in gaps)
    return gaps[np.argmax([wave.mean_speed for wave in waves])]


def wide_after(gap):
    """Return the speeds [m/s] in the first gaps of 30 mm after a hundred others."""
    layout = de.Layout(np.r_[np.full(100, gap), np.full(4, 0.030)], THICKNESS)
    return de.simulate(layout, de.Physics(push=60.0)).local_speed[100:]


def least_gap(thickness):
    """Return the smallest equal gap [m] with which forty dominoes of a thickness [m] complete."""
    gaps = np.arange(0.0005, 0.02, 0.0001)
    waves = simulate_equal(gaps, SPRINT.count - 1, thickness)
    return gaps[waves.outcome == de.Outcome.PROPAGATED][0]


def endless_gap(friction):
    """Return the gap of the fastest endless chain [m]."""
    physics = de.Physics(friction=friction)
    gaps = np.arange(0.0005, 0.012, 0.00001)
    return gaps[np.argmax(de.steady_wave(gaps + THICKNESS, THICKNESS, physics=physics).speed)]


# other scenes -------------------------------------------------------------------------------------


def scenes():
    """Return the scenes of the last table by name, one change of `sprint` each."""
    friction, push = SPRINT.physics.friction, SPRINT.physics.push
    cases = {f"{n} dominoes": SPRINT.replace(count=n) for n in (20, 40, 100)}
    cases["1000 dominoes"] = de.load_scene("marathon")
    for mu in (0.0, 0.5):
        cases[f"friction {mu:g}"] = SPRINT.replace(physics=de.Physics(friction=mu, push=push))
    for omega in (3.0, 30.0):
        physics = de.Physics(friction=friction, push=omega)
        cases[f"push {omega:g} rad/s"] = SPRINT.replace(physics=physics)
    cases["length 997 mm"] = SPRINT.replace(length=SPRINT.uniform().layout.length)
    return cases


def best_layout(name, scene, budget):
    """Return the best known layout, or that of a search."""
    record = {"40 dominoes": "sprint", "1000 dominoes": "marathon"}.get(name)
    if record:
        return best_known()[record].layout
    return search(scene, budget=budget, seed=0).layout


def smoothed(budget=BUDGET):
    """Return the gains without friction of a search, and of its layout with smoothed first gaps."""
    scene = scenes()["friction 0"]
    gaps = best_layout("friction 0", scene, budget).spacing
    smooth = gaps.copy()
    smooth[1:8] = 0.25 * gaps[:7] + 0.5 * gaps[1:8] + 0.25 * gaps[2:9]
    return [
        percent(simulate(s, scene.physics).mean_speed, scene.uniform().score)
        for s in (gaps, smooth)
    ]


def other_scenes(budget=BUDGET, cases=None):
    """Return baseline and gains, with and without the end effect, of other scenes."""
    lines = []
    for name, scene in (cases or scenes()).items():
        equal = scene.uniform()
        gap = equal.layout.spacing[0]
        best = best_layout(name, scene, budget)
        speed = scene.simulate(best).mean_speed
        start = ("–", "–")
        if not scene.length:
            spacing = only_the_start(scene.count, gap, scene.physics)
            gain = percent(simulate(spacing, scene.physics).mean_speed, equal.score)
            start = (f"{1e3 * spacing[-1]:.1f}", gain)
        middle = f"{1e3 * np.median(best.spacing):.1f}"
        numbers = f"{1e3 * gap:.1f}", f"{equal.score:.3f}", middle, percent(speed, equal.score)
        lines.append((name, *numbers, *start))
    names = ("chain", "best equal gap [mm]", "its speed [m/s]", "best layout: median gap [mm]")
    names += ("its gain", "first 12 free: equal gap of the rest [mm]", "its gain")
    return markdown_table(names, lines)


# a run-out ----------------------------------------------------------------------------------------


def start_gaps(scene, excess, decay):
    """Return gaps s + A exp(-k/c)/√k, k = 1, 2, …, of a run-out with gaps s [m]."""
    k = np.arange(1.0, scene.count)
    return np.clip(scene.run_out.spacing + excess * np.exp(-k / decay) / np.sqrt(k), *scene.spacing)


def fit_start(scene):
    """Return A [m] and c for which the formula of `start_gaps` is fastest, and its speed."""

    def slowness(point):
        gaps = start_gaps(scene, 1e-3 * point[0], max(point[1], 0.1))
        return -scene.evaluate(scene.batch(gaps[None])).score[0]

    options = {"maxfev": 200, "xatol": 1e-3, "fatol": 1e-6}
    best = minimize(slowness, (28.0, 10.0), method="Nelder-Mead", options=options)
    return 1e-3 * best.x[0], best.x[1], -best.fun


def run_outs(budget=BUDGET, pushes=(4.0, 8.0, 16.0), frictions=(0.1, 0.25)):
    """Return gains with the run-out of `relay` for several pushes and frictions."""
    lines = []
    for friction in frictions:
        for push in pushes:
            scene = RELAY.replace(physics=de.Physics(friction=friction, push=push))
            equal = scene.uniform()
            is_relay = scene.physics == RELAY.physics
            layout = best_known()["relay"].layout if is_relay else None
            layout = layout or search(scene, budget=budget, seed=0).layout
            speed, (excess, decay, by_formula) = scene.score(layout), fit_start(scene)
            share = (by_formula - equal.score) / (speed - equal.score)
            gaps = ", ".join(f"{1e3 * gap:.1f}" for gap in layout.spacing[[0, 1, 2, 4, 9, 49]])
            lines.append((
                f"{push:g} rad/s, {friction:g}", f"{1e3 * equal.layout.spacing[0]:.1f}",
                percent(speed, equal.score), gaps, f"{1e3 * excess:.0f}, {decay:.1f}",
                f"{share:.0%}",
            ))  # fmt: skip
    names = ("push, friction", "best equal gap [mm]", "gain", "gaps 1, 2, 3, 5, 10, 50 [mm]")
    return markdown_table((*names, "A [mm], c", "share of the gain"), lines)


@own_style()
def draw_relay():
    """Draw the best known gaps of `sprint` and of `relay`, with its run-out."""
    figure, axes = new_axes(
        7.5, 3.4, "A row that ends, and a row whose wave must go on (push 8 rad/s, friction 0.25)",
        xlabel="number of the gap from the pushed domino", ylabel="gap [mm]", ylim=(0.0, 42.0),
    )  # fmt: skip
    gaps = best_known()["relay"].layout.spacing
    number = np.arange(1, RELAY.row_count)
    axes.plot(number[: len(BEST)], 1e3 * BEST, ".-", color=COLOURS[1], label="sprint: 40 dominoes")
    label = "relay: 100 designed dominoes"
    axes.plot(number[: len(gaps)], 1e3 * gaps, ".-", color=COLOURS[0], label=label)
    fixed = np.full(RELAY.run_out.count, 1e3 * RELAY.run_out.spacing)
    label = "relay: run-out, 60 at 3 mm"
    axes.plot(number[len(gaps) :], fixed, color=INK, linewidth=1.2, label=label)
    axes.legend(**LEGEND)
    return figure


# pictures -----------------------------------------------------------------------------------------


@own_style()
def draw_gaps(budget=BUDGET):
    """Draw the best gaps along the chain for several frictions."""
    x = "number of the gap from the pushed domino; dashed: the best equal gap"
    title = "The fastest layouts of forty dominoes, push 8 rad/s"
    labels = {"xlabel": x, "ylabel": "gap [mm]", "ylim": (0.0, 42.0)}
    figure, axes = new_axes(7.5, 3.6, title, **labels)
    for k, (friction, colour) in enumerate(zip(FRICTIONS, COLOURS, strict=False)):
        scene = SPRINT.replace(physics=de.Physics(friction=friction, push=SPRINT.physics.push))
        spacing = BEST if scene == SPRINT else search(scene, budget=budget, seed=0).layout.spacing
        equal = 1e3 * scene.uniform().layout.spacing[0]
        number = np.arange(1, len(spacing) + 1)
        axes.plot(number, 1e3 * spacing, ".-", color=colour, label=f"friction {friction:g}")
        dashes = (6 * k, (6, 6 * len(FRICTIONS) - 6))  # lines at the same height take turns
        axes.axhline(equal, color=colour, linewidth=1.5, linestyle=dashes)
    axes.legend(**LEGEND, ncols=2, loc="upper center")
    return figure


@own_style()
def draw_map(size=240):
    """Draw speed over equal gap and push; grey where the wave stops."""
    gaps = np.linspace(0.0005, 0.047, size)
    pushes = np.linspace(0.5, 16.0, size)
    waves = [simulate_equal(gaps, len(BEST), physics=de.Physics(push=push)) for push in pushes]
    speed = np.array([np.where(wave.mean_speed > 0.0, wave.mean_speed, np.nan) for wave in waves])
    figure, axes = new_axes(
        7.5, 3.9, "Forty dominoes with equal gaps, friction 0.25: mean speed", facecolor=PALE,
        xlabel="gap between neighbours [mm]",
        ylabel="push: angular velocity of the first domino [rad/s]",
    )  # fmt: skip
    axes.grid(visible=False)
    image = axes.pcolormesh(1e3 * gaps, pushes, speed, cmap="viridis", rasterized=True)
    completing = ~np.isnan(speed).all(axis=1)
    fastest_place = np.clip(np.nanargmax(speed[completing], axis=1), 1, size - 2)
    # the vertex of the parabola through three speeds, which lies between the gaps of the map
    before, middle, after = (
        np.take_along_axis(speed[completing], (fastest_place + k)[:, None], axis=1)[:, 0]
        for k in (-1, 0, 1)
    )
    shift = 0.5 * (before - after) / (before - 2.0 * middle + after)
    best = gaps[fastest_place] + shift * (gaps[1] - gaps[0])
    axes.plot(1e3 * best, pushes[completing], color=INK, linewidth=1.5)
    axes.annotate("fastest gap for each push", (19.5, 7.5), color=INK, size=9)
    axes.annotate("stops", (1.5, 0.9), color=INK, size=9)
    figure.colorbar(image, label="mean speed [m/s]")
    return figure


def cheap_tables():
    """Return the tables that need no search."""
    return {"parts": parts(), "freedom": freedom(), "continued": continued(), "equal": equal_gaps()}


def quoted():
    """Return the numbers in the text of docs/why.md, with the words around them."""
    least = {0.004: "from", THICKNESS: "of 7.5 mm from", 0.012: "of 12 mm from"}
    return [
        f"{1e3 * clock_started_late():.1f} mm as well",
        f"is {1e3 * any_number(EQUAL.layout.length):.1f} mm instead of",
        "{:.2f}, {:.2f}, {:.2f} and {:.2f} m/s".format(*wide_after(0.011)),
        f"after gaps of 30 mm {wide_after(0.030)[0]:.2f} m/s",
        *(f"{words} {1e3 * least_gap(size):.1f} mm" for size, words in least.items()),
        "(¼, ½, ¼) the gain is {1} instead of {0}".format(*smoothed()),
    ]


if __name__ == "__main__":
    tables = cheap_tables() | {"others": other_scenes(), "run_out": run_outs()}
    print("\n\n".join("\n".join(table) for table in tables.values()), "", *quoted(), sep="\n")
    print("local speeds of the best layout:", *np.round(simulate(BEST).local_speed, 2))
    for mu in FRICTIONS:
        print(f"friction {mu:g}: fastest endless chain at {1e3 * endless_gap(mu):.2f} mm")
    if "--write" in sys.argv:
        page = DOCS / "why.md"
        page.write_text(fill_tables(page.read_text("utf-8"), tables), "utf-8")
        write_png(draw_gaps(), DOCS / "why-gaps.png")
        write_png(draw_map(), DOCS / "why-map.png")
        write_png(draw_relay(), DOCS / "why-relay.png")
