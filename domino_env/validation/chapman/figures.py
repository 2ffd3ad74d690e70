"""The figures of Chapman, The physics of toppling dominoes, from our own numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from domino_env.core.colours import BLUE, COLOURS, PALE, PINK, RED
from domino_env.core.plot_style import LEGEND, new_figure, style, write_png
from domino_env.physics.layout import Layout
from domino_env.physics.motion import lean_behind
from domino_env.physics.physics import Physics
from domino_env.physics.standard import HEIGHT
from domino_env.physics.steady import existence_limit, steady_wave, terminal_speed_estimate
from domino_env.physics.wave import simulate
from domino_env.validation.chapman.tables import FRICTION, GRAVITY, THICKNESS
from domino_env.view.energy import energies

Floats = NDArray[np.float64]

PITCH, COUNT, PUSH = 0.016, 60, 5.0 * np.pi


def one_fall(path: Path) -> None:
    """Draw what energy each domino gives off and gains in one fall.

    Without friction, far down the row; what a domino gives and what it has are not the same, as
    the contacts share it out.
    """
    wave = simulate(Layout.uniform(COUNT, pitch=PITCH), Physics(0.0, GRAVITY, PUSH))
    layout, n, shown = wave.layout, COUNT - 5, 16
    angle = np.array([0.0, float(np.arcsin(layout.spacing[n] / HEIGHT))])
    high = lean_behind(layout, np.array([n, n]), angle)
    mass = layout.density * layout.height * layout.thickness * layout.width
    lift = 0.5 * (layout.height * np.cos(high) + layout.thickness * np.sin(high))
    given = (lift[0] - lift[1]) * mass * GRAVITY
    inertia = mass * (layout.height**2 + layout.thickness**2) / 3.0
    kinetic = []
    for theta, speed in zip(
        angle, (wave.release_velocity[n], wave.impact_velocity[n]), strict=True
    ):
        step = 1e-6
        beside = np.array([theta + step, theta + 2.0 * step])
        pair = lean_behind(layout, np.array([n, n]), beside)
        kinetic.append(0.5 * inertia * ((pair[1] - pair[0]) / step * speed) ** 2)
    figure, axes = _sheet("One fall, domino by domino (16 mm, no friction)")
    place = np.arange(shown)
    behind = [n - k for k in place]
    axes.bar(place - 0.2, 1e3 * given[behind], 0.4, color=BLUE, label="potential, given off")
    axes.bar(
        place + 0.2, 1e3 * (kinetic[1] - kinetic[0])[behind], 0.4, color=RED,
        label="kinetic, gained",
    )  # fmt: skip
    axes.set(xlabel="dominoes behind the leader", ylabel="energy [mJ]")
    _keep(figure, axes, path)


def sawtooth_of_energy(path: Path) -> None:
    """Draw the kinetic energy of a row over time: gravity gives, every hit takes."""
    from domino_env.physics.motion import Motion

    wave = simulate(Layout.uniform(30, pitch=PITCH), Physics(0.0, GRAVITY, PUSH))
    energy = energies(Motion(wave.layout, wave.physics))
    figure, axes = _sheet("Kinetic energy of a row (16 mm, no friction)")
    axes.plot(energy.time, 1e3 * energy.kinetic, color=BLUE)
    axes.set(xlabel="time [s]", ylabel="kinetic energy [mJ]", ylim=(0.0, None))
    _keep(figure, axes, path)


def sawtooth_of_speed(path: Path) -> None:
    """Draw the angular velocity of the leader over time, with the steady average."""
    wave = simulate(Layout.uniform(30, pitch=PITCH), Physics(0.0, GRAVITY, PUSH))
    times = np.repeat(wave.arrival_times, 2)[1:-1]
    speeds = np.column_stack([wave.release_velocity[:-1], wave.impact_velocity]).ravel()
    steady = steady_wave(PITCH, THICKNESS, physics=Physics(0.0, GRAVITY))
    average = np.arcsin((PITCH - THICKNESS) / HEIGHT) * steady.frequency
    figure, axes = _sheet("Angular velocity of the leading domino (16 mm, no friction)")
    axes.plot(times, speeds, color=BLUE, label="leader")
    axes.axhline(average, color=RED, linestyle="--", label=f"average {average:.3f} rad/s")
    axes.set(xlabel="time [s]", ylabel="angular velocity [rad/s]")
    _keep(figure, axes, path)


def correction_factor(path: Path) -> None:
    """Draw speed over √(3gL) by thickness/pitch, eq. 13 and simulated where a row carries a wave.

    The valid range is found by simulation: a row of 100 runs through after a push of 5π rad/s, and
    each domino can reach the next.
    """
    figure, axes = _sheet("Velocity correction factor, no friction")
    unit = np.sqrt(3.0 * GRAVITY * HEIGHT)
    for colour, ratio in zip(COLOURS, (0.02, 0.05, 0.1, 0.15625, 0.25, 0.35), strict=False):
        thick = ratio * HEIGHT
        dense = np.linspace(max(ratio / (1.0 + ratio) * 1.05, 0.02), existence_limit(thick), 60)[
            :-1
        ]
        found = np.array([d for d in dense if _runs(thick / d, thick)])
        if not len(found):
            continue
        guess = [terminal_speed_estimate(thick / d, thick, gravity=GRAVITY) / unit for d in found]
        true = [_steady_speed(thick / d, thick) / unit for d in found]
        axes.plot(found, guess, color=colour, label=f"d/L = {ratio:g}")
        axes.plot(found, true, color=colour, linestyle=":")
    axes.set(xlabel="d/λ", ylabel="v / √(3gL)   (lines eq. 13, dots simulated)", ylim=(0.5, 3.0))
    _keep(figure, axes, path)


def formula_against_simulation(path: Path) -> None:
    """Draw speed by d/λ of standard dominoes without friction: simulated, and eq. 13."""
    figure, axes = _sheet("Eq. 13 beside simulation (d/L = 0.15625, no friction)")
    unit = np.sqrt(3.0 * GRAVITY * HEIGHT)
    dense = np.linspace(0.15, 0.9, 90)
    found = [d for d in dense if _runs(THICKNESS / d, THICKNESS)]
    guess = [terminal_speed_estimate(THICKNESS / d, THICKNESS, gravity=GRAVITY) for d in found]
    true = [_steady_speed(THICKNESS / d, THICKNESS) for d in found]
    axes.plot(found, np.array(true) / unit, color=BLUE, label="simulated")
    axes.plot(found, np.array(guess) / unit, color=PINK, linestyle="--", label="eq. 13")
    axes.set(xlabel="d/λ", ylabel="v / √(3gL)")
    _keep(figure, axes, path)


def friction(path: Path) -> None:
    """Draw steady speed by friction between dominoes, beside a law from the literature.

    The factor (1+μ)^-0.4 does not describe this model; the legend says what exponent would, at the
    friction of the article.

    References
    ----------
    D. Cantor and K. Wojtacki, Effects of friction and spacing on the collaborative behavior of
    domino toppling, Physical Review Applied 17 (2022) 064021.
    """
    figure, axes = _sheet("What friction costs")
    mu = np.linspace(0.0, 0.6, 31)
    for colour, pitch in zip(COLOURS, (0.016, 0.024, 0.032), strict=False):
        speed = [
            steady_wave(pitch, THICKNESS, physics=Physics(float(m), GRAVITY)).speed for m in mu
        ]
        known = np.where(np.array(speed) > 0.0, speed, np.nan)
        part = steady_wave(pitch, THICKNESS, physics=Physics(FRICTION, GRAVITY)).speed / known[0]
        power = np.log(part) / np.log(1.0 + FRICTION)
        name = f"pitch {pitch * 1e3:.0f} mm, at μ = {FRICTION:g} as (1+μ)^{power:.2f}"
        axes.plot(mu, known / known[0], color=colour, label=name)
    name = "Cantor & Wojtacki: (1+μ)^−0.4, not this model"
    axes.plot(mu, (1.0 + mu) ** -0.4, color=PALE, linestyle="--", label=name)
    axes.set(xlabel="friction μ", ylabel="speed over that without friction", ylim=(0.0, 1.02))
    _keep(figure, axes, path)


FIGURES = {
    "one-fall": one_fall,
    "kinetic-energy": sawtooth_of_energy,
    "angular-velocity": sawtooth_of_speed,
    "correction-factor": correction_factor,
    "formula": formula_against_simulation,
    "friction": friction,
}


def _steady_speed(pitch: float, thickness: float) -> float:
    speed = steady_wave(pitch, thickness, physics=Physics(0.0, GRAVITY)).speed
    return speed if speed > 0.0 else float("nan")


def _runs(pitch: float, thickness: float) -> bool:
    """Whether a row of 100 can be built at this pitch and carries a wave to its end."""
    if not thickness < pitch < HEIGHT + thickness:
        return False
    row = Layout.uniform(100, pitch=pitch, thickness=thickness)
    return simulate(row, Physics(0.0, GRAVITY, PUSH), rtol=1e-5).mean_speed > 0.0


def _sheet(title: str) -> tuple[Figure, Axes]:
    figure = new_figure(7.0, 4.2)
    axes = figure.add_subplot()
    style(axes, title)
    return figure, axes


def _keep(figure: Figure, axes: Axes, path: Path) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(**LEGEND)
    write_png(figure, path)
