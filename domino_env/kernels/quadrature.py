"""Gauss-Legendre rules on [0, 1]: nodes, weights, running integrals, extrapolation, coefficients.

Every table has one slice per entry of `ORDERS`, padded with zeros to the longest rule.  A rule of
order m has m nodes; with the two ends of the interval it fills a multiple of four lanes.
"""

import numpy as np
from numpy.polynomial import legendre

ORDERS = np.array([2, 6, 10, 14, 22, 30])
_ROOM = 32


def _rules() -> tuple[np.ndarray, ...]:
    shape = (len(ORDERS), _ROOM)
    nodes, weights, to_start, to_end, places, high, top = (np.zeros(shape) for _ in range(7))
    running = np.zeros((len(ORDERS), _ROOM, _ROOM))
    closed = np.zeros((len(ORDERS), _ROOM, _ROOM))
    for k, m in enumerate(ORDERS):
        x, w = legendre.leggauss(int(m))
        values = legendre.legvander(x, int(m))  # P_n(x_j), n = 0 … m
        n = np.arange(m)
        # Discrete orthogonality: the Lagrange polynomial of node j is Σ_n scale[j, n] P_n.
        scale = w[:, None] * values[:, :m] * (n + 0.5)
        integral = np.empty((m, m))  # [n, row] = ∫ from -1 to x_row of P_n
        integral[0] = x + 1.0
        for i in range(1, m):
            integral[i] = (values[:, i + 1] - values[:, i - 1]) / (2 * i + 1)
        points = np.concatenate(([-1.0], x, [1.0]))
        nodes[k, :m], weights[k, :m] = (x + 1.0) / 2.0, w / 2.0
        places[k, : m + 2] = (points + 1.0) / 2.0
        running[k, :m, :m] = scale @ integral / 2.0
        to_start[k, :m] = scale @ (-1.0) ** n
        to_end[k, :m] = scale.sum(axis=1)
        high[k, :m], top[k, :m] = scale[:, m - 2], scale[:, m - 1]
        closed[k, : m + 2, : m + 2] = np.linalg.inv(legendre.legvander(points, int(m) + 1)).T
    return nodes, weights, places, running, to_start, to_end, high, top, closed


NODES, WEIGHTS, PLACES, RUNNING, TO_START, TO_END, HIGH, TOP, CLOSED = _rules()
"""NODES, WEIGHTS, TO_START, TO_END: (rule, node); PLACES: (rule, lane), the nodes with both ends;
HIGH, TOP: (rule, node), the last two Legendre coefficients of the polynomial through the nodes;
RUNNING: (rule, node, row), ∫ from 0 to x_row of the node's Lagrange polynomial; CLOSED: (rule,
point, n), Legendre coefficients of the polynomial through start, nodes and end."""

_n = np.arange(_ROOM)
RECUR_Z, RECUR_0 = (2.0 * _n + 1.0) / (_n + 1.0), _n / (_n + 1.0)
"""P_{n+1}(z) = RECUR_Z[n] z P_n - RECUR_0[n] P_{n-1}."""
