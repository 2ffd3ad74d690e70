"""Exported functions of `chain.wasm`: C functions around the entry points of the kernels.

Arguments are pointers, float64 and 32-bit integers. A layout of N dominoes is a table of 6 rows of
N numbers: spacing, thickness, height, density, rise and tilt. The last number of spacing and rise
is not used; without `uneven` the ground is flat, and rise and tilt are not used. `setting` has
friction, gravity, push and rtol.
"""

import numba
import numpy as np
from numba import carray, types

from domino_env.kernels import arrays, ground
from domino_env.kernels.adjoint.chain import vjp
from domino_env.kernels.adjoint.contact import PHYSICS_BAR
from domino_env.kernels.chain import solve_batch
from domino_env.kernels.diagnosis import trace_motion
from domino_env.physics import motion as motion_module
from domino_env.rigid import dynamics

WHOLE, NUMBERS = types.int32, types.CPointer(types.float64)
EVENTS, ARRIVALS, SUMMARY, SNAPSHOTS = (
    types.CPointer(numba.from_dtype(kind))
    for kind in (arrays.EVENT, arrays.ARRIVAL, arrays.SUMMARY, arrays.SNAPSHOT)
)
LEANS = motion_module.PIECES + 1  # samples of a fall
lean_stacks, start_standing = motion_module._lean_stacks, numba.njit(dynamics.start)
FUNCTIONS = {}  # exported functions by name


def export(*parameters):
    """Compile a function to a C function that returns a 32-bit integer, and export it."""

    def register(function):
        FUNCTIONS[function.__name__] = numba.cfunc(WHOLE(*parameters))(function)
        return function

    return register


@numba.njit
def parts(table, n):
    """Return spacing, thickness, height, density, rise and tilt of a table."""
    rows = carray(table, (6, n))
    return rows[0, : n - 1], rows[1], rows[2], rows[3], rows[4, : n - 1], rows[5]


@numba.njit
def setting_at(setting):
    """Return the setting of the kernels."""
    friction, gravity, push, rtol = carray(setting, (4,))
    return arrays.Setting(friction, gravity, push, rtol)


@numba.njit
def curve_at(curve, knots):
    """Return ground: numbers at K knots, K + 1 starts, and K + 1 pieces of 4 coefficients."""
    values = carray(curve, (6 * knots + 5,))
    pieces = values[2 * knots + 1 :].reshape((knots + 1, 4))
    return arrays.Curve(values[:knots], values[knots : 2 * knots + 1], pieces)


@export(WHOLE, WHOLE, NUMBERS, NUMBERS, WHOLE, ARRIVALS, SUMMARY, EVENTS, WHOLE)
def simulate(n, uneven, table, setting, exact_minimum, arrivals, summary, tape, events):
    """Simulate a chain; the tape has room for `events`, none if no gradient is wanted."""
    s, d, h, rho, e, a = parts(table, n)
    s, d, h, rho = s.reshape((1, -1)), d.reshape((1, -1)), h.reshape((1, -1)), rho.reshape((1, -1))
    results = carray(summary, (1,)), carray(arrivals, (1, n)), carray(tape, (events,))
    flat = arrays.Arrays(s, d, h, rho, None, None)
    if uneven:
        layout = arrays.Arrays(s, d, h, rho, e.reshape((1, -1)), a.reshape((1, -1)))
        solve_batch(0, 1, layout, setting_at(setting), exact_minimum != 0, *results)
    else:
        solve_batch(0, 1, flat, setting_at(setting), exact_minimum != 0, *results)
    return 0


@export(WHOLE, WHOLE, NUMBERS, NUMBERS, EVENTS, WHOLE, NUMBERS, NUMBERS, NUMBERS)
def pullback(n, uneven, table, setting, tape, events, arrival_bar, bars, physics_bar):
    """Write derivatives of Σ arrival_bar · arrival times by a table, and by friction to push."""
    s, d, h, rho, e, a = parts(table, n)
    s_bar, d_bar, h_bar, rho_bar, e_bar, a_bar = parts(bars, n)
    times_bar, recorded = carray(arrival_bar, (n,)), carray(tape, (events,))
    by_physics = np.zeros(1, PHYSICS_BAR)
    if uneven:
        bar = arrays.Arrays(s_bar, d_bar, h_bar, rho_bar, e_bar, a_bar)
        layout = arrays.Arrays(s, d, h, rho, e, a)
        vjp(layout, setting_at(setting), recorded, times_bar, bar, by_physics)
    else:
        bar = arrays.Arrays(s_bar, d_bar, h_bar, rho_bar, None, None)
        layout = arrays.Arrays(s, d, h, rho, None, None)
        vjp(layout, setting_at(setting), recorded, times_bar, bar, by_physics)
    results = carray(physics_bar, (3,))
    results[0], results[1] = by_physics[0].friction, by_physics[0].gravity
    results[2] = by_physics[0].push
    return 0


@export(WHOLE, WHOLE, NUMBERS, NUMBERS, SNAPSHOTS)
def motion(n, uneven, table, setting, snapshots):
    """Sample all falls of a chain; return their number."""
    s, d, h, rho, e, a = parts(table, n)
    samples = carray(snapshots, (n, LEANS))
    if uneven:
        return trace_motion(arrays.Arrays(s, d, h, rho, e, a), setting_at(setting), samples)
    return trace_motion(arrays.Arrays(s, d, h, rho, None, None), setting_at(setting), samples)


@export(WHOLE, NUMBERS, WHOLE, types.float64, NUMBERS)
def lean(n, contacts, leader, angle, leans):
    """Write the leans of all dominoes up to the leader, from its own."""
    leaders, angles = np.array([leader]), np.array([angle])
    lean_stacks(carray(contacts, (n - 1, 7)), leaders, angles, carray(leans, (1, n)))
    return 0


@export(WHOLE, NUMBERS, WHOLE, NUMBERS)
def place(n, table, knots, curve):
    """Write rise and tilt of a table on curved ground."""
    s, d, _, _, e, a = parts(table, n)
    written = e.reshape((1, -1)), a.reshape((1, -1))
    curve_arrays = curve_at(curve, knots)
    ground.place_on_ground(0, 1, curve_arrays, s.reshape((1, -1)), d.reshape((1, -1)), *written)
    return 0


@export(WHOLE, NUMBERS, WHOLE, NUMBERS, NUMBERS)
def place_back(n, table, knots, curve, bars):
    """Add the derivatives by rise and tilt of a table to those by spacing and thickness."""
    s, d, _, _, e, a = parts(table, n)
    s_bar, d_bar, _, _, e_bar, a_bar = parts(bars, n)
    ground.place_on_ground_vjp(
        0, 1, curve_at(curve, knots), s.reshape((1, -1)), d.reshape((1, -1)), e.reshape((1, -1)),
        a.reshape((1, -1)), e_bar.reshape((1, -1)), a_bar.reshape((1, -1)),
        s_bar.reshape((1, -1)), d_bar.reshape((1, -1)),
    )  # fmt: skip
    return 0


@export(WHOLE, NUMBERS, NUMBERS, types.float64, NUMBERS)
def standing(n, bodies, setting, push, record):
    """Simulate free-standing dominoes until they end; return the state of the run.

    bodies: rows of N: height, thickness, mass, inertia, x and y of pivots, tilt, its sine and
    cosine, x and y of edges. setting: as `dynamics.Setting`. record: rows of N as
    `dynamics.Record`, arrival times inf but the first, the others 0.
    """
    b, results = carray(bodies, (11, n)), carray(record, (5, n))
    pairs = np.empty((3, n, 2))
    for k in range(3):
        for i in range(n):
            for j in range(2):
                pairs[k, i, j] = b[(4, 7, 9)[k] + j, i]
    dominoes = dynamics.Bodies(b[0], b[1], b[2], b[3], pairs[0], b[6], pairs[1], pairs[2])
    friction, floor, gravity, coarseness, tolerance, window, patience = carray(setting, (7,))
    rules = dynamics.Setting(
        friction, floor, gravity, coarseness, tolerance, np.int64(window), patience
    )
    state = start_standing(dominoes, rules, push)
    written = dynamics.Record(
        results[0], results[1], results[2], results[3, : n - 1], results[4, : n - 1]
    )
    status = dynamics.RUNNING
    while status == dynamics.RUNNING:
        status = dynamics.advance(dominoes, rules, state, written, 1_000_000)
    return status
