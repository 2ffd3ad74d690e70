"""Placement of dominoes one after another along curved ground, and its reverse mode.

A domino stands with both bottom edges on the curve y(x). From pivot P the gap s extends along the
slope of the next base, (cos α, -sin α); its back edge then is q higher, perpendicular to it, and
its own pivot, the front edge, d further. That both edges lie on the curve gives two equations for
α and q, solved by Newton's method. q is 0 on an even slope.
"""

import math

import numpy as np

from domino_env.kernels.jit import always_inline, entry_point, internal

MOST_STEPS = 40  # of Newton's method; about four are used
CLOSE = 1e-9  # [rad] last step, whose square is the error


@internal
def piece_at(curve, x, k):
    """Return the piece that contains x, searching from piece k."""
    while k < len(curve.knots) and x > curve.knots[k]:
        k += 1
    while k > 0 and x <= curve.knots[k - 1]:
        k -= 1
    return k


@always_inline
def height_and_slope(curve, x, k):
    """Return height and slope of piece k at x."""
    t, c = x - curve.starts[k], curve.pieces[k]
    return ((c[0] * t + c[1]) * t + c[2]) * t + c[3], (3.0 * c[0] * t + 2.0 * c[1]) * t + c[2]


@internal
def first_tilt(curve, thickness):
    """Return α of the domino whose pivot is at x = 0; nan if it cannot stand."""
    k = piece_at(curve, 0.0, 0)
    height, slope = height_and_slope(curve, 0.0, k)
    tilt = -math.atan(slope)
    for _ in range(MOST_STEPS):
        x, y = -thickness * math.cos(tilt), height + thickness * math.sin(tilt)
        k = piece_at(curve, x, k)
        ground, slope = height_and_slope(curve, x, k)
        rate = thickness * (slope * math.sin(tilt) - math.cos(tilt))
        change = (y - ground) / rate
        tilt += change
        if abs(change) <= CLOSE:
            return tilt
    return math.nan


@internal
def next_place(curve, x, k, gap, thickness, tilt):
    """Return α and q of the next domino after the pivot at x on piece k; nan if it cannot stand.

    tilt: first guess, such as that of the domino before.
    """
    height, _ = height_and_slope(curve, x, k)
    reach, up = gap + thickness, 0.0
    for _ in range(MOST_STEPS):
        s, c = math.sin(tilt), math.cos(tilt)
        back, front = x + gap * c + up * s, x + reach * c + up * s
        k = piece_at(curve, back, k)
        ground_b, slope_b = height_and_slope(curve, back, k)
        k = piece_at(curve, front, k)
        ground_f, slope_f = height_and_slope(curve, front, k)
        over_b = ground_b - (height - gap * s + up * c)
        over_f = ground_f - (height - reach * s + up * c)
        # derivatives of both by α and q
        by_tilt_b = slope_b * (up * c - gap * s) + gap * c + up * s
        by_tilt_f = slope_f * (up * c - reach * s) + reach * c + up * s
        by_up_b, by_up_f = slope_b * s - c, slope_f * s - c
        determinant = by_tilt_b * by_up_f - by_tilt_f * by_up_b
        turn = (by_up_b * over_f - by_up_f * over_b) / determinant
        lift = (by_tilt_f * over_b - by_tilt_b * over_f) / determinant
        tilt, up = tilt + turn, up + lift
        if abs(turn) <= CLOSE and abs(lift) <= CLOSE * reach:
            return tilt, up
    return math.nan, math.nan


@entry_point
def place_on_ground(first, last, curve, spacing, thickness, rise, tilt):
    """Write rise and tilt of layouts first … last-1."""
    for b in range(first, last):
        x, k = 0.0, piece_at(curve, 0.0, 0)
        tilt[b, 0] = first_tilt(curve, thickness[b, 0])
        for i in range(spacing.shape[1]):
            gap, d = spacing[b, i], thickness[b, i + 1]
            turn, up = next_place(curve, x, k, gap, d, tilt[b, i])
            s, c = math.sin(turn), math.cos(turn)
            x += (gap + d) * c + up * s
            k = piece_at(curve, x, k)
            rise[b, i], tilt[b, i + 1] = up * c - (gap + d) * s, turn


@entry_point
def place_on_ground_vjp(
    first, last, curve, spacing, thickness, rise, tilt, by_rise, by_tilt, by_spacing, by_thickness
):
    """Add to the derivatives by gaps and thicknesses those through rise and tilt."""
    pairs = spacing.shape[1]
    places = np.empty(pairs + 1)
    for b in range(first, last):
        places[0] = 0.0
        for i in range(pairs):
            reach, turn = spacing[b, i] + thickness[b, i + 1], tilt[b, i + 1]
            along = (reach + rise[b, i] * math.sin(turn)) / math.cos(turn)
            places[i + 1] = places[i] + along
        k = piece_at(curve, places[pairs], 0)
        by_place = 0.0
        for i in range(pairs - 1, -1, -1):
            gap, reach = spacing[b, i], spacing[b, i] + thickness[b, i + 1]
            s, c = math.sin(tilt[b, i + 1]), math.cos(tilt[b, i + 1])
            front, along = places[i + 1], places[i + 1] - places[i]
            k = piece_at(curve, front, k)
            _, slope_f = height_and_slope(curve, front, k)
            back = front - thickness[b, i + 1] * c
            k = piece_at(curve, back, k)
            _, slope_b = height_and_slope(curve, back, k)
            k = piece_at(curve, places[i], k)
            _, slope = height_and_slope(curve, places[i], k)
            up = along * s + rise[b, i] * c
            by_tilt_b = slope_b * (up * c - gap * s) + gap * c + up * s
            by_tilt_f = slope_f * (up * c - reach * s) + reach * c + up * s
            by_up_b, by_up_f = slope_b * s - c, slope_f * s - c
            determinant = by_tilt_b * by_up_f - by_tilt_f * by_up_b
            # derivatives by α and q, and from them by the heights of the two edges
            tilt_bar = by_tilt[b, i + 1] - along * by_rise[b, i] + rise[b, i] * by_place
            up_bar = c * by_rise[b, i] + s * by_place
            at_b = (by_up_f * tilt_bar - by_tilt_f * up_bar) / determinant
            at_f = (by_tilt_b * up_bar - by_up_b * tilt_bar) / determinant
            straight = c * by_place - s * by_rise[b, i]
            over_b, over_f = slope_b * c + s, slope_f * c + s
            by_spacing[b, i] += straight - at_b * over_b - at_f * over_f
            by_thickness[b, i + 1] += straight - at_f * over_f
            by_place -= at_b * (slope_b - slope) + at_f * (slope_f - slope)
        s, c, d = math.sin(tilt[b, 0]), math.cos(tilt[b, 0]), thickness[b, 0]
        k = piece_at(curve, -d * c, k)
        _, slope = height_and_slope(curve, -d * c, k)
        by_thickness[b, 0] += by_tilt[b, 0] * (slope * c + s) / (d * (slope * s - c))
