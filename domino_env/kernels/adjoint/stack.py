"""Reverse mode of the stack: bars are propagated from its lowest domino to the leader."""

from domino_env.kernels import arrays
from domino_env.kernels.adjoint.contact import (
    B_DRV,
    B_GAP,
    B_HALF,
    B_INERTIA,
    B_JAC,
    B_MU,
    B_PITCH,
    B_RISE,
    B_SIN,
    B_TAN_PHI,
    B_THICKNESS,
    B_TURN,
    B_VER,
    B_WGT,
    PARAM_RISE,
    PARAM_TURN,
    PARAMS,
    SEED_D,
    SEED_G,
    SEED_M,
    ShapeBar,
    corner_back,
    tip_back,
)
from domino_env.kernels.arrays import DRV, JAC, SIN, STRIDE, SUM_D, SUM_G, SUM_M, VER, WGT
from domino_env.kernels.contact import body_of, shape_of, sin_versine, torque
from domino_env.kernels.jit import always_inline, internal, leaf
from domino_env.kernels.quadrature import ORDERS, POSITIONS
from domino_env.kernels.stack import add_domino, add_leader


@always_inline
def keep_shape(bars, j, contact, shape_bar):
    """Write the bars of a shape to lane j."""
    bars[B_PITCH + j] = shape_bar.pitch
    bars[B_GAP + j] = shape_bar.gap
    bars[B_THICKNESS + j] = shape_bar.thickness
    if arrays.is_uneven(contact):
        bars[B_RISE + j] = shape_bar.rise
        bars[B_TURN + j] = shape_bar.turn


@leaf
def torque_back(body, s, v, bar):
    """Return bars of s, v, half_weight and tan_phi from the bar of the torque over g."""
    by_weight, c = bar * body.half_weight, 1.0 - v
    half_bar = bar * (s - body.tan_phi * c)
    return by_weight, by_weight * body.tan_phi, half_bar, -by_weight * c


@leaf
def energy_back(body, s, v, bar):
    """Return what `torque_back` does from the bar of the energy over g that is released."""
    by_weight = bar * body.half_weight
    return by_weight * body.tan_phi, -by_weight, bar * (body.tan_phi * s - v), by_weight * s


@always_inline
def add_behind_back(bars, above, here, count, contact, setting, kind_back):
    """Propagate bars over `add_behind`.

    above, here: lanes before and after it.  kind_back: `tip_back` or `corner_back`.
    """
    shape, body, mu = shape_of(contact), body_of(contact), setting.friction
    if arrays.conserves_energy(setting):
        for j in range(count):
            s, v, jac = above[SIN + j], above[VER + j], above[JAC + j]
            s_i, v_i, jac_i = here[SIN + j], here[VER + j], here[JAC + j]
            m, g = bars[SEED_M + j], bars[SEED_G + j]
            jac_bar = bars[B_JAC + j] + 2.0 * m * body.inertia * jac_i
            s_bar, v_bar, bars[B_HALF + j], bars[B_TAN_PHI + j] = energy_back(body, s_i, v_i, g)
            s_bar, v_bar = bars[B_SIN + j] + s_bar, bars[B_VER + j] + v_bar
            bars[B_INERTIA + j] = m * jac_i * jac_i
            s_bar, v_bar, shape_bar, _, omega, _, _ = kind_back(
                s, v, shape, 0.0, s_bar, v_bar, jac_bar * jac, 0.0, 0.0
            )
            bars[B_SIN + j], bars[B_VER + j] = s_bar, v_bar
            bars[B_JAC + j] = jac_bar * omega
            keep_shape(bars, j, contact, shape_bar)
        return
    for j in range(count):
        s, v, w, jac, drv = above[SIN + j], above[VER + j], above[WGT + j], above[JAC + j], above[DRV + j]  # noqa: E501  # fmt: skip
        s_i, v_i, w_i, jac_i, drv_i = here[SIN + j], here[VER + j], here[WGT + j], here[JAC + j], here[DRV + j]  # noqa: E501  # fmt: skip
        m, g, d = bars[SEED_M + j], bars[SEED_G + j], bars[SEED_D + j]
        turn = m * jac_i + d * drv_i
        w_bar = bars[B_WGT + j] + body.inertia * turn + torque(body, s_i, v_i, g)
        jac_bar = bars[B_JAC + j] + m * w_i * body.inertia
        drv_bar = bars[B_DRV + j] + d * w_i * body.inertia
        s_bar, v_bar, bars[B_HALF + j], bars[B_TAN_PHI + j] = torque_back(body, s_i, v_i, g * w_i)
        s_bar, v_bar = bars[B_SIN + j] + s_bar, bars[B_VER + j] + v_bar
        bars[B_INERTIA + j] = w_i * turn
        o_bar, psi_bar, ratio_bar = drv_bar * drv + jac_bar * jac, drv_bar * jac * jac, w_bar * w
        s_bar, v_bar, shape_bar, mu_bar, omega, psi, ratio = kind_back(
            s, v, shape, mu, s_bar, v_bar, o_bar, psi_bar, ratio_bar
        )
        bars[B_SIN + j], bars[B_VER + j] = s_bar, v_bar
        bars[B_WGT + j] = w_bar * ratio
        bars[B_JAC + j] = jac_bar * omega + 2.0 * drv_bar * psi * jac
        bars[B_DRV + j] = drv_bar * omega
        bars[B_MU + j] += mu_bar
        keep_shape(bars, j, contact, shape_bar)


@internal
def gather(bars, count, domino, param_bars):
    """Add the bars of all lanes to those of one domino."""
    for k in range(2):  # three sums at a time, as each addition waits for the last one of its sum
        a, b, c = 0.0, 0.0, 0.0
        at = B_PITCH + 3 * k * STRIDE
        for j in range(count):
            a += bars[at + j]
            b += bars[at + STRIDE + j]
            c += bars[at + 2 * STRIDE + j]
        param_bars[3 * k] += a
        param_bars[3 * k + 1] += b
        param_bars[3 * k + 2] += c
    if arrays.is_uneven(domino):
        e, turn = 0.0, 0.0
        for j in range(count):
            e += bars[B_RISE + j]
            turn += bars[B_TURN + j]
        param_bars[PARAM_RISE] += e
        param_bars[PARAM_TURN] += turn


@internal
def retrace(reverse, count, n, low, with_sums):
    """Propagate the lanes down the stack again and save them at every domino.

    with_sums: save the sums at every domino too, for shorter stacks that end there.
    """
    lanes, ring, saved, setting = reverse.lanes, reverse.ring, reverse.saved, reverse.setting
    add_leader(lanes, count, ring[n], setting)
    here = saved[0]
    for j in range(count):
        here[SIN + j], here[VER + j] = lanes[SIN + j], lanes[VER + j]
        here[WGT + j], here[JAC + j], here[DRV + j] = 1.0, 1.0, 0.0
    if with_sums:
        copy_sums(lanes, here, count)
    for i in range(n - 1, low - 1, -1):
        here = saved[n - i]
        add_domino(lanes, count, ring[i], setting)
        if not arrays.conserves_energy(setting):
            for j in range(count):
                here[WGT + j], here[DRV + j] = lanes[WGT + j], lanes[DRV + j]
        for j in range(count):
            here[SIN + j], here[VER + j] = lanes[SIN + j], lanes[VER + j]
            here[JAC + j] = lanes[JAC + j]
        if with_sums:
            copy_sums(lanes, here, count)


@always_inline
def copy_sums(source, target, count):
    """Copy the three sums of all lanes."""
    for j in range(count):
        target[SUM_M + j], target[SUM_G + j] = source[SUM_M + j], source[SUM_G + j]
        target[SUM_D + j] = source[SUM_D + j]


@internal
def contact_back(bars, above, here, count, contact, setting):
    """Propagate all bars over one contact of either kind."""
    if contact.kind == arrays.TIP:
        add_behind_back(bars, above, here, count, contact, setting, tip_back)
    else:
        add_behind_back(bars, above, here, count, contact, setting, corner_back)


@always_inline
def add_leader_back(bars, first, count, leader, setting):
    """Propagate bars over `add_leader`; first: lanes at the leader."""
    body = body_of(leader)
    for j in range(count):
        s, v, g = first[SIN + j], first[VER + j], bars[SEED_G + j]
        keep_shape(bars, j, leader, ShapeBar(0.0, 0.0, 0.0, 0.0, 0.0))  # it has no contact
        bars[B_INERTIA + j] = bars[SEED_M + j]
        by_domino = torque_back(body, s, v, g)
        if arrays.conserves_energy(setting):
            by_domino = energy_back(body, s, v, g)
        s_bar, v_bar, bars[B_HALF + j], bars[B_TAN_PHI + j] = by_domino
        bars[B_SIN + j] += s_bar
        bars[B_VER + j] += v_bar


@internal
def clear_bars(bars, count):
    """Set the bars of friction and of the numbers that are propagated down the stack to 0."""
    for j in range(count):
        bars[B_SIN + j], bars[B_VER + j] = 0.0, 0.0
        bars[B_WGT + j], bars[B_JAC + j], bars[B_DRV + j] = 0.0, 0.0, 0.0
        bars[B_MU + j] = 0.0


@internal
def angle_bar(bars, first, j):
    """Return the bar of the angle of a lane."""
    return (1.0 - first[VER + j]) * bars[B_SIN + j] + first[SIN + j] * bars[B_VER + j]


@internal
def stack_back(reverse, count, n, low):
    """Propagate the seeds of the three sums through the stack, to the bars of all parameters."""
    ring, bars, saved, setting = reverse.ring, reverse.bars, reverse.saved, reverse.setting
    clear_bars(bars, count)
    for i in range(low, n):
        contact_back(bars, saved[n - i - 1], saved[n - i], count, ring[i], setting)
        gather(bars, count, ring[i], reverse.param_bars[i])
    add_leader_back(bars, saved[0], count, ring[n], setting)
    gather(bars, count, ring[n], reverse.param_bars[n])


@internal
def tabulate_stack(reverse, k, n, low, table):
    """Tabulate the bars for a seed of 1 of each sum and lane, for a stack that many falls share.

    table[q count + j, m PARAMS + c] is the bar of parameter c of the domino m behind the leader,
    for sum q and lane j.  The bars of the last angle and of friction follow after all dominoes.
    """
    ring, bars, saved, setting = reverse.ring, reverse.bars, reverse.saved, reverse.setting
    count, depth = ORDERS[k] + 2, n - low
    table[: 3 * count] = 0.0
    for q in range(3):
        for j in range(count):
            bars[SEED_M + j], bars[SEED_G + j], bars[SEED_D + j] = 0.0, 0.0, 0.0
            bars[SEED_M + q * STRIDE + j] = 1.0
        clear_bars(bars, count)
        for i in range(low, n + 1):
            if i < n:
                contact_back(bars, saved[n - i - 1], saved[n - i], count, ring[i], setting)
            else:
                add_leader_back(bars, saved[0], count, ring[n], setting)
            for j in range(count):
                for c in range(PARAMS if arrays.is_uneven(ring[i]) else PARAMS - 2):
                    table[q * count + j, (n - i) * PARAMS + c] = bars[B_PITCH + c * STRIDE + j]
        for j in range(count):
            x, at = angle_bar(bars, saved[0], j), (depth + 1) * PARAMS
            table[q * count + j, at] = POSITIONS[k, j] * x
            table[q * count + j, at + 1] = bars[B_MU + j]


@internal
def stack_back_from_table(reverse, count, n, low, table):
    """Compute the results of `stack_back` from the table; return the bar of the last angle."""
    depth, sums = n - low, table[len(table) - 1]  # the last line is for the total
    size = (depth + 2) * PARAMS
    for x in range(size):
        sums[x] = 0.0
    for q in range(3):
        for j in range(count):
            seed, entries = reverse.bars[SEED_M + q * STRIDE + j], table[q * count + j]
            if seed != 0.0:
                for x in range(size):
                    sums[x] += seed * entries[x]
    for level in range(depth + 1):
        for c in range(PARAMS):
            reverse.param_bars[n - level, c] += sums[level * PARAMS + c]
    at = (depth + 1) * PARAMS
    reverse.physics_bar.friction += sums[at + 1]
    return sums[at]


@internal
def mass_back(reverse, n, low, angle, m_bar):
    """Propagate the bar of M of the stack at one angle; return the bar of the angle."""
    lanes, bars = reverse.lanes, reverse.bars
    lanes[SIN], lanes[VER] = sin_versine(angle)
    retrace(reverse, 1, n, low, False)
    bars[SEED_M], bars[SEED_G], bars[SEED_D] = m_bar, 0.0, 0.0
    stack_back(reverse, 1, n, low)
    reverse.physics_bar.friction += bars[B_MU]
    return angle_bar(bars, reverse.saved[0], 0)
