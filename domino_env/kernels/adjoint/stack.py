"""The stack, backwards: bars are led up it, from the cut to the leader."""

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
    B_SLENDER,
    B_THICK,
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
from domino_env.kernels.arrays import (
    DRV,
    JAC,
    PITCH,
    SIN,
    SUM_D,
    SUM_G,
    SUM_M,
    TIP,
    VER,
    WGT,
    is_uneven,
)
from domino_env.kernels.contact import shape_of, sin_versine
from domino_env.kernels.jit import always_inline, internal
from domino_env.kernels.quadrature import ORDERS, POSITIONS
from domino_env.kernels.stack import add_domino, add_domino_frictionless, add_leader


@always_inline
def keep_shape(bars, j, contact, shape_bar):
    """Write the bars of a link into its lane."""
    bars[B_PITCH + j] = shape_bar.pitch
    bars[B_GAP + j] = shape_bar.gap
    bars[B_THICK + j] = shape_bar.thick
    if is_uneven(contact):
        bars[B_RISE + j] = shape_bar.rise
        bars[B_TURN + j] = shape_bar.turn


@always_inline
def param_count(contact):
    """How many parts there are bars of."""
    return PARAMS if is_uneven(contact) else PARAMS - 2


@always_inline
def add_domino_back(bars, above, here, count, contact, mu, at_tip):
    """`lean` in reverse; `above` and `here` are the lanes before and after it."""
    shape, inertia, half, slender = (
        shape_of(contact),
        contact.inertia,
        contact.half_weight,
        contact.slender,
    )
    for j in range(count):
        s, v, w, jac, drv = above[SIN + j], above[VER + j], above[WGT + j], above[JAC + j], above[DRV + j]  # noqa: E501  # fmt: skip
        s_i, c_i, w_i, jac_i, drv_i = here[SIN + j], 1.0 - here[VER + j], here[WGT + j], here[JAC + j], here[DRV + j]  # noqa: E501  # fmt: skip
        m, g, d = bars[SEED_M + j], bars[SEED_G + j], bars[SEED_D + j]
        arm, turn = s_i - slender * c_i, m * jac_i + d * drv_i
        w_bar = bars[B_WGT + j] + inertia * turn + g * half * arm
        jac_bar = bars[B_JAC + j] + m * w_i * inertia
        drv_bar = bars[B_DRV + j] + d * w_i * inertia
        s_bar = bars[B_SIN + j] + g * w_i * half
        v_bar = bars[B_VER + j] + g * w_i * half * slender
        bars[B_INERTIA + j] = w_i * turn
        bars[B_HALF + j] = g * w_i * arm
        bars[B_SLENDER + j] = -g * w_i * half * c_i
        o_bar, psi_bar, ratio_bar = drv_bar * drv + jac_bar * jac, drv_bar * jac * jac, w_bar * w
        if at_tip:
            s_bar, v_bar, shape_bar, mu_bar, omega, psi, ratio = tip_back(
                s, v, shape, mu, s_bar, v_bar, o_bar, psi_bar, ratio_bar
            )
        else:
            s_bar, v_bar, shape_bar, mu_bar, omega, psi, ratio = corner_back(
                s, v, shape, mu, s_bar, v_bar, o_bar, psi_bar, ratio_bar
            )
        bars[B_SIN + j], bars[B_VER + j] = s_bar, v_bar
        bars[B_WGT + j] = w_bar * ratio
        bars[B_JAC + j] = jac_bar * omega + 2.0 * drv_bar * psi * jac
        bars[B_DRV + j] = drv_bar * omega
        bars[B_MU + j] += mu_bar
        keep_shape(bars, j, contact, shape_bar)


@always_inline
def add_domino_frictionless_back(bars, above, here, count, contact, at_tip):
    """`lean_free` in reverse."""
    shape, inertia, half, slender = (
        shape_of(contact),
        contact.inertia,
        contact.half_weight,
        contact.slender,
    )
    for j in range(count):
        s, v, jac = above[SIN + j], above[VER + j], above[JAC + j]
        s_i, v_i, jac_i = here[SIN + j], here[VER + j], here[JAC + j]
        m, g = bars[SEED_M + j], bars[SEED_G + j]
        jac_bar = bars[B_JAC + j] + 2.0 * m * inertia * jac_i
        s_bar = bars[B_SIN + j] + g * half * slender
        v_bar = bars[B_VER + j] - g * half
        bars[B_INERTIA + j] = m * jac_i * jac_i
        bars[B_HALF + j] = g * (slender * s_i - v_i)
        bars[B_SLENDER + j] = g * half * s_i
        if at_tip:
            s_bar, v_bar, shape_bar, _, omega, _, _ = tip_back(
                s, v, shape, 0.0, s_bar, v_bar, jac_bar * jac, 0.0, 0.0
            )
        else:
            s_bar, v_bar, shape_bar, _, omega, _, _ = corner_back(
                s, v, shape, 0.0, s_bar, v_bar, jac_bar * jac, 0.0, 0.0
            )
        bars[B_SIN + j], bars[B_VER + j] = s_bar, v_bar
        bars[B_JAC + j] = jac_bar * omega
        keep_shape(bars, j, contact, shape_bar)


@internal
def gather(bars, count, domino, param_bars):
    """Add what all lanes say of one domino and its link."""
    for k in range(2):  # three sums at a time, each of which waits for its last addition
        a, b, c = 0.0, 0.0, 0.0
        at = B_PITCH + 3 * k * PITCH
        for j in range(count):
            a += bars[at + j]
            b += bars[at + PITCH + j]
            c += bars[at + 2 * PITCH + j]
        param_bars[3 * k] += a
        param_bars[3 * k + 1] += b
        param_bars[3 * k + 2] += c
    if is_uneven(domino):
        e, turn = 0.0, 0.0
        for j in range(count):
            e += bars[B_RISE + j]
            turn += bars[B_TURN + j]
        param_bars[PARAM_RISE] += e
        param_bars[PARAM_TURN] += turn


@internal
def retrace(lanes, count, ring, n, low, mu, saved, shared):
    """Lead the lanes down the stack once more, keeping what they were at every domino.

    shared: keep the sums down to there too, for stacks that end at any of them.
    """
    add_leader(lanes, count, ring[n], mu)
    here = saved[0]
    for j in range(count):
        here[SIN + j], here[VER + j] = lanes[SIN + j], lanes[VER + j]
        here[WGT + j], here[JAC + j], here[DRV + j] = 1.0, 1.0, 0.0
    if shared:
        copy_sums(lanes, here, count)
    for i in range(n - 1, low - 1, -1):
        here = saved[n - i]
        if mu > 0.0:
            add_domino(lanes, count, ring[i], mu)
            for j in range(count):
                here[WGT + j], here[DRV + j] = lanes[WGT + j], lanes[DRV + j]
        else:
            add_domino_frictionless(lanes, count, ring[i])
        for j in range(count):
            here[SIN + j], here[VER + j] = lanes[SIN + j], lanes[VER + j]
            here[JAC + j] = lanes[JAC + j]
        if shared:
            copy_sums(lanes, here, count)


@always_inline
def copy_sums(source, target, count):
    """The three sums of all lanes."""
    for j in range(count):
        target[SUM_M + j], target[SUM_G + j] = source[SUM_M + j], source[SUM_G + j]
        target[SUM_D + j] = source[SUM_D + j]


@internal
def contact_back(bars, above, here, count, contact, mu):
    """Lead all bars up over one link, whatever its contact."""
    if mu > 0.0:  # a constant in the call lets the compiler make a loop for each contact
        if contact.kind == TIP:
            add_domino_back(bars, above, here, count, contact, mu, True)
        else:
            add_domino_back(bars, above, here, count, contact, mu, False)
    elif contact.kind == TIP:
        add_domino_frictionless_back(bars, above, here, count, contact, True)
    else:
        add_domino_frictionless_back(bars, above, here, count, contact, False)


@always_inline
def add_leader_back(bars, first, count, leader, mu):
    """`lead` in reverse; `first` are the lanes at the leader."""
    half, slender = leader.half_weight, leader.slender
    for j in range(count):
        s, v, g = first[SIN + j], first[VER + j], bars[SEED_G + j]
        keep_shape(bars, j, leader, ShapeBar(0.0, 0.0, 0.0, 0.0, 0.0))  # it has no link
        bars[B_INERTIA + j] = bars[SEED_M + j]
        if mu > 0.0:
            bars[B_SIN + j] += g * half
            bars[B_VER + j] += g * half * slender
            bars[B_HALF + j] = g * (s - slender * (1.0 - v))
            bars[B_SLENDER + j] = -g * half * (1.0 - v)
        else:
            bars[B_SIN + j] += g * half * slender
            bars[B_VER + j] -= g * half
            bars[B_HALF + j] = g * (slender * s - v)
            bars[B_SLENDER + j] = g * half * s


@internal
def no_bars(bars, count):
    for j in range(count):
        bars[B_SIN + j], bars[B_VER + j] = 0.0, 0.0
        bars[B_WGT + j], bars[B_JAC + j], bars[B_DRV + j] = 0.0, 0.0, 0.0
        bars[B_MU + j] = 0.0


@internal
def angle_bar(bars, first, j):
    """Bar of the angle of a lane."""
    return (1.0 - first[VER + j]) * bars[B_SIN + j] + first[SIN + j] * bars[B_VER + j]


@internal
def stack_back(bars, count, ring, n, low, mu, saved, param_bars):
    """Pull the seeds of the three sums back through the stack."""
    no_bars(bars, count)
    for i in range(low, n):
        contact_back(bars, saved[n - i - 1], saved[n - i], count, ring[i], mu)
        gather(bars, count, ring[i], param_bars[i])
    add_leader_back(bars, saved[0], count, ring[n], mu)
    gather(bars, count, ring[n], param_bars[n])


@internal
def tabulate_stack(bars, k, ring, n, low, mu, saved, table):
    """What one unit of each seed adds to each part: for stacks that many falls share.

    table[sum and lane, depth and part]; one depth more holds what it adds to the bars of the last
    angle and of the friction.
    """
    count, depth = ORDERS[k] + 2, n - low
    table[: 3 * count] = 0.0
    for q in range(3):
        for j in range(count):
            bars[SEED_M + j], bars[SEED_G + j], bars[SEED_D + j] = 0.0, 0.0, 0.0
            bars[SEED_M + q * PITCH + j] = 1.0
        no_bars(bars, count)
        for i in range(low, n + 1):
            if i < n:
                contact_back(bars, saved[n - i - 1], saved[n - i], count, ring[i], mu)
            else:
                add_leader_back(bars, saved[0], count, ring[n], mu)
            for j in range(count):
                for c in range(param_count(ring[i])):
                    table[q * count + j, (n - i) * PARAMS + c] = bars[B_PITCH + c * PITCH + j]
        for j in range(count):
            x, at = angle_bar(bars, saved[0], j), (depth + 1) * PARAMS
            table[q * count + j, at] = POSITIONS[k, j] * x
            table[q * count + j, at + 1] = bars[B_MU + j] if mu > 0.0 else 0.0


@internal
def stack_back_from_table(bars, count, n, low, table, sums, param_bars, physics_bar):
    """`stack_back` by the table; returns the bar of the last angle."""
    depth = n - low
    size = (depth + 2) * PARAMS
    for x in range(size):
        sums[x] = 0.0
    for q in range(3):
        for j in range(count):
            seed, entries = bars[SEED_M + q * PITCH + j], table[q * count + j]
            if seed != 0.0:
                for x in range(size):
                    sums[x] += seed * entries[x]
    for level in range(depth + 1):
        for c in range(PARAMS):
            param_bars[n - level, c] += sums[level * PARAMS + c]
    at = (depth + 1) * PARAMS
    physics_bar.friction += sums[at + 1]
    return sums[at]


@internal
def mass_back(lanes, bars, saved, ring, n, low, angle, m_bar, mu, param_bars, physics_bar):
    """M of the stack at one angle in reverse; returns the bar of the angle."""
    lanes[SIN], lanes[VER] = sin_versine(angle)
    retrace(lanes, 1, ring, n, low, mu, saved, False)
    bars[SEED_M], bars[SEED_G], bars[SEED_D] = m_bar, 0.0, 0.0
    stack_back(bars, 1, ring, n, low, mu, saved, param_bars)
    physics_bar.friction += bars[B_MU]
    return angle_bar(bars, saved[0], 0)
