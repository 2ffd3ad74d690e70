"""Gauss-Legendre rules, the polynomial through their nodes, and time near a stall.

All positions are those of an interval that is mapped to [0, 1].
"""

import math

import numpy as np
from numpy.polynomial import legendre

from domino_env.kernels.arrays import COEF, TINY
from domino_env.kernels.jit import internal

ORDERS = np.array([2, 6, 10, 14, 22, 30])  # numbers of nodes of the rules
PANEL_GROWTH = 2.0  # longest panel, in steps of `slow_step` at its far end
_MAX_LANES = 32  # nodes of the finest rule, and both ends


def _tables() -> tuple[np.ndarray, ...]:
    """Compute the tables of all rules."""
    shape = (len(ORDERS), _MAX_LANES)
    nodes, weights, to_start, to_end, positions, high, top = (np.zeros(shape) for _ in range(7))
    running, closed = np.zeros((2, *shape, _MAX_LANES))
    for k, m in enumerate(ORDERS):
        x, w = legendre.leggauss(int(m))
        values = legendre.legvander(x, int(m))  # P_n(x_j), n = 0 … m
        n = np.arange(m)
        # Discrete orthogonality: the Lagrange polynomial of node j is Σ_n scale[j, n] P_n.
        scale = w[:, None] * values[:, :m] * (n + 0.5)
        integral = np.empty((m, m))  # [n, j] = ∫ from -1 to x_j of P_n
        integral[0] = x + 1.0
        for i in range(1, m):
            integral[i] = (values[:, i + 1] - values[:, i - 1]) / (2 * i + 1)
        points = np.concatenate(([-1.0], x, [1.0]))
        nodes[k, :m], weights[k, :m] = (x + 1.0) / 2.0, w / 2.0
        positions[k, : m + 2] = (points + 1.0) / 2.0
        running[k, :m, :m] = scale @ integral / 2.0
        to_start[k, :m] = scale @ (-1.0) ** n
        to_end[k, :m] = scale.sum(axis=1)
        high[k, :m], top[k, :m] = scale[:, m - 2], scale[:, m - 1]
        closed[k, : m + 2, : m + 2] = np.linalg.inv(legendre.legvander(points, int(m) + 1)).T
    return nodes, weights, positions, running, to_start, to_end, high, top, closed


# NODES, WEIGHTS: (rule, node); POSITIONS: (rule, lane), start, nodes and end; TO_START, TO_END,
# HIGH, TOP: (rule, node), weights that give the values at both ends and the last two Legendre
# coefficients of the polynomial through the nodes; RUNNING: (rule, node, j), ∫ from 0 to x_j of the
# node's Lagrange polynomial; CLOSED: (rule, lane, n), weights that give the Legendre coefficients
# of the polynomial through all lanes
NODES, WEIGHTS, POSITIONS, RUNNING, TO_START, TO_END, HIGH, TOP, CLOSED = _tables()

_n = np.arange(_MAX_LANES)
# P_{n+1}(z) = RECUR_Z[n] z P_n - RECUR_0[n] P_{n-1}
RECUR_Z, RECUR_0 = (2.0 * _n + 1.0) / (_n + 1.0), _n / (_n + 1.0)


@internal
def series(lanes, values, k):
    """Compute the Legendre coefficients (COEF) of the polynomial through the lanes at `values`."""
    count = ORDERS[k] + 2
    for j in range(count):
        lanes[COEF + j] = 0.0
    for i in range(count):
        y = lanes[values + i]
        for j in range(count):
            lanes[COEF + j] += CLOSED[k, i, j] * y


@internal
def power(x, n):
    """Return x to the power of n; the result of `**` differs between Python and machine code."""
    result = 1.0
    while n != 0:
        if n & 1:
            result *= x
        n >>= 1
        x *= x
    return result


@internal
def series_at(lanes, count, x):
    """Return the value and two derivatives of the polynomial in COEF at x."""
    z = 2.0 * x - 1.0
    # P_n(z), its first and its second derivative, of two successive n
    p0, p1, d0, d1, c0, c1 = 1.0, z, 0.0, 1.0, 0.0, 0.0
    y = lanes[COEF] + lanes[COEF + 1] * z
    dy, ddy = lanes[COEF + 1], 0.0
    for n in range(1, count - 1):
        f = 2 * n + 1.0
        p2 = RECUR_Z[n] * (z * p1) - RECUR_0[n] * p0
        d2 = d0 + f * p1
        c2 = c0 + f * d1
        a = lanes[COEF + n + 1]
        y += a * p2
        dy += a * d2
        ddy += a * c2
        p0, p1, d0, d1, c0, c1 = p1, p2, d1, d2, c1, c2
    return y, 2.0 * dy, 4.0 * ddy


@internal
def lowest_point(lanes, values, k):
    """Return position and value of the minimum of the polynomial in COEF, through `values`."""
    count = ORDERS[k] + 2
    j = 0
    for i in range(1, count):
        if lanes[values + i] < lanes[values + j]:
            j = i
    lo, hi = POSITIONS[k, max(j - 1, 0)], POSITIONS[k, min(j + 1, count - 1)]
    x = POSITIONS[k, j]
    _, dy, _ = series_at(lanes, count, lo)
    if dy >= 0.0 and j == 0:
        return 0.0, lanes[values]
    _, dy, _ = series_at(lanes, count, hi)
    if dy <= 0.0 and j == count - 1:
        return 1.0, lanes[values + j]
    for _ in range(60):  # bisection alone would take 30
        y, dy, ddy = series_at(lanes, count, x)
        if dy > 0.0:
            hi = x
        else:
            lo = x
        new = x - dy / ddy if ddy > 0.0 else 0.5 * (lo + hi)
        if not (lo <= new <= hi):
            new = 0.5 * (lo + hi)
        done = abs(new - x) <= 1e-9  # the error of u at its minimum is the square
        x = new
        if done:
            break
    y, _, _ = series_at(lanes, count, x)
    return x, min(y, lanes[values + j])


@internal
def first_zero(lanes, values, k, x_low):
    """Return the position of the first zero of the polynomial in COEF, through `values`.

    x_low: position of its minimum, which is not positive.
    """
    count = ORDERS[k] + 2
    lo, hi = 0.0, x_low
    for j in range(count):  # the first lane that is not positive bounds the first zero
        if lanes[values + j] <= 0.0 and POSITIONS[k, j] < hi:
            hi = POSITIONS[k, j]
            break
    for _ in range(80):  # to rounding, 50 are enough
        x = 0.5 * (lo + hi)
        y, _, _ = series_at(lanes, count, x)
        if y > 0.0:
            lo = x
        else:
            hi = x
        if hi - lo <= 1e-15:
            break
    return lo


@internal
def slow_panel(lanes, count, x0, x1, moments):
    """Return ∫ dx/√u and ½∫ dx/u^(3/2) over [x0, x1] of the polynomial u in COEF.

    moments: room to which ½∫ P_n(2x - 1) dx/u^(3/2) is added for all n; empty if not wanted.
    """
    time, sens = 0.0, 0.0
    for j in range(10):  # nodes of rule 2
        x = x0 + (x1 - x0) * NODES[2, j]
        y, _, _ = series_at(lanes, count, x)
        y = max(y, TINY)
        f = 1.0 / math.sqrt(y)
        part = WEIGHTS[2, j] * 0.5 * f / y
        time += WEIGHTS[2, j] * f
        sens += part
        if len(moments) > 0:
            z, p0, p1 = 2.0 * x - 1.0, 1.0, 2.0 * x - 1.0
            moments[0] += part * (x1 - x0)
            for n in range(1, count):
                moments[n] += part * (x1 - x0) * p1
                p0, p1 = p1, RECUR_Z[n] * (z * p1) - RECUR_0[n] * p0
    return time * (x1 - x0), sens * (x1 - x0)


@internal
def slow_step(lanes, count, x):
    """Return most of the distance over which the polynomial u in COEF changes by its size at x."""
    y, dy, ddy = series_at(lanes, count, x)
    y = max(y, TINY)
    step = 1.0
    if abs(dy) > 0.0:
        step = min(step, y / abs(dy))
    if abs(ddy) > 0.0:
        step = min(step, math.sqrt(2.0 * y / abs(ddy)))
    return max(0.75 * step, 1e-12)


@internal
def slow_time(lanes, count, x_low, moments):
    """Return the integrals of `slow_panel` over [0, 1], by panels from the minimum of u at x_low.

    Ten nodes suffice for a panel of the length of `slow_step`, at both of its ends, and the number
    of panels grows like the logarithm of 1/u at the minimum.
    """
    time, sens = 0.0, 0.0
    for side in range(2):
        x = x_low
        target = 1.0 if side == 1 else 0.0
        step = slow_step(lanes, count, x)
        for _ in range(2000):  # panels grow by a third each, from 1e-12 or more: 100 are enough
            if x == target:
                break
            new = min(x + step, 1.0) if side == 1 else max(x - step, 0.0)
            step = slow_step(lanes, count, new)
            for _ in range(50):
                if abs(new - x) <= PANEL_GROWTH * step:
                    break
                new = 0.5 * (x + new)
                step = slow_step(lanes, count, new)
            t, q = slow_panel(lanes, count, min(x, new), max(x, new), moments)
            time += t
            sens += q
            x = new
    return time, sens
