"""The time of an interval in which u nearly vanishes, in panels that grow away from the dip."""

import math

from domino_env.kernels.jit import internal
from domino_env.kernels.polynomial import series_at
from domino_env.kernels.quadrature import NODES, RECUR_0, RECUR_Z, WEIGHTS
from domino_env.kernels.slots import TINY


@internal
def slow_panel(lanes, count, x0, x1, moments):
    """∫ dx/√u and ½∫ dx/u^(3/2) over [x0, x1] of the polynomial u (COEF), ten nodes.

    moments, unless empty: gains ½∫ P_n(2x - 1) dx/u^(3/2).
    """
    time, sens = 0.0, 0.0
    for j in range(10):
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
def slow_time(lanes, count, x_low, moments):
    """The two integrals over [0, 1] when u nearly vanishes: panels that grow away from x_low.

    A panel spans the distance over which u changes by its own size, so each is easy and their
    number grows like the logarithm of the depth of the dip.
    """
    time, sens = 0.0, 0.0
    for side in range(2):
        x = x_low
        target = 1.0 if side == 1 else 0.0
        for _ in range(2000):
            if x == target:
                break
            y, dy, ddy = series_at(lanes, count, x)
            y = max(y, TINY)
            step = 1.0
            if abs(dy) > 0.0:
                step = min(step, y / abs(dy))
            if abs(ddy) > 0.0:
                step = min(step, math.sqrt(2.0 * y / abs(ddy)))
            step = max(0.75 * step, 1e-12)
            if side == 1:
                new = min(x + step, 1.0)
                t, q = slow_panel(lanes, count, x, new, moments)
            else:
                new = max(x - step, 0.0)
                t, q = slow_panel(lanes, count, new, x, moments)
            time += t
            sens += q
            x = new
    return time, sens
