"""Placement of dominoes one after another along curved ground, and its reverse mode.

A domino stands with both bottom edges on the curve y(x), and its base has the slope α, positive
downhill. From the pivot of the domino before, a gap s along that slope, (cos α, -sin α), and an
offset q normal to it lead to the rear bottom edge. The front bottom edge, its own pivot, is d
further along the slope. Both edges lie on the curve, which gives two equations for α and q, solved
by Newton's method. On an even slope q is 0.
"""

import math

import numpy as np

from domino_env.kernels.jit import always_inline, entry_point, internal

MOST_STEPS = 40  # of Newton's method; about four are used
CLOSE = 1e-9  # last step of α [rad], and of q over gap plus thickness: the error is its square


@internal
def piece_at(curve, x, k):
    """Return the index of the piece that contains x; the search starts from piece k."""
    while k < len(curve.knots) and x > curve.knots[k]:
        k += 1
    while k > 0 and x <= curve.knots[k - 1]:
        k -= 1
    return k


@always_inline
def height_and_slope(curve, x, k):
    """Return height [m] and slope dy/dx of piece k at x."""
    t, c = x - curve.starts[k], curve.pieces[k]
    return ((c[0] * t + c[1]) * t + c[2]) * t + c[3], (3.0 * c[0] * t + 2.0 * c[1]) * t + c[2]


@internal
def first_tilt(curve, thickness):
    """Return α [rad] of the first domino, whose pivot is at x = 0; nan if it cannot stand."""
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
    """Return α and q of the domino after the pivot at x on piece k; nan if it cannot stand.

    tilt: first guess of α, such as that of the domino before.
    """
    height, _ = height_and_slope(curve, x, k)
    pitch, up = gap + thickness, 0.0  # up: q
    for _ in range(MOST_STEPS):
        s, c = math.sin(tilt), math.cos(tilt)
        back, front = x + gap * c + up * s, x + pitch * c + up * s
        k = piece_at(curve, back, k)
        ground_b, slope_b = height_and_slope(curve, back, k)
        k = piece_at(curve, front, k)
        ground_f, slope_f = height_and_slope(curve, front, k)
        # heights of the ground over the two edges
        over_b = ground_b - (height - gap * s + up * c)
        over_f = ground_f - (height - pitch * s + up * c)
        # derivatives of both by α and q
        by_tilt_b = slope_b * (up * c - gap * s) + gap * c + up * s
        by_tilt_f = slope_f * (up * c - pitch * s) + pitch * c + up * s
        by_up_b, by_up_f = slope_b * s - c, slope_f * s - c
        determinant = by_tilt_b * by_up_f - by_tilt_f * by_up_b
        turn = (by_up_b * over_f - by_up_f * over_b) / determinant
        lift = (by_tilt_f * over_b - by_tilt_b * over_f) / determinant
        tilt, up = tilt + turn, up + lift
        if abs(turn) <= CLOSE and abs(lift) <= CLOSE * pitch:
            return tilt, up
    return math.nan, math.nan


@entry_point
def place_on_ground(first, last, curve, spacing, thickness, rise, tilt):
    """Write rise (B, N-1) and tilt (B, N) of layouts first … last - 1 of a batch."""
    for b in range(first, last):
        x, k = 0.0, piece_at(curve, 0.0, 0)
        tilt[b, 0] = first_tilt(curve, thickness[b, 0])
        for i in range(spacing.shape[1]):
            gap, d = spacing[b, i], thickness[b, i + 1]
            alpha, up = next_place(curve, x, k, gap, d, tilt[b, i])
            s, c = math.sin(alpha), math.cos(alpha)
            x += (gap + d) * c + up * s
            k = piece_at(curve, x, k)
            rise[b, i], tilt[b, i + 1] = up * c - (gap + d) * s, alpha


@entry_point
def place_on_ground_vjp(
    first, last, curve, spacing, thickness, rise, tilt, rise_bar, tilt_bar, gap_bar, thickness_bar
):
    """Add the derivatives through rise and tilt to gap_bar and thickness_bar.

    rise_bar, tilt_bar: derivatives by rise (B, N-1) and tilt (B, N).
    """
    pairs = spacing.shape[1]
    places = np.empty(pairs + 1)
    for b in range(first, last):
        places[0] = 0.0
        for i in range(pairs):
            pitch, alpha = spacing[b, i] + thickness[b, i + 1], tilt[b, i + 1]
            along = (pitch + rise[b, i] * math.sin(alpha)) / math.cos(alpha)
            places[i + 1] = places[i] + along
        k = piece_at(curve, places[pairs], 0)
        place_bar = 0.0  # of x of pivot i + 1
        for i in range(pairs - 1, -1, -1):
            gap, pitch = spacing[b, i], spacing[b, i] + thickness[b, i + 1]
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
            by_tilt_f = slope_f * (up * c - pitch * s) + pitch * c + up * s
            by_up_b, by_up_f = slope_b * s - c, slope_f * s - c
            determinant = by_tilt_b * by_up_f - by_tilt_f * by_up_b
            # derivatives by α and q, and from them by the heights of the two edges
            alpha_bar = tilt_bar[b, i + 1] - along * rise_bar[b, i] + rise[b, i] * place_bar
            up_bar = c * rise_bar[b, i] + s * place_bar
            at_b = (by_up_f * alpha_bar - by_tilt_f * up_bar) / determinant
            at_f = (by_tilt_b * up_bar - by_up_b * alpha_bar) / determinant
            straight = c * place_bar - s * rise_bar[b, i]
            by_gap_b, by_gap_f = slope_b * c + s, slope_f * c + s
            gap_bar[b, i] += straight - at_b * by_gap_b - at_f * by_gap_f
            thickness_bar[b, i + 1] += straight - at_f * by_gap_f
            place_bar -= at_b * (slope_b - slope) + at_f * (slope_f - slope)
        s, c, d = math.sin(tilt[b, 0]), math.cos(tilt[b, 0]), thickness[b, 0]
        k = piece_at(curve, -d * c, k)
        _, slope = height_and_slope(curve, -d * c, k)
        thickness_bar[b, 0] += tilt_bar[b, 0] * (slope * c + s) / (d * (slope * s - c))
