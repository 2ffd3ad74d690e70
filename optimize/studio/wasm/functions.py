"""Exported functions of `chain.wasm`: C functions around the entry points of the kernels.

Arguments are pointers, float64 and 32-bit integers. A layout of N dominoes is a table of 6 rows of
N numbers: spacing, thickness, height, density, rise and tilt. The last number of spacing and rise
is not used; without `uneven` the ground is flat, and rise and tilt are not used. `setting` has
friction, gravity, push and rtol.
"""

from functools import partial
from typing import Any

import numba
import numpy as np
from numba import carray, types  # type: ignore[attr-defined]

from domino_env.kernels import arrays, ground
from domino_env.kernels.adjoint.chain import vjp
from domino_env.kernels.adjoint.contact import PHYSICS_BAR
from domino_env.kernels.chain import solve_batch
from domino_env.kernels.diagnosis import trace_motion
from domino_env.kernels.jit.plain import compile_plainly
from domino_env.physics import motion as physics_motion
from domino_env.rigid import dynamics

WHOLE, NUMBERS = types.int32, types.CPointer(types.float64)
EVENTS, ARRIVALS, SUMMARY, SNAPSHOTS = (
    types.CPointer(numba.from_dtype(kind))
    for kind in (arrays.EVENT, arrays.ARRIVAL, arrays.SUMMARY, arrays.SNAPSHOT)
)
SAMPLES = physics_motion.PIECES + 1  # of each fall
MANY_STEPS = 1_000_000
compiled = partial(compile_plainly, cache=False)
lean_stacks, start_standing = physics_motion._lean_stacks, compiled(dynamics.start)
FUNCTIONS: dict[str, Any] = {}  # exported functions by name


def export(*parameters):
    """Compile a function to a C function that returns a 32-bit integer, and export it."""

    def register(function):
        FUNCTIONS[function.__name__] = numba.cfunc(WHOLE(*parameters))(function)
        return function

    return register


@compiled
def parts(table, n):
    """Return spacing, thickness, height, density, rise and tilt of a table."""
    rows = carray(table, (6, n))
    return rows[0, : n - 1], rows[1], rows[2], rows[3], rows[4, : n - 1], rows[5]


@compiled
def batch(values):
    """Return an array as a batch of one."""
    return values.reshape((1, len(values)))


@compiled
def setting_at(setting):
    """Return the setting of the kernels."""
    friction, gravity, push, rtol = carray(setting, (4,))
    return arrays.Setting(friction, gravity, push, rtol)


@compiled
def curve_at(curve, knots):
    """Return ground: K knots, K + 1 starts, and K + 1 pieces of 4 coefficients."""
    values = carray(curve, (6 * knots + 5,))
    pieces = values[2 * knots + 1 :].reshape((knots + 1, 4))
    return arrays.Curve(values[:knots], values[knots : 2 * knots + 1], pieces)


@export(WHOLE, WHOLE, NUMBERS, NUMBERS, WHOLE, ARRIVALS, SUMMARY, EVENTS, WHOLE)
def simulate(n, uneven, table, setting, exact_minimum, arrivals, summary, tape, events):
    """Simulate a chain; the tape has room for `events`, none if no gradient is wanted."""
    s, d, h, rho, e, a = parts(table, n)
    s, d, h, rho = batch(s), batch(d), batch(h), batch(rho)
    options = setting_at(setting), exact_minimum != 0
    results = carray(summary, (1,)), carray(arrivals, (1, n)), carray(tape, (events,))
    if uneven:
        solve_batch(0, 1, arrays.Arrays(s, d, h, rho, batch(e), batch(a)), *options, *results)
    else:
        solve_batch(0, 1, arrays.Arrays(s, d, h, rho, None, None), *options, *results)
    return 0


@export(WHOLE, WHOLE, NUMBERS, NUMBERS, EVENTS, WHOLE, NUMBERS, NUMBERS, NUMBERS)
def pullback(n, uneven, table, setting, tape, events, arrival_bar, bars, physics_bar):
    """Write derivatives of Σ arrival_bar · arrival times by a table, and by friction to push."""
    s, d, h, rho, e, a = parts(table, n)
    s_bar, d_bar, h_bar, rho_bar, e_bar, a_bar = parts(bars, n)
    inputs = setting_at(setting), carray(tape, (events,)), carray(arrival_bar, (n,))
    by_physics = np.zeros(1, PHYSICS_BAR)
    if uneven:
        bar = arrays.Arrays(s_bar, d_bar, h_bar, rho_bar, e_bar, a_bar)
        vjp(arrays.Arrays(s, d, h, rho, e, a), *inputs, bar, by_physics)
    else:
        flat_bar = arrays.Arrays(s_bar, d_bar, h_bar, rho_bar, None, None)
        vjp(arrays.Arrays(s, d, h, rho, None, None), *inputs, flat_bar, by_physics)
    results, by_one = carray(physics_bar, (3,)), by_physics[0]
    results[0], results[1], results[2] = by_one.friction, by_one.gravity, by_one.push
    return 0


@export(WHOLE, WHOLE, NUMBERS, NUMBERS, SNAPSHOTS)
def motion(n, uneven, table, setting, snapshots):
    """Sample all falls of a chain; return their number."""
    s, d, h, rho, e, a = parts(table, n)
    samples = carray(snapshots, (n, SAMPLES))
    if uneven:
        return trace_motion(arrays.Arrays(s, d, h, rho, e, a), setting_at(setting), samples)
    return trace_motion(arrays.Arrays(s, d, h, rho, None, None), setting_at(setting), samples)


@export(WHOLE, NUMBERS, WHOLE, types.float64, NUMBERS)
def lean(n, contacts, leader, angle, leans):
    """Write the leans of all dominoes up to the leader, from its own."""
    leaders, angles = np.full(1, leader), np.full(1, angle)
    lean_stacks(carray(contacts, (n - 1, 7)), leaders, angles, carray(leans, (1, n)))
    return 0


@export(WHOLE, NUMBERS, WHOLE, NUMBERS)
def place(n, table, knots, curve):
    """Write rise and tilt of a table on curved ground."""
    s, d, _, _, e, a = parts(table, n)
    places = batch(e), batch(a)
    ground.place_on_ground(0, 1, curve_at(curve, knots), batch(s), batch(d), *places)
    return 0


@export(WHOLE, NUMBERS, WHOLE, NUMBERS, NUMBERS)
def place_back(n, table, knots, curve, bars):
    """Add the derivatives by rise and tilt of a table to those by spacing and thickness."""
    s, d, _, _, e, a = parts(table, n)
    s_bar, d_bar, _, _, e_bar, a_bar = parts(bars, n)
    layout = batch(s), batch(d), batch(e), batch(a)
    written = batch(e_bar), batch(a_bar), batch(s_bar), batch(d_bar)
    ground.place_on_ground_vjp(0, 1, curve_at(curve, knots), *layout, *written)
    return 0


@export(WHOLE, NUMBERS, NUMBERS, types.float64, NUMBERS)
def standing(n, bodies, setting, push, record):
    """Simulate free-standing dominoes to their end; return the state of the run.

    bodies: rows of N: height, thickness, mass, inertia, x and y of pivots, tilt, its sine and
    cosine, x and y of edges. setting: that of `dynamics`. record: rows of N as in
    `dynamics.Record`; arrival times are inf but for the first, the others 0.
    """
    b, r = carray(bodies, (11, n)), carray(record, (5, n))
    pivots, slope, edge = b[4:6].T.copy(), b[7:9].T.copy(), b[9:11].T.copy()
    dominoes = dynamics.Bodies(b[0], b[1], b[2], b[3], pivots, b[6], slope, edge)
    friction, floor, gravity, coarseness, tolerance, window, patience = carray(setting, (7,))
    numbers = friction, floor, gravity, coarseness, tolerance
    rules = dynamics.Setting(*numbers, np.int64(window), patience)
    written = dynamics.Record(r[0], r[1], r[2], r[3, : n - 1], r[4, : n - 1])
    state = start_standing(dominoes, rules, push)
    status = dynamics.RUNNING
    while status == dynamics.RUNNING:
        status = dynamics.advance(dominoes, rules, state, written, MANY_STEPS)
    return status
