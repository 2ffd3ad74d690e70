"""Steady waves, smallest pushes and gaps by composition of maps, and closed forms.

An interval between hits, a face impact and a hit are affine maps of u = ω². Their composition over
a period of an endless chain is affine too, and its fixed point is the steady wave. Composition over
a whole chain gives a lower bound on the first u, which is the square of the smallest push.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.checks import numbers, require
from domino_env.core.types import Floats
from domino_env.kernels.arrays import FALL, RING_SIZE, Arrays
from domino_env.kernels.chain import compose_falls, period_falls
from domino_env.physics.gradient import arrays_from
from domino_env.physics.layout import Layout, require_sizes
from domino_env.physics.physics import STANDARD, Physics, require_arguments, require_physics
from domino_env.physics.standard import DENSITY, HEIGHT
from domino_env.physics.wave import MAX_RTOL, Outcome, setting_from

FIRST_RING_SIZE = 512  # dominoes behind the leader; doubled while those further back matter


@dataclass(frozen=True, eq=False)
class SteadyWave:
    """Steady wave of an endless chain, or the reason why there is none.

    For an array of chains every field is an array of the same shape.

    Attributes
    ----------
    exists
        True if there is a steady wave.
    explanation
        Sentence that states that there is a steady wave, or the reason why there is none.
    speed
        Mean speed [m/s]; 0 if there is none.
    frequency
        Hits per second [1/s]; 0 if there is none.
    omega_release
        Angular velocity of each leader just after it is hit [rad/s]; nan if there is no steady
        wave. This and the following fields have shape (P,) for a pattern of P dominoes.
    omega_impact
        Angular velocity of each leader just before it hits the next domino [rad/s], or nan.
    fall_times
        Intervals between hits [s], or nan.
    """

    exists: Any
    explanation: Any
    speed: Any
    frequency: Any
    omega_release: Any
    omega_impact: Any
    fall_times: Any


def steady_wave(
    pitch: ArrayLike,
    thickness: ArrayLike,
    height: ArrayLike = HEIGHT,
    physics: Physics = STANDARD,
    *,
    density: ArrayLike = DENSITY,
    slope: float = 0.0,
    rtol: float = 1e-11,
) -> SteadyWave:
    """Compute the steady wave of an endless uniform chain, or of each chain of an array.

    Parameters
    ----------
    pitch
        Distance from pivot to pivot [m]. An array gives one wave per value.
    thickness, height
        Thickness and height of every domino [m], broadcast with the pitch.
    physics
        Friction and gravity, by default those of `Physics()`; the push has no effect.
    density
        Density of every domino [kg/m³], broadcast with the pitch.
    slope
        Even slope of the ground, positive downhill [rad].
    rtol
        Relative error allowed in the times, more than 0, at most 1e-3.

    Returns
    -------
    SteadyWave
        Wave with numbers, or with arrays of the broadcast shape.

    Raises
    ------
    TypeError
        For physics of another type.
    ValueError
        For an argument out of its range, or a chain that cannot stand.

    Notes
    -----
    The contacts of the stack behind a leader follow from the leader's angle alone, so one period is
    enough and nothing else is simulated.

    Examples
    --------
    >>> steady_wave([0.016, 0.024, 0.032], 0.0075).speed.round(3)
    array([0.958, 0.894, 0.841])
    """
    sizes = _check_chains(physics, slope, rtol, (pitch, thickness, height, density))
    shape = np.broadcast(*sizes).shape
    chains = np.reshape(np.broadcast_arrays(*sizes), (4, -1, 1))
    waves = (_solve_pattern(chain, physics, slope, rtol) for chain in chains.swapaxes(0, 1))
    fields = [vars(wave).values() for wave in waves]
    if not shape:
        return SteadyWave(*(x.item() if isinstance(x, np.ndarray) else x for x in fields[0]))
    return SteadyWave(*(np.array(column).reshape(shape) for column in zip(*fields, strict=True)))


def steady_pattern(
    pitch: ArrayLike,
    thickness: ArrayLike,
    height: ArrayLike = HEIGHT,
    physics: Physics = STANDARD,
    *,
    density: ArrayLike = DENSITY,
    slope: float = 0.0,
    rtol: float = 1e-11,
) -> SteadyWave:
    """Compute the steady wave of an endless chain that repeats a pattern of P dominoes.

    Parameters
    ----------
    pitch
        (P,) distances from pivot j to j+1 [m]; the last is that to the first pivot of the next
        period.
    thickness, height
        Thickness and height of every domino, a number or (P,) [m].
    physics, slope, rtol
        As for `steady_wave`.
    density
        Density of every domino, a number or (P,) [kg/m³].

    Returns
    -------
    SteadyWave
        Wave with `omega_release`, `omega_impact` and `fall_times` of shape (P,).

    Raises
    ------
    TypeError
        For physics of another type.
    ValueError
        For an argument out of its range, or a chain that cannot stand.
    """
    sizes = _check_chains(physics, slope, rtol, (pitch, thickness, height, density))
    chain = np.array(np.broadcast_arrays(*map(np.atleast_1d, sizes)))
    return _solve_pattern(chain, physics, slope, rtol)


def _solve_pattern(chain: Floats, physics: Physics, slope: float, rtol: float) -> SteadyWave:
    """Return the steady wave of a pattern; chain (4, P): pitch, thickness, height and density."""
    pitches, thicknesses, heights, densities = chain
    count = len(thicknesses)
    successors = np.arange(1, count + 2) % count  # of dominoes 0 … count in the pattern
    gaps = pitches - thicknesses[successors[:-1]]
    rise = -np.sin(slope) * pitches
    pairs, dominoes = successors - 1, np.append(0, successors)
    Layout(  # checks one period and two dominoes of the next
        gaps[pairs], thicknesses[dominoes], heights[dominoes],
        density=densities[dominoes], rise=rise[pairs], tilt=slope,
    )  # fmt: skip
    if np.any(gaps >= heights):
        j = int(np.argmax(gaps >= heights))
        reason = f"gap {j} is {gaps[j]} m; make it less than the height, {heights[j]} m"
        return _no_wave(reason, count)
    ground = (rise, np.full(count, float(slope))) if slope != 0.0 else ()
    pattern = Arrays(gaps, thicknesses, heights, densities, *ground)
    # the steady wave is the fixed point of the map of one period
    falls, ring_size = np.zeros(count, FALL), FIRST_RING_SIZE
    while True:
        inputs = (pattern, setting_from(physics, rtol), ring_size)
        outcome, leader, tail, factor, offset, least_u = period_falls(*inputs, 0.0, True, falls)
        if tail <= rtol or ring_size == RING_SIZE:
            break
        ring_size *= 2
    if outcome != Outcome.PROPAGATED:
        reason = f"with domino {leader} of the pattern leading, {Outcome(outcome).explanation}"
        return _no_wave(reason, count)
    # u → factor u + offset; -1: no fixed point that waves approach
    u = offset / (1.0 - factor) if factor < 1.0 else -1.0
    if u <= max(least_u, 0.0):
        return _no_wave(
            "the chain releases less energy than its hits and friction dissipate; use wider gaps, "
            "thinner dominoes or less friction",
            count,
        )
    outcome, leader, *_ = period_falls(*inputs, u, False, falls)
    if outcome != Outcome.PROPAGATED:
        return _no_wave(f"domino {leader} of the pattern nearly stops; change its gap", count)
    period = float(falls["time"].sum())
    speed, frequency = float((gaps + thicknesses).sum()) / period, count / period
    intervals = (falls[name].copy() for name in ("release", "impact", "time"))
    return SteadyWave(True, "the chain has a steady wave", speed, frequency, *intervals)


def _check_chains(
    physics: Physics, slope: float, rtol: float, chain: tuple[ArrayLike, ...]
) -> tuple[Floats, ...]:
    """Return pitch, thickness, height and density as arrays; raise for values out of range."""
    require_physics(physics)
    require("rtol", rtol, above=0.0, high=MAX_RTOL)
    require("slope", slope, -0.5 * math.pi, 0.5 * math.pi, "rad")
    names = ("pitch", "thickness", "height", "density")
    sizes = tuple(map(numbers, names, chain))
    require_sizes(dict(zip(names, sizes, strict=True)))
    shapes = [size.shape for size in sizes]
    try:
        shape = np.broadcast_shapes(*shapes)
    except ValueError:
        given = ", ".join(f"{name} {shape}" for name, shape in zip(names, shapes, strict=True))
        raise ValueError(f"shapes {given}: give numbers, or arrays of one shape") from None
    if 0 in shape:
        raise ValueError(f"the sizes have shape {shape}: give one chain or more")
    return sizes


def _no_wave(reason: str, count: int) -> SteadyWave:
    """Return the result for a pattern of `count` dominoes without steady wave, with the reason."""
    unknown = [np.full(count, np.nan)] * 3
    return SteadyWave(False, f"there is no steady wave: {reason}", 0.0, 0.0, *unknown)


def smallest_push(layout: Layout, physics: Physics = STANDARD, rtol: float = 1e-12) -> float:
    """Compute the angular velocity of domino 0 below which the wave stops.

    Parameters
    ----------
    layout
        The layout.
    physics
        Friction and gravity; the push has no effect.
    rtol
        Relative error allowed in the push, more than 0, at most 1e-3.

    Returns
    -------
    float
        Smallest push [rad/s]; inf if no push is enough, because of a gap out of reach, friction
        that jams the chain, or no rigid answer. It is never 0, as the first domino has to be lifted
        over its edge.

    Raises
    ------
    TypeError
        For a layout or physics of another type.
    ValueError
        For `rtol` out of its range.
    """
    require_arguments(layout, physics)
    require("rtol", rtol, above=0.0, high=MAX_RTOL)
    outcome, least_u = compose_falls(arrays_from(layout), setting_from(physics, rtol))
    if outcome != Outcome.PROPAGATED:
        return math.inf
    return math.sqrt(max(float(least_u), 0.0))


def smallest_gap(
    thickness: float, height: float = HEIGHT, physics: Physics = STANDARD, count: int = 100
) -> float:
    """Compute the smallest equal gap at which the wave of a chain completes.

    With narrow gaps a weak push cannot get the first dominoes over their edges; after a strong push
    the limit of the steady wave decides in long chains.

    Parameters
    ----------
    thickness, height
        Thickness and height of every domino [m].
    physics
        Friction, gravity and push.
    count
        Number of dominoes, 2 or more.

    Returns
    -------
    float
        Gap [m], to a relative error of 1e-6; 1e-4 heights if that is enough,
        and inf if the wave completes at no gap.

    Raises
    ------
    TypeError
        For physics of another type.
    ValueError
        For an argument out of its range.

    Notes
    -----
    For a hundred dominoes of thickness d = a · height with 0.05 ≤ a ≤ 0.3, friction μ ≤ 0.3 and a
    push of p = 1.5 to 50 times that which just tips a single domino, the gap is within 16 % of
    d √(s² + (1.35/p)²). Here s = 2 b²/(1 - b²) with b² = a² + μ (a/2 + 3a²/4) is the limit of the
    steady wave, without friction eq. 79 of van Leeuwen (`existence_limit`); the other term is that
    of the first dominoes. The constants are fitted.

    Examples
    --------
    >>> round(1e3 * smallest_gap(0.0075), 2)
    3.49
    """
    require_physics(physics)
    require("height", height, above=0.0, unit="m")
    require("thickness", thickness, above=0.0, below=height, unit="m", hint="in metres")
    require("count", count, 2, whole=True)

    def completes(gap: float) -> bool:
        layout = Layout.uniform(count, spacing=gap, thickness=thickness, height=height)
        return smallest_push(layout, physics, rtol=1e-6) <= physics.push

    # from narrow gaps on: there may be an upper limit too, beyond which the first domino stops
    gaps = height * np.geomspace(1e-4, 0.999, 60)
    wide = next((k for k, gap in enumerate(gaps) if completes(gap)), None)
    if wide is None:
        return math.inf
    low, high = gaps[max(wide - 1, 0)], gaps[wide]
    while high - low > 1e-6 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if completes(middle) else (middle, high)
    return float(high)


def speed_estimate(
    pitch: float, thickness: float, height: float = HEIGHT, physics: Physics = STANDARD
) -> float:
    """Estimate the speed of the steady wave by a closed form [m/s].

    Its error is at most 1.5 % for thicknesses of 0.02 to 0.3 heights, gaps from 0.1 heights (or
    half a thickness, if that is more) to 0.7 heights and frictions up to 0.3. Other chains are
    rejected; `steady_wave` has no such limits.

    Parameters
    ----------
    pitch
        Distance from pivot to pivot [m].
    thickness, height
        Thickness and height of every domino [m].
    physics
        Friction and gravity; the push has no effect.

    Returns
    -------
    float
        Speed [m/s].

    Raises
    ------
    TypeError
        For physics of another type.
    ValueError
        For an argument out of the range of the formula.

    Notes
    -----
    With pitch λ, thickness d, height L, r = d/λ, gap s in heights and sin θ = s,

        v = (λ/θ) √(3 g E / (L (1 + d²/L²))) (1 + 0.022 tan² θ)
        E = (1 - r) / (1 + μ (0.645 + 1.94 r + 0.72 s))² - (d/L) √(1 - r²) / (1 + μ (3.56 - 1.62 s))

    Without friction E is the energy that a chain releases per domino, 2 Δh/L of Chapman, eq. 12,
    and the root is the geometric mean of the angular velocities before and after a hit. Friction
    reduces the share of the falling domino (first term) and that of its lifted edge (second). The
    constants are fitted to `steady_wave`; docs/open-questions.md has the derivation.

    Examples
    --------
    >>> round(speed_estimate(0.024, 0.0075), 2)
    0.89
    """
    require_physics(physics)
    require("height", height, above=0.0, unit="m")
    hint = "steady_wave has no such limit"
    require("thickness", thickness, 0.02 * height, 0.3 * height, "m", hint)
    low, slack = max(0.1 * height, 0.5 * thickness), 1e-9 * height  # slack for rounded sums
    low, high = thickness + low - slack, thickness + 0.7 * height + slack
    require("pitch", pitch, low, high, "m", hint)
    require("friction", physics.friction, 0.0, 0.3, hint=hint)
    width, gap, ratio = thickness / height, (pitch - thickness) / height, thickness / pitch
    mu, angle = physics.friction, math.asin(gap)
    falling = (1.0 - ratio) / (1.0 + mu * (0.645 + 1.94 * ratio + 0.72 * gap)) ** 2
    lifted = width * math.sqrt(1.0 - ratio * ratio) / (1.0 + mu * (3.56 - 1.62 * gap))
    square = 3.0 * physics.gravity / height * (falling - lifted) / (1.0 + width * width)
    return pitch / angle * math.sqrt(square) * (1.0 + 0.022 * math.tan(angle) ** 2)


def existence_limit(thickness: float, height: float = HEIGHT) -> float:
    """Return the largest thickness/pitch of a steady wave without friction.

    It is (1 - a²)/(1 + a²) with a = thickness/height; above it a fall releases no energy.

    Parameters
    ----------
    thickness, height
        Thickness and height of every domino [m].

    Returns
    -------
    float
        Ratio, without unit.

    Raises
    ------
    ValueError
        For a size out of its range.

    References
    ----------
    J. M. J. van Leeuwen, The domino effect (2004), arXiv physics/0401018, eq. 79.
    """
    require("height", height, above=0.0, unit="m")
    require("thickness", thickness, above=0.0, below=height, unit="m", hint="in metres")
    square = (thickness / height) ** 2
    return (1.0 - square) / (1.0 + square)
