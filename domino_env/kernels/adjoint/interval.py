"""Reverse mode of one interval of a fall: its time, its map, and the stack.

All falls of a uniform layout share one stack, which ends at different depths.
"""

import math

from domino_env.kernels import arrays, quadrature
from domino_env.kernels.adjoint import stack
from domino_env.kernels.adjoint.contact import B_MU, SEED_D, SEED_G, SEED_M
from domino_env.kernels.arrays import COEF, EXPO, MAP_E, MAP_U, RATE, SLOWNESS, SPEED2, SUM_M
from domino_env.kernels.interval import affine_map
from domino_env.kernels.jit import internal
from domino_env.kernels.quadrature import CLOSED, ORDERS, POSITIONS, RUNNING, WEIGHTS
from domino_env.kernels.stack import set_angles


@internal
def interval_seeds(reverse, event, u_bar, t_bar, m_bar):
    """Write the seeds of M, G and D from the bars of the time and the map of an interval.

    The lanes hold the map.  Returns bars of u at the start of the interval and of its length.
    """
    lanes, bars, gravity = reverse.lanes, reverse.bars, reverse.setting.gravity
    h, k, u0, x_low = event.length, event.rule, event.u, event.slowest_at
    end = ORDERS[k] + 1
    count = end + 1
    lanes[SPEED2] = u0
    for j in range(1, end + 1):
        lanes[SPEED2 + j] = lanes[MAP_E + j] * (u0 + lanes[MAP_U + j])
    # the time: bars of u at the lanes, in SLOWNESS
    time = 0.0
    if x_low >= 0.0:  # else time was not integrated in panels
        quadrature.series(lanes, SPEED2, k)
        moments = bars[B_MU : B_MU + arrays.STRIDE]
        arrays.set_zero(moments)
        time, _ = quadrature.slow_time(lanes, count, x_low, moments)
        for j in range(count):
            f = 0.0
            for i in range(count):
                f += CLOSED[k, j, i] * moments[i]
            lanes[SLOWNESS + j] = -h * t_bar * f
    else:
        lanes[SLOWNESS], lanes[SLOWNESS + end] = 0.0, 0.0
        for j in range(1, end):
            f = 1.0 / math.sqrt(lanes[SPEED2 + j])
            time += WEIGHTS[k, j - 1] * f
            lanes[SLOWNESS + j] = -0.5 * h * t_bar * WEIGHTS[k, j - 1] * f * f * f
    h_bar = t_bar * time
    lanes[SLOWNESS + end] += u_bar
    # the map: bars of E in SPEED2, of U in SLOWNESS
    u0_bar = lanes[SLOWNESS]
    for j in range(1, end + 1):
        x = lanes[SLOWNESS + j]
        lanes[SPEED2 + j] = (u0 + lanes[MAP_U + j]) * x
        lanes[SLOWNESS + j] = lanes[MAP_E + j] * x
        u0_bar += lanes[SLOWNESS + j]
    for j in range(count):
        bars[SEED_M + j], bars[SEED_G + j], bars[SEED_D + j] = 0.0, 0.0, 0.0
    if not arrays.conserves_energy(reverse.setting):
        for i in range(1, end):
            r_bar = WEIGHTS[k, i - 1] * lanes[SLOWNESS + end]
            for j in range(1, end):
                r_bar += RUNNING[k, i - 1, j - 1] * lanes[SLOWNESS + j]
            inv, rate = 1.0 / lanes[SUM_M + i], lanes[RATE + i]
            bars[SEED_G + i] = r_bar * 2.0 * gravity * h * inv / lanes[MAP_E + i]
            reverse.physics_bar.gravity += r_bar * rate / gravity
            h_bar += r_bar * rate / h
            bars[SEED_M + i] = -r_bar * rate * inv
            lanes[COEF + i] = lanes[MAP_E + i] * lanes[SPEED2 + i] - r_bar * rate
        for i in range(1, end):
            q_bar = WEIGHTS[k, i - 1] * lanes[MAP_E + end] * lanes[SPEED2 + end]
            for j in range(1, end):
                q_bar += RUNNING[k, i - 1, j - 1] * lanes[COEF + j]
            inv, q = 1.0 / lanes[SUM_M + i], lanes[EXPO + i]
            bars[SEED_D + i] = -2.0 * h * inv * q_bar
            h_bar += q * q_bar / h
            bars[SEED_M + i] -= q * q_bar * inv
    else:
        m0 = lanes[SUM_M]
        for j in range(1, end + 1):
            e_bar, x = lanes[SPEED2 + j], lanes[SLOWNESS + j]
            bars[SEED_M + j] = -lanes[MAP_E + j] / lanes[SUM_M + j] * e_bar
            bars[SEED_G + j] = -2.0 * gravity / m0 * x
            bars[SEED_M] += (e_bar / lanes[SUM_M + j]) - lanes[MAP_U + j] / m0 * x
            bars[SEED_G] -= bars[SEED_G + j]
            reverse.physics_bar.gravity += lanes[MAP_U + j] / gravity * x
    bars[SEED_M + end] += m_bar
    return u0_bar, h_bar


@internal
def interval_stack_back(reverse, k, n, low, end_bar):
    """Propagate the seeds of an interval through its stack.

    end_bar: bar of the last angle from later events.  Returns bars of its first and last angle.
    """
    bars, first = reverse.bars, reverse.saved[0]
    count, first_bar = ORDERS[k] + 2, 0.0
    stack.stack_back(reverse, count, n, low)
    for j in range(count):  # the angle of lane j is a + h x_j
        x = stack.angle_bar(bars, first, j)
        first_bar += x
        end_bar += POSITIONS[k, j] * x
        reverse.physics_bar.friction += bars[B_MU + j]
    return first_bar - end_bar, end_bar


@internal
def interval_back(reverse, event, u_bar, t_bar, m_bar):
    """Propagate bars over one interval.

    u_bar, t_bar, m_bar: bars of u at its end, of its time, and of M at its end.
    Returns bars of u at its start, of its first and of its last angle.
    """
    n, k, low = event.leader, event.rule, event.low
    count = set_angles(reverse.lanes, k, event.angle, event.length)
    stack.retrace(reverse, count, n, low, False)
    affine_map(reverse.lanes, k, event.length, reverse.setting)
    u0_bar, end_bar = interval_seeds(reverse, event, u_bar, t_bar, m_bar)
    first_bar, end_bar = interval_stack_back(reverse, k, n, low, end_bar)
    return u0_bar, first_bar, end_bar


# the stack in `saved`, in the lanes and in the table; -1 for none
SHARED_STACK = arrays.record_type(
    rule=int,
    depth=int,  # of the stack in `saved`, which contains all shorter ones
    mapped=int,  # depth of the stack whose map the lanes hold
    tabled=int,  # depth of the stack in the table
)


@internal
def reset_shared(shared):
    """Mark the shared stack as absent, as the lanes are used for another."""
    shared.rule = shared.depth = shared.mapped = shared.tabled = -1


@internal
def fall_back(reverse, shared, table, event, u_bar, t_bar, m_bar):
    """Propagate bars over a whole fall; return bars of u at its start and of its last angle."""
    lanes, n, k, low = reverse.lanes, event.leader, event.rule, event.low
    depth, count = n - low, ORDERS[k] + 2
    if k != shared.rule or depth > shared.depth:
        reset_shared(shared)
        set_angles(lanes, k, event.angle, event.length)
        stack.retrace(reverse, count, n, low, True)
        shared.rule, shared.depth = k, depth
    if depth != shared.mapped:
        stack.copy_sums(reverse.saved[depth], lanes, count)
        affine_map(lanes, k, event.length, reverse.setting)
        shared.mapped = depth
    if low > 0 and depth != shared.tabled:  # the stack of most falls ends at this depth
        stack.tabulate_stack(reverse, k, n, low, table)
        shared.tabled = depth
    u_bar, end_bar = interval_seeds(reverse, event, u_bar, t_bar, m_bar)
    if low > 0:
        end_bar += stack.stack_back_from_table(reverse, count, n, low, table)
    else:
        _, end_bar = interval_stack_back(reverse, k, n, low, end_bar)
    return u_bar, end_bar
