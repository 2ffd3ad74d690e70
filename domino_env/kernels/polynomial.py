"""The polynomial through a row of lanes: its coefficients, its minimum, its first zero."""

from domino_env.kernels.jit import always_inline, internal
from domino_env.kernels.quadrature import CLOSED, NODES, ORDERS, RECUR_0, RECUR_Z
from domino_env.kernels.slots import COEF


@internal
def series(lanes, values, k):
    """Legendre coefficients of the polynomial through a row of lanes (start, nodes, end)."""
    count = ORDERS[k] + 2
    for j in range(count):
        lanes[COEF + j] = 0.0
    for i in range(count):
        y = lanes[values + i]
        for j in range(count):
            lanes[COEF + j] += CLOSED[k, i, j] * y


@internal
def series_at(lanes, count, x):
    """Value and first two derivatives of that polynomial at x in [0, 1]."""
    z = 2.0 * x - 1.0
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
def lowest_lane(lanes, values, count):
    best = 0
    for j in range(1, count):
        if lanes[values + j] < lanes[values + best]:
            best = j
    return best


@always_inline
def place(k, j):
    """Position of lane j in [0, 1]."""
    if j == 0:
        return 0.0
    if j == ORDERS[k] + 1:
        return 1.0
    return NODES[k, j - 1]


@internal
def lowest_point(lanes, values, k):
    """Place and value of the minimum over [0, 1] of the polynomial through a row (COEF is set)."""
    count = ORDERS[k] + 2
    j = lowest_lane(lanes, values, count)
    lo, hi = place(k, max(j - 1, 0)), place(k, min(j + 1, count - 1))
    x = place(k, j)
    _, dy, _ = series_at(lanes, count, lo)
    if dy >= 0.0 and j == 0:
        return 0.0, lanes[values]
    _, dy, _ = series_at(lanes, count, hi)
    if dy <= 0.0 and j == count - 1:
        return 1.0, lanes[values + j]
    for _ in range(60):
        y, dy, ddy = series_at(lanes, count, x)
        if dy > 0.0:
            hi = x
        else:
            lo = x
        new = x - dy / ddy if ddy > 0.0 else 0.5 * (lo + hi)
        if not (lo <= new <= hi):
            new = 0.5 * (lo + hi)
        done = abs(new - x) <= 1e-9  # u is flat there: its error is the square of that
        x = new
        if done:
            break
    y, _, _ = series_at(lanes, count, x)
    return x, min(y, lanes[values + j])


@internal
def first_zero(lanes, values, k, x_low):
    """Where the falling polynomial (COEF) first reaches zero before its minimum at x_low."""
    count = ORDERS[k] + 2
    lo, hi = 0.0, x_low
    for j in range(count):  # the first lane that is not positive bounds the first zero
        if lanes[values + j] <= 0.0 and place(k, j) < hi:
            hi = place(k, j)
            break
    for _ in range(80):
        x = 0.5 * (lo + hi)
        y, _, _ = series_at(lanes, count, x)
        if y > 0.0:
            lo = x
        else:
            hi = x
        if hi - lo <= 1e-15:
            break
    return lo
