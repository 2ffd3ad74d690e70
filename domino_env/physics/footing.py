"""Geometry of chains on uneven ground, and layouts that cannot stand.

All functions take one layout or, with one more axis in front, a batch.
"""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Bools, Floats


def steps(spacing: Floats, thickness: Floats, rise: Floats, tilt: Floats) -> Floats:
    """Return the distance of each next pivot above the last, normal to its ground (…, N-1) [m]."""
    ahead = tilt[..., 1:]
    return (spacing + thickness[..., 1:]) * np.tan(ahead) + rise / np.cos(ahead)


def pitches(
    spacing: Floats, thickness: Floats, rise: Floats | None = None, tilt: Floats | None = None
) -> Floats:
    """Return the distances from pivot to pivot (…, N-1) [m]; by default on flat ground."""
    if rise is None or tilt is None:
        return spacing + thickness[..., 1:]
    return np.hypot(spacing + thickness[..., 1:], steps(spacing, thickness, rise, tilt))


def pivots(spacing: Floats, thickness: Floats, rise: Floats, tilt: Floats) -> Floats:
    """Return the front bottom edges (N, 2) [m], x forward and z up, the first at 0."""
    ahead = tilt[1:]
    forward = (spacing + thickness[1:] + rise * np.sin(ahead)) / np.cos(ahead)
    return np.concatenate((np.zeros((1, 2)), np.cumsum(np.stack([forward, rise], -1), axis=0)))


def find_violation(
    spacing: Floats,
    thickness: Floats,
    height: Floats,
    rise: Floats | None = None,
    tilt: Floats | None = None,
) -> tuple[tuple[int, ...], str] | None:
    """Find the first domino that cannot stand or fall; without rise and tilt the ground is flat.

    Returns
    -------
    tuple or None
        Index of the domino and a sentence about it; None if there is none.
    """
    if rise is None or tilt is None:
        if (height[..., :-1] <= height[..., 1:]).all():
            return None
        rise, tilt = np.zeros_like(spacing), np.zeros_like(thickness)
    height = np.broadcast_to(height, thickness.shape)
    for name, values, unit in (("rise", rise, "m"), ("tilt", tilt, "rad")):
        if (at := _first(~np.isfinite(values))) is not None:
            return at, f"{name}[{at[-1]}] = {values[at]} {unit}: must be finite"
    steepest = np.arctan2(thickness, height)
    if (at := _first(np.abs(tilt) >= steepest)) is not None:
        lean, most = np.degrees([tilt[at], steepest[at]])
        return at, (
            f"domino {at[-1]} does not stand: tilt[{at[-1]}] is {lean:.4g}°, and it tips over by "
            f"itself from {most:.4g}° on (the angle whose tangent is thickness over height); make "
            "the ground flatter there, or the domino thicker"
        )
    tall, ahead = height[..., :-1], height[..., 1:]
    (leaning, stair, high), meeting, up, strike = _links(spacing, thickness, height, rise, tilt)
    if (at := _first(leaning)) is not None:
        i = at[-1]
        return at, (
            f"dominoes {i} and {i + 1} lean against each other before anything falls, as the "
            f"ground between them is hollow: make spacing[{i}] = {spacing[at]} m more than "
            f"{meeting[at]:.6g} m, or the difference of their tilts smaller"
        )
    if (at := _first(stair)) is not None:
        i, most = at[-1], min(spacing[at], 0.999 * strike[at])
        return at, (
            f"domino {i + 1} stands {up[at]:.6g} m above domino {i}, seen from its own ground: "
            f"such a stair is outside the model; at most {most:.6g} m over this "
            f"spacing[{i}] = {spacing[at]} m"
        )
    if (at := _first(high)) is not None:
        i = at[-1]
        return at, (
            f"domino {i} (height {tall[at]} m) would strike {strike[at] - up[at]:.6g} m up, above "
            f"the top of domino {i + 1} (height[{i + 1}] = {ahead[at]} m), seen from its own "
            f"ground: widen spacing[{i}] = {spacing[at]} m, or make domino {i + 1} taller or the "
            "ground less hollow"
        )
    return None


def impassable(
    spacing: Floats, thickness: Floats, height: Floats, rise: Floats, tilt: Floats
) -> Bools:
    """Return the links (…, N-1), bool, at which `find_violation` finds something."""
    height = np.broadcast_to(height, thickness.shape)
    leaning, stair, high = _links(spacing, thickness, height, rise, tilt)[0]
    return leaning | stair | high


def _links(
    spacing: Floats, thickness: Floats, height: Floats, rise: Floats, tilt: Floats
) -> tuple[tuple[Bools, Bools, Bools], Floats, Floats, Floats]:
    """Return contacts (…, N-1) that cannot work, and their lengths [m].

    Pairs that lean before anything falls, lead up a stair, or would strike above a top; the gap
    below which they lean, the height of the next pivot, and the height at which the tip strikes.
    """
    tall, ahead = height[..., :-1], height[..., 1:]
    near = spacing < tall
    meeting = tall * np.sin(tilt[..., :-1] - tilt[..., 1:])
    up = steps(spacing, thickness, rise, tilt)
    strike = np.sqrt(np.maximum(tall**2 - spacing**2, 0.0))
    leaning, stair = meeting >= spacing, up > np.minimum(spacing, 0.999 * strike)
    high = strike - up > np.minimum(ahead * (1.0 + 1e-12), 1.999 * strike)
    return (near & leaning, near & stair, near & high), meeting, up, strike


def _first(wrong: Bools) -> tuple[int, ...] | None:
    places = np.argwhere(wrong)
    return tuple(int(k) for k in places[0]) if len(places) else None
