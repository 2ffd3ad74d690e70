"""Falls of a row of equal dominoes, backwards: they share one stack, cut at different depths."""

import numpy as np

from domino_env.kernels.adjoint.interval import ride_seeds, stack_of_ride_back
from domino_env.kernels.adjoint.slots import PARTS
from domino_env.kernels.adjoint.stack import (
    copy_sums,
    retrace,
    stack_back_again,
    tabulate,
)
from domino_env.kernels.interval import affine_map
from domino_env.kernels.jit import internal
from domino_env.kernels.quadrature import ORDERS
from domino_env.kernels.slots import record_type
from domino_env.kernels.stack import spread

SHARED = record_type(  # which stack the trail, the lanes and the table hold; -1 for none
    rule=int,
    depth=int,  # of the trail, which serves all stacks that are not deeper
    mapped=int,  # depth of the stack whose map the lanes hold
    tabled=int,  # and of the one that the table speaks of
)


@internal
def forget(shared):
    """Nothing is shared any longer: the lanes have been used for something else."""
    shared.rule = shared.depth = shared.mapped = shared.tabled = -1


@internal
def room_for_table(depth, count):
    """Room for the table of a stack in `count` lanes, and for a row of sums over it."""
    return np.empty((3 * count + 1, (depth + 2) * PARTS))


@internal
def fall_back(
    shared, lanes, bars, trail, table, ring, ride, u_bar, t_bar, m_bar, mu, gravity, parts, whole
):
    """A whole fall in reverse, upright to its hit; bars of u at its start and of its last angle."""
    n, k, low = ride.leader, ride.rule, ride.low
    depth, count = n - low, ORDERS[k] + 2
    if k != shared.rule or depth > shared.depth:
        forget(shared)
        spread(lanes, k, ride.angle, ride.length)
        retrace(lanes, count, ring, n, low, mu, trail, True)
        shared.rule, shared.depth = k, depth
    if depth != shared.mapped:
        copy_sums(trail[depth], lanes, count)
        affine_map(lanes, k, ride.length, mu, gravity)
        shared.mapped = depth
    if low > 0 and depth != shared.tabled:  # many falls are cut there, and a table pays
        tabulate(bars, k, ring, n, low, mu, trail, table)
        shared.tabled = depth
    u_bar, end_bar = ride_seeds(lanes, bars, ride, u_bar, t_bar, m_bar, mu, gravity, whole)
    if low > 0:
        sums = table[len(table) - 1]
        end_bar += stack_back_again(bars, count, n, low, table, sums, parts, whole)
    else:
        _, end_bar = stack_of_ride_back(bars, k, ring, n, low, end_bar, mu, trail, parts, whole)
    return u_bar, end_bar
