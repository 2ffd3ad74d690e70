"""Geometry of chains on uneven ground, and layouts that cannot stand.

All functions but `pivots` take one layout, or a batch with one more axis in front.
"""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Bools, Floats

MAX_STEP = 0.999  # largest ratio of the next pivot's rise to the height at which the tip strikes


def normal_rises(spacing: Floats, thickness: Floats, rise: Floats, tilt: Floats) -> Floats:
    """Return the rise of each next pivot, normal to the ground under it (…, N-1) [m]."""
    ahead = tilt[..., 1:]
    return (spacing + thickness[..., 1:]) * np.tan(ahead) + rise / np.cos(ahead)


def pitches(
    spacing: Floats, thickness: Floats, rise: Floats | None = None, tilt: Floats | None = None
) -> Floats:
    """Return the distances from pivot to pivot (…, N-1) [m]; by default on flat ground."""
    if rise is None or tilt is None:
        return spacing + thickness[..., 1:]
    return np.hypot(spacing + thickness[..., 1:], normal_rises(spacing, thickness, rise, tilt))


def pivots(spacing: Floats, thickness: Floats, rise: Floats, tilt: Floats) -> Floats:
    """Return the front bottom edges of a layout (N, 2) [m], x forward and z up, the first at 0."""
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
    """Find a domino that cannot stand, or a contact that the model does not cover.

    Without rise and tilt the ground is flat. Sizes are not checked.

    Returns
    -------
    tuple or None
        Index (i,) of the domino, or of the domino behind a contact, and a sentence about it. In a
        batch the index is (b, i). None if there is none.
    """
    if rise is None or tilt is None:
        if (height[..., :-1] <= height[..., 1:]).all():
            return None
        rise, tilt = np.zeros_like(spacing), np.zeros_like(thickness)
    height = np.broadcast_to(height, thickness.shape)
    for name, values, unit in (("rise", rise, "m"), ("tilt", tilt, "rad")):
        if (at := _first_index(~np.isfinite(values))) is not None:
            return at, f"{name}[{at[-1]}] = {values[at]} {unit}: give a finite number"
    steepest = np.arctan2(thickness, height)
    if (at := _first_index(np.abs(tilt) >= steepest)) is not None:
        slope, limit = np.degrees([tilt[at], steepest[at]])
        return at, (
            f"domino {at[-1]} does not stand: tilt[{at[-1]}] is {slope:.4g}°, and it tips over by "
            f"itself from {limit:.4g}° on (the angle whose tangent is thickness over height); make "
            "the ground flatter there, or the domino thicker"
        )
    behind, ahead = height[..., :-1], height[..., 1:]
    faults, least_gap, offset, strike = _contact_faults(spacing, thickness, height, rise, tilt)
    leaning, too_high, overshoot = faults
    if (at := _first_index(leaning)) is not None:
        i = at[-1]
        return at, (
            f"dominoes {i} and {i + 1} lean against each other before anything falls, as the "
            f"ground between them is hollow: make spacing[{i}] = {spacing[at]} m more than "
            f"{least_gap[at]:.6g} m, or the difference of their tilts smaller"
        )
    if (at := _first_index(too_high)) is not None:
        i, limit = at[-1], min(spacing[at], MAX_STEP * strike[at])
        return at, (
            f"domino {i + 1} stands {offset[at]:.6g} m above domino {i}, normal to its own ground: "
            f"the model accepts at most {limit:.6g} m over spacing[{i}] = {spacing[at]} m; make "
            "the step lower"
        )
    if (at := _first_index(overshoot)) is not None:
        i, limit = at[-1], min(ahead[at], (1.0 + MAX_STEP) * strike[at])
        return at, (
            f"domino {i} (height {behind[at]} m) would strike {strike[at] - offset[at]:.6g} m up "
            f"domino {i + 1} (height[{i + 1}] = {ahead[at]} m), normal to its own ground: at most "
            f"{limit:.6g} m; widen spacing[{i}] = {spacing[at]} m, make domino {i + 1} taller, or "
            "the ground less hollow"
        )
    return None


def impassable(
    spacing: Floats, thickness: Floats, height: Floats, rise: Floats, tilt: Floats
) -> Bools:
    """Return a mask (…, N-1) of contacts that the model does not cover; see `find_violation`."""
    height = np.broadcast_to(height, thickness.shape)
    faults = _contact_faults(spacing, thickness, height, rise, tilt)[0]
    return np.asarray(np.logical_or.reduce(faults))


def _contact_faults(
    spacing: Floats, thickness: Floats, height: Floats, rise: Floats, tilt: Floats
) -> tuple[tuple[Bools, Bools, Bools], Floats, Floats, Floats]:
    """Return masks (…, N-1) of contacts that the model does not cover, and lengths (…, N-1) [m].

    Masks: dominoes that lean against each other before anything falls; a next pivot too high above
    this one; a tip that strikes too far up the next domino. Lengths, from which the masks follow:
    the gap below which dominoes lean against each other; `normal_rises`; the height above this
    pivot at which the tip strikes.
    """
    behind, ahead = height[..., :-1], height[..., 1:]
    in_reach = spacing < behind
    least_gap = behind * np.sin(tilt[..., :-1] - tilt[..., 1:])
    offset = normal_rises(spacing, thickness, rise, tilt)
    strike = np.sqrt(np.maximum(behind**2 - spacing**2, 0.0))
    leaning, too_high = least_gap >= spacing, offset > np.minimum(spacing, MAX_STEP * strike)
    # 1e-12: rounding
    overshoot = strike - offset > np.minimum(ahead * (1.0 + 1e-12), (1.0 + MAX_STEP) * strike)
    masks = in_reach & leaning, in_reach & too_high, in_reach & overshoot
    return masks, least_gap, offset, strike


def _first_index(mask: Bools) -> tuple[int, ...] | None:
    indices = np.argwhere(mask)
    return tuple(int(k) for k in indices[0]) if len(indices) else None
