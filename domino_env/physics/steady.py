"""Waves without a simulation: the steady wave, the smallest push, Chapman's closed forms.

A fall, a flush and a hit are affine maps of u = ω², so a period of an endless row is one too, and
so is a whole chain: a fixed point is the steady wave, a lower bound on u_0 the smallest push.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env import kernels
from domino_env.physics.gradient import arrays_of
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics, require_arguments
from domino_env.physics.standard import DENSITY, HEIGHT
from domino_env.physics.wave import Outcome

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SteadyWave:
    """The wave that an endless row carries for ever, or why there is none.

    Attributes
    ----------
    exists
        Whether there is one.
    explanation
        Why there is none.
    speed
        Over a whole period [m/s]; 0 where there is none.
    frequency
        Hits a second, over a whole period; 0 where there is none.
    omega_release
        Angular velocity of each leader just after it is hit [rad/s]: a number for a uniform row,
        (P,) for a pattern; nan where there is none.
    omega_impact
        The same just before it hits.
    fall_times
        Seconds between hits, likewise.
    """

    exists: bool
    explanation: str
    speed: float
    frequency: float
    omega_release: float | Floats
    omega_impact: float | Floats
    fall_times: float | Floats


def steady_wave(
    pitch: ArrayLike,
    thickness: ArrayLike,
    height: ArrayLike = HEIGHT,
    physics: Physics | None = None,
    *,
    density: ArrayLike = DENSITY,
    slope: float = 0.0,
    rtol: float = 1e-11,
) -> SteadyWave:
    """Find the steady wave of an endless uniform row, or of one that repeats a pattern.

    Parameters
    ----------
    pitch
        Pivot to pivot [m]: a number, or (P,) from domino j to j+1, the last to the next period's
        first.
    thickness
        A number or (P,) [m].
    height
        A number or (P,) [m].
    physics
        Friction and gravity, by default 0.25 and 9.81 m/s²; the push plays no part.
    density
        A number or (P,) [kg/m³].
    slope
        Of the ground, an even one, positive downhill [rad].
    rtol
        Relative error allowed in the times.

    Raises
    ------
    ValueError
        For rows that cannot stand.

    Notes
    -----
    The contact states of the stack behind a leader follow from its angles alone, so nothing is
    simulated but the P falls of one period.

    Examples
    --------
    >>> import domino_env as de
    >>> round(de.steady_wave(0.024, 0.0075).speed, 4)
    0.8939
    """
    physics = physics or Physics()
    shapes = [np.asarray(a, dtype=np.float64) for a in (pitch, thickness, height, density)]
    scalar = all(a.ndim == 0 for a in shapes)
    pitches, thick, tall, rho = (
        np.ascontiguousarray(a) for a in np.broadcast_arrays(*(np.atleast_1d(a) for a in shapes))
    )
    gaps = pitches - np.roll(thick, -1)
    rise = -np.sin(slope) * pitches
    Layout(  # checks a period and the first domino of the next
        np.append(gaps, gaps[0]),
        np.append(thick, [thick[0], thick[1 % len(thick)]]),
        np.append(tall, [tall[0], tall[1 % len(tall)]]),
        density=np.append(rho, [rho[0], rho[1 % len(rho)]]),
        rise=np.append(rise, rise[0]),
        tilt=slope,
    )
    if np.any(gaps >= tall):
        j = int(np.argmax(gaps >= tall))
        return _none(f"gap {j} of the pattern, {gaps[j]} m, is out of reach", scalar, len(thick))
    ground = (rise, np.full(len(thick), float(slope))) if slope != 0.0 else ()
    return _fixed_point(kernels.Arrays(gaps, thick, tall, rho, *ground), physics, rtol, scalar)


def _fixed_point(
    pattern: kernels.Arrays, physics: Physics, rtol: float, scalar: bool
) -> SteadyWave:
    gaps, thick = pattern.spacing, pattern.thickness
    falls = np.zeros(len(thick), kernels.FALL)
    ring_rows = 512
    while True:
        setting = (pattern, physics.friction, physics.gravity, rtol, ring_rows)
        outcome, leader, tail, gain, offset, need = kernels.period_falls(*setting, 0.0, True, falls)
        if tail <= rtol or ring_rows == kernels.RING_SIZE:
            break
        ring_rows *= 2
    if outcome != Outcome.PROPAGATED:
        why = f"under domino {leader} of the pattern, {Outcome(outcome).explanation}"
        return _none(why, scalar, len(thick))
    u = offset / (1.0 - gain) if gain < 1.0 else -1.0
    if u <= max(need, 0.0):
        return _none(
            "the row gives back less energy than its hits and friction take; use wider gaps, "
            "thinner dominoes or less friction",
            scalar,
            len(thick),
        )
    outcome, leader, *_ = kernels.period_falls(*setting, u, False, falls)
    if outcome != Outcome.PROPAGATED:
        return _none(
            f"a hair from a stall under domino {leader} of the pattern", scalar, len(thick)
        )
    period = float(falls["time"].sum())
    speed, frequency = float((gaps + thick).sum()) / period, len(thick) / period
    told = (falls[name] for name in ("release", "impact", "time"))
    each = (float(values[0]) if scalar else values.copy() for values in told)
    return SteadyWave(True, "the row carries a steady wave", speed, frequency, *each)


def _none(why: str, scalar: bool, period: int) -> SteadyWave:
    blank = float("nan") if scalar else np.full(period, np.nan)
    return SteadyWave(False, f"there is no steady wave: {why}", 0.0, 0.0, blank, blank, blank)


def smallest_push(layout: Layout, physics: Physics, rtol: float = 1e-12) -> float:
    """Find the angular velocity of domino 0 below which the wave dies [rad/s].

    Parameters
    ----------
    layout
        What stands.
    physics
        Friction and gravity; the push plays no part.
    rtol
        Relative error allowed in the push.

    Returns
    -------
    float
        inf where no push helps: a gap out of reach, friction that jams the row, or no rigid
        answer. 0 where the first domino, tipped by a breath, topples the row (it never is: it has
        to be lifted over its edge).

    Examples
    --------
    >>> import domino_env as de
    >>> layout = de.Layout.uniform(100, pitch=0.024, thickness=0.0075)
    >>> round(de.smallest_push(layout, de.Physics()), 3)
    2.695
    """
    require_arguments(layout, physics)
    outcome, need = kernels.compose_falls(
        arrays_of(layout), physics.friction, physics.gravity, rtol
    )
    if outcome != Outcome.PROPAGATED:
        return math.inf
    return math.sqrt(max(float(need), 0.0))


def terminal_speed_estimate(
    pitch: float, thickness: float, height: float = HEIGHT, gravity: float = 9.81
) -> float:
    """Estimate the speed of the steady wave of thin, frictionless dominoes [m/s].

    Parameters
    ----------
    pitch
        Pivot to pivot [m].
    thickness
        [m]
    height
        [m]
    gravity
        [m/s²]

    Raises
    ------
    ValueError
        Where the formula has no answer, as no energy is released (eq. 12).

    References
    ----------
    Chapman, The physics of toppling dominoes, eq. 13.
    """
    lean, slender = thickness / pitch, thickness / height
    if not 0.0 < lean < 1.0:
        raise ValueError(f"pitch = {pitch} m must be more than thickness = {thickness} m > 0")
    drop = 1.0 - lean - slender * math.sqrt(1.0 - lean * lean)
    if drop <= 0.0:
        raise ValueError(
            f"thickness/pitch = {lean:.6g} is not below {existence_limit(thickness, height):.6g}: "
            "a domino that falls releases no energy (van Leeuwen 2004, eq. 79); widen the pitch"
        )
    correction = drop / ((1.0 - lean) ** 2 * (1.0 + slender * slender))
    return math.sqrt(3.0 * gravity * height * correction)


def existence_limit(thickness: float, height: float = HEIGHT) -> float:
    """Return the thickness/pitch from which on no frictionless wave can be steady.

    (1 - a²)/(1 + a²) with a = thickness/height: beyond it a fall releases no energy.

    References
    ----------
    J. M. J. van Leeuwen, The domino effect (2004), arXiv physics/0401018, eq. 79.
    """
    a2 = (thickness / height) ** 2
    return (1.0 - a2) / (1.0 + a2)
