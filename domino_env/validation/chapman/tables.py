"""The tables of Chapman, The physics of toppling dominoes, from our own numbers."""

from __future__ import annotations

import math

from domino_env.core.tables import markdown_table
from domino_env.physics.physics import Physics
from domino_env.physics.standard import HEIGHT
from domino_env.physics.steady import steady_wave

GRAVITY, THICKNESS = 9.8, 0.0075  # Chapman's [m/s²] and the standard domino's [m]
PITCHES = (0.016, 0.024, 0.032)  # [m]
# as printed: after and before a hit, and "true" average [rad/s]
PRINTED = ((13.63, 17.25, 15.38), (14.83, 21.74, 18.16), (17.80, 24.80, 19.54))
SOURCES = ("ours", "Chapman's simulation", "LMGC90", "experiment")
# hits a second: experiment, Chapman's simulation, LMGC90
MEASURED = ((64.4, 59.7, 59.1), (42.3, 37.2, 36.9), (28.1, 26.2, 26.1))
FRICTION = 0.25


def angular_velocities() -> list[tuple[float, ...]]:
    """Tabulate angular velocities without friction, a line a pitch [rad/s].

    Pitch [m], after a hit, before it, average (angle over time), geometric and arithmetic mean of
    the two, and the closed forms of both.
    """
    lines: list[tuple[float, ...]] = []
    for pitch in PITCHES:
        wave = steady_wave(pitch, THICKNESS, physics=Physics(0.0, GRAVITY))
        after, before = float(wave.omega_release), float(wave.omega_impact)
        average = math.asin((pitch - THICKNESS) / HEIGHT) * wave.frequency
        low, high = closed_forms(pitch, after / before)
        means = math.sqrt(after * before), 0.5 * (after + before)
        lines.append((pitch, after, before, average, *means, low, high))
    return lines


def closed_forms(pitch: float, kept: float) -> tuple[float, float]:
    """ω after and before a hit by the article's energy argument [rad/s].

    Parameters
    ----------
    pitch
        Pivot to pivot [m].
    kept
        (K-1)/K, the part of the leader's speed that a hit leaves (eq. 9).
    """
    ratio, flat = THICKNESS / pitch, THICKNESS / HEIGHT
    drop = 0.5 * HEIGHT * (1.0 - ratio - flat * math.sqrt(1.0 - ratio * ratio))  # eq. 12
    square = 6.0 * GRAVITY * drop / (HEIGHT**2 + THICKNESS**2)
    return math.sqrt(kept * square), math.sqrt(square / kept)


def frequencies() -> list[tuple[float, ...]]:
    """Tabulate hits a second, a line a pitch.

    Pitch [m], ours, then experiment, the article's simulation, LMGC90 [1/s].
    """
    return [
        (pitch, steady_wave(pitch, THICKNESS, physics=Physics(FRICTION, GRAVITY)).frequency, *told)
        for pitch, told in zip(PITCHES, MEASURED, strict=True)
    ]


def markdown() -> str:
    """Both tables, with what is misprinted in the seed."""
    velocities = []
    for line, printed in zip(angular_velocities(), PRINTED, strict=True):
        pitch, after, before, average, geometric, arithmetic, low, high = line
        cells = [
            f"{value:.3f} ({told:.2f}{'*' if abs(value - told) > 0.5 else ''})"
            for value, told in zip((after, before, average), printed, strict=True)
        ]
        means = [f"{m:.2f} ({m / average - 1.0:+.1%})" for m in (geometric, arithmetic)]
        velocities.append([f"{pitch * 1e3:.0f} mm", *cells, *means, f"{low:.3f}", f"{high:.3f}"])
    hits = [
        (f"{pitch * 1e3:.0f} mm", f"{ours:.2f}", seed, engine, experiment,
         f"{ours / experiment - 1.0:+.1%}")
        for pitch, ours, experiment, seed, engine in frequencies()
    ]  # fmt: skip
    text = [
        "# Chapman's tables, solved to rounding",
        "",
        "Standard dominoes (48 × 24 × 7.5 mm), g = 9.8 m/s²; in brackets what is printed.",
        "",
        "## Table 1: angular velocities without friction [rad/s]",
        "",
        *markdown_table(
            ("pitch", "ω−", "ω+", "average", "√(ω+ω−)", "½(ω+ + ω−)", "ω−, closed", "ω+, closed"),
            velocities,
        ),
        "",
        "\\* misprint: 14.80; the means printed beside it follow from 14.80. The printed averages "
        "carry the error of steps of 0.1 ms.",
        "",
        f"## Table 2: hits a second, friction {FRICTION}",
        "",
        *markdown_table(("pitch", *SOURCES, "ours against experiment"), hits),
    ]
    text += [
        "",
        "## Misprints in the text",
        "",
        "1. Eq. 3: the denominator is cos²(θ_i − θ_{i−1}), not (cos θ_i − cos θ_{i−1})².",
        "2. First lines of the two torque matrices: B_1 N_1 carries a minus sign.",
        "3. Energy of a cycle: ½ I (ω+² K(θ_c) − ω−² K(0)) = m g Δh, with K(θ_c) = K(0) − 1.",
        "4. The second closed form: ω−² = ((K−1)/K) · 6 g Δh/(L² + d²).",
        "5. Table 1, 32 mm: ω− is 14.80, not 17.80.",
    ]
    return "\n".join(text) + "\n"
