"""Figures and tables of Chapman, The physics of toppling dominoes, computed by the simulator."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from domino_env.core.colours import BLUE, COLOURS, PALE, RED
from domino_env.core.plot_style import LEGEND, new_axes, own_style, write_png
from domino_env.core.tables import markdown_table
from domino_env.core.types import Floats
from domino_env.physics import steady
from domino_env.physics.layout import Layout
from domino_env.physics.motion import stack_leans
from domino_env.physics.physics import Physics
from domino_env.physics.standard import HEIGHT
from domino_env.physics.wave import Wave, simulate

GRAVITY, THICKNESS = 9.8, 0.0075  # Chapman's [m/s²] and the standard domino's [m]
FRICTION, PUSH = 0.25, 5.0 * np.pi  # Chapman's, the push in rad/s
PITCHES = (0.016, 0.024, 0.032)  # [m]
SPEED_UNIT = math.sqrt(3.0 * GRAVITY * HEIGHT)  # [m/s]
PITCH_LABEL = "thickness d over pitch λ"
SPEED_LABEL = "steady speed over √(3gL), L height"
# as printed: after and before a hit, and "true" average [rad/s]; 17.80 is a misprint of 14.80
PRINTED_VELOCITIES = ((13.63, 17.25, 15.38), (14.83, 21.74, 18.16), (17.80, 24.80, 19.54))
# hits per second: Chapman's simulation, LMGC90, experiment
KNOWN_FREQUENCIES = ((59.7, 59.1, 64.4), (37.2, 36.9, 42.3), (26.2, 26.1, 28.1))


def _steady(pitch: float, thickness: float = THICKNESS, friction: float = 0.0) -> steady.SteadyWave:
    """Return the steady wave of equal dominoes, at a pitch and of a thickness [m]."""
    return steady.steady_wave(pitch, thickness, physics=Physics(friction, GRAVITY))


def equation_13(pitch: float, thickness: float) -> float:
    """Return the steady speed without friction by equation 13 of the article [m/s]."""
    ratio, width = thickness / pitch, thickness / HEIGHT
    energy = 1.0 - ratio - width * math.sqrt(1.0 - ratio * ratio)
    return SPEED_UNIT * math.sqrt(energy / ((1.0 - ratio) ** 2 * (1.0 + width * width)))


def angular_velocities() -> list[tuple[float, ...]]:
    """Compute the angular velocities of the leading domino without friction.

    Returns
    -------
    list of tuple
        A line per pitch: pitch [m]; angular velocities [rad/s] after a hit, before it, average
        (angle over time), geometric and arithmetic mean of the first two, and closed forms of these
        two by the energy argument of the article.
    """
    lines: list[tuple[float, ...]] = []
    for pitch in PITCHES:
        wave = _steady(pitch)
        after, before = float(wave.omega_release), float(wave.omega_impact)
        average = math.asin((pitch - THICKNESS) / HEIGHT) * wave.frequency
        means = math.sqrt(after * before), 0.5 * (after + before)
        remaining = after / before  # fraction of the angular velocity: (K-1)/K (eq. 9)
        per_pitch, per_height = THICKNESS / pitch, THICKNESS / HEIGHT
        # drop of the centre of mass of a domino between standing and its last lean (eq. 12)
        drop = 0.5 * HEIGHT * (1.0 - per_pitch - per_height * math.sqrt(1.0 - per_pitch**2))
        square = 6.0 * GRAVITY * drop / (HEIGHT**2 + THICKNESS**2)
        closed_forms = math.sqrt(remaining * square), math.sqrt(square / remaining)
        lines.append((pitch, after, before, average, *means, *closed_forms))
    return lines


def frequencies() -> list[tuple[float, ...]]:
    """Return a line per pitch: pitch [m], hits per second of the simulator, and the known ones."""
    return [
        (pitch, _steady(pitch, friction=FRICTION).frequency, *known)
        for pitch, known in zip(PITCHES, KNOWN_FREQUENCIES, strict=True)
    ]


def markdown() -> str:
    """Return the page with both tables, beside the printed numbers."""
    velocities = []
    for line, printed in zip(angular_velocities(), PRINTED_VELOCITIES, strict=True):
        pitch, average, low, high = line[0], line[3], line[6], line[7]
        cells = [
            # an asterisk at the misprint, which is 3 rad/s off
            f"{value:.3f} ({rounded:.2f}{'*' if abs(value - rounded) > 0.5 else ''})"
            for value, rounded in zip(line[1:4], printed, strict=True)
        ]
        means = [f"{mean:.2f} ({mean / average - 1.0:+.1%})" for mean in line[4:6]]
        velocities.append([f"{pitch * 1e3:.0f} mm", *cells, *means, f"{low:.3f}", f"{high:.3f}"])
    hits = [
        (f"{pitch * 1e3:.0f} mm", f"{model:.2f}", *known, f"{model / known[-1] - 1.0:+.1%}")
        for pitch, model, *known in frequencies()
    ]
    first = ("pitch", "ω−", "ω+", "average", "√(ω+ω−)", "½(ω+ + ω−)", "ω−, closed", "ω+, closed")
    second = ("pitch", "model", "Chapman", "LMGC90", "experiment", "model against experiment")
    return "\n".join([
        "# Chapman's tables, solved to rounding", "",
        "For readers of Chapman, *The physics of toppling dominoes*: its two tables, computed by",
        "this simulator for standard dominoes (48 × 24 × 7.5 mm) and g = 9.8 m/s²; in brackets the",
        "printed values. ω− and ω+ are the angular velocities of the leading domino just after and",
        "just before a hit in the steady wave; *closed* means the article's closed forms.", "",
        "## Table 1: angular velocities without friction [rad/s]", "",
        *markdown_table(first, velocities), "",
        "\\* misprint of 14.80", "",
        f"## Table 2: hits per second, friction {FRICTION}", "",
        *markdown_table(second, hits), "",
        "Continue with [the model](../physics.md) or [measured chains](../measured.md).", "",
    ])  # fmt: skip


# Figures ------------------------------------------------------------------------------------------


def draw_interval(axes: Axes) -> None:
    """Draw the energies of the leading domino and the 15 behind it over one interval."""
    wave, behind = _wave(60), np.arange(16)
    # a leader in the steady wave, and the step of its angle from which all rates follow [rad]
    layout, n, step = wave.layout, wave.layout.count - 5, 1e-6
    ends = np.array([0.0, math.asin(layout.spacing[n] / HEIGHT)])
    angles = np.concatenate([ends, ends + step, ends + 2.0 * step])
    lean, before, after = np.split(stack_leans(layout, np.full(6, n), angles), 3)
    mass = layout.density * layout.height * layout.thickness * layout.width
    centre = 0.5 * (layout.height * np.cos(lean) + layout.thickness * np.sin(lean))  # of mass [m]
    released = (centre[0] - centre[1]) * mass * GRAVITY
    inertia = mass * (layout.height**2 + layout.thickness**2) / 3.0
    speeds = np.array([[wave.release_velocity[n]], [wave.impact_velocity[n]]])
    kinetic = 0.5 * inertia * ((after - before) / step * speeds) ** 2
    # the two energies of a domino differ, because contacts transfer energy
    for offset, energy, colour, label in (
        (-0.2, released, BLUE, "potential, released"),
        (0.2, kinetic[1] - kinetic[0], RED, "kinetic, gained"),
    ):
        axes.bar(behind + offset, 1e3 * energy[n - behind], 0.4, color=colour, label=label)
    axes.set(xlabel="dominoes behind the leading one", ylabel="energy [mJ]")


def draw_angular_velocity(axes: Axes) -> None:
    """Draw the angular velocity of the leading domino over time."""
    wave = _wave(30)
    times = np.repeat(wave.arrival_times, 2)[1:-1]
    speeds = np.column_stack([wave.release_velocity[:-1], wave.impact_velocity]).ravel()
    average = np.arcsin((PITCHES[0] - THICKNESS) / HEIGHT) * _steady(PITCHES[0]).frequency
    axes.plot(times, speeds, color=BLUE, label="leading domino")
    label = f"average of the steady wave, {average:.3f} rad/s"
    axes.axhline(average, color=RED, linestyle="--", label=label)
    axes.set(xlabel="time [s]", ylabel="angular velocity [rad/s]")


def draw_formula(axes: Axes) -> None:
    """Draw speed over √(3gL) against d/λ for several d/L, by equation 13 and simulated."""
    for colour, ratio in zip(COLOURS, (0.02, 0.05, 0.1, 0.15625, 0.25, 0.35), strict=False):
        thickness = ratio * HEIGHT
        low = max(ratio / (1.0 + ratio) * 1.05, 0.02)  # 5 % above the out-of-reach limit
        ratios = np.linspace(low, steady.existence_limit(thickness), 60)[:-1]
        x, estimate, simulated = _speeds(ratios, thickness)
        label = f"d/L = {ratio:g}{' (standard)' * (thickness == THICKNESS)}"
        axes.plot(x, simulated, color=colour, label=label)
        axes.plot(x, estimate, color=colour, linestyle="--")
    axes.plot([], [], color="0.4", label="simulated")
    axes.plot([], [], color="0.4", linestyle="--", label="equation 13 of Chapman")
    axes.set(xlabel=PITCH_LABEL, ylabel=SPEED_LABEL, ylim=(0.5, 3.0))


def draw_friction(axes: Axes) -> None:
    """Draw the steady speed over that without friction, against the friction.

    The exponent in the legend makes a power of 1 + μ equal to the model at Chapman's friction.

    References
    ----------
    D. Cantor and K. Wojtacki, Effects of friction and spacing on the collaborative behavior of
    domino toppling, Physical Review Applied 17 (2022) 064021: (1+μ)^-0.4, which does not describe
    this model.
    """
    mu = np.linspace(0.0, 0.6, 31)
    for colour, pitch in zip(COLOURS, PITCHES, strict=False):
        speed = np.array([_steady(pitch, friction=float(m)).speed for m in mu])
        ratio = _steady(pitch, friction=FRICTION).speed / speed[0]
        power = np.log(ratio) / np.log(1.0 + FRICTION)
        label = f"pitch {pitch * 1e3:.0f} mm, at μ = {FRICTION:g} equal to (1+μ)$^{{{power:.2f}}}$"
        axes.plot(mu, np.where(speed > 0.0, speed, np.nan) / speed[0], color=colour, label=label)
    label = "Cantor & Wojtacki: (1+μ)$^{-0.4}$, not this model"
    axes.plot(mu, (1.0 + mu) ** -0.4, color=PALE, linestyle="--", label=label)
    axes.set(
        xlabel="friction coefficient μ",
        ylabel="steady speed over that without friction",
        ylim=(0.0, 1.02),
    )


FIGURES: dict[str, tuple[str, Callable[[Axes], None]]] = {
    "one-fall": (
        "One interval between hits, domino by domino (pitch 16 mm, no friction)", draw_interval
    ),
    "angular-velocity": (
        "Angular velocity of the leading domino (pitch 16 mm, no friction)", draw_angular_velocity
    ),
    "formula": (
        "Steady speed by Chapman's equation 13 and simulated, no friction", draw_formula
    ),
    "friction": ("Steady speed lost to friction", draw_friction),
}  # fmt: skip
"""Title and drawing function of each figure, by the name of its file."""


@own_style()
def draw(name: str, path: Path) -> None:
    """Draw a figure of `FIGURES` into a PNG file."""
    title, plot = FIGURES[name]
    figure, axes = new_axes(7.0, 4.2, title)
    plot(axes)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(**LEGEND)
    write_png(figure, path)


def _wave(count: int) -> Wave:
    """Return the wave of a uniform chain with the narrowest pitch and Chapman's push."""
    return simulate(Layout.uniform(count, pitch=PITCHES[0]), Physics(0.0, GRAVITY, PUSH))


def _speeds(ratios: Floats, thickness: float) -> tuple[Floats, Floats, Floats]:
    """Return d/λ where a chain of 100 completes, and speeds over √(3gL): by eq. 13, simulated."""
    smooth, lines = Physics(0.0, GRAVITY, PUSH), []
    for pitch in (thickness / ratios).tolist():
        if thickness < pitch < HEIGHT + thickness:
            layout = Layout.uniform(100, pitch=pitch, thickness=thickness)
            if simulate(layout, smooth, rtol=1e-5).mean_speed > 0.0:
                estimate = equation_13(pitch, thickness)
                speed = _steady(pitch, thickness).speed or math.nan
                lines.append((thickness / pitch, estimate / SPEED_UNIT, speed / SPEED_UNIT))
    x, estimates, speeds = np.array(lines).reshape(-1, 3).T
    return x, estimates, speeds
