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
    PART_RISE,
    PART_TURN,
    PARTS,
    SEED_D,
    SEED_G,
    SEED_M,
    ShapeBar,
    corner_back,
    tip_back,
)
from domino_env.kernels.contact import pose, shape_of
from domino_env.kernels.jit import always_inline, internal
from domino_env.kernels.quadrature import ORDERS, PLACES
from domino_env.kernels.slots import (
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
from domino_env.kernels.stack import lead, lean, lean_free


@always_inline
def keep_shape(bars, j, link, shape_bar):
    """Write the bars of a link into its lane."""
    bars[B_PITCH + j] = shape_bar.pitch
    bars[B_GAP + j] = shape_bar.gap
    bars[B_THICK + j] = shape_bar.thick
    if is_uneven(link):
        bars[B_RISE + j] = shape_bar.rise
        bars[B_TURN + j] = shape_bar.turn


@always_inline
def parts_of(link):
    """How many parts there are bars of."""
    return PARTS if is_uneven(link) else PARTS - 2


@always_inline
def lean_back(bars, above, here, count, link, mu, at_tip):
    """`lean` in reverse; `above` and `here` are the lanes before and after it."""
    shape, inertia, half, slender = shape_of(link), link.inertia, link.half_weight, link.slender
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
        keep_shape(bars, j, link, shape_bar)


@always_inline
def lean_free_back(bars, above, here, count, link, at_tip):
    """`lean_free` in reverse."""
    shape, inertia, half, slender = shape_of(link), link.inertia, link.half_weight, link.slender
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
        keep_shape(bars, j, link, shape_bar)


@internal
def gather(bars, count, domino, parts):
    """Add what all lanes say of one domino and its link."""
    for k in range(2):  # three sums at a time, each of which waits for its last addition
        a, b, c = 0.0, 0.0, 0.0
        at = B_PITCH + 3 * k * PITCH
        for j in range(count):
            a += bars[at + j]
            b += bars[at + PITCH + j]
            c += bars[at + 2 * PITCH + j]
        parts[3 * k] += a
        parts[3 * k + 1] += b
        parts[3 * k + 2] += c
    if is_uneven(domino):
        e, turn = 0.0, 0.0
        for j in range(count):
            e += bars[B_RISE + j]
            turn += bars[B_TURN + j]
        parts[PART_RISE] += e
        parts[PART_TURN] += turn


@internal
def retrace(lanes, count, ring, n, low, mu, trail, shared):
    """Lead the lanes down the stack once more, keeping what they were at every domino.

    shared: keep the sums down to there too, for stacks that end at any of them.
    """
    lead(lanes, count, ring[n], mu)
    here = trail[0]
    for j in range(count):
        here[SIN + j], here[VER + j] = lanes[SIN + j], lanes[VER + j]
        here[WGT + j], here[JAC + j], here[DRV + j] = 1.0, 1.0, 0.0
    if shared:
        copy_sums(lanes, here, count)
    for i in range(n - 1, low - 1, -1):
        here = trail[n - i]
        if mu > 0.0:
            lean(lanes, count, ring[i], mu)
            for j in range(count):
                here[WGT + j], here[DRV + j] = lanes[WGT + j], lanes[DRV + j]
        else:
            lean_free(lanes, count, ring[i])
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
def link_back(bars, above, here, count, link, mu):
    """Lead all bars up over one link, whatever its contact."""
    if mu > 0.0:  # a constant in the call lets the compiler make a loop for each contact
        if link.contact == TIP:
            lean_back(bars, above, here, count, link, mu, True)
        else:
            lean_back(bars, above, here, count, link, mu, False)
    elif link.contact == TIP:
        lean_free_back(bars, above, here, count, link, True)
    else:
        lean_free_back(bars, above, here, count, link, False)


@always_inline
def lead_back(bars, first, count, leader, mu):
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
def stack_back(bars, count, ring, n, low, mu, trail, parts):
    """Pull the seeds of the three sums back through the stack."""
    no_bars(bars, count)
    for i in range(low, n):
        link_back(bars, trail[n - i - 1], trail[n - i], count, ring[i], mu)
        gather(bars, count, ring[i], parts[i])
    lead_back(bars, trail[0], count, ring[n], mu)
    gather(bars, count, ring[n], parts[n])


@internal
def tabulate(bars, k, ring, n, low, mu, trail, table):
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
                link_back(bars, trail[n - i - 1], trail[n - i], count, ring[i], mu)
            else:
                lead_back(bars, trail[0], count, ring[n], mu)
            for j in range(count):
                for c in range(parts_of(ring[i])):
                    table[q * count + j, (n - i) * PARTS + c] = bars[B_PITCH + c * PITCH + j]
        for j in range(count):
            x, at = angle_bar(bars, trail[0], j), (depth + 1) * PARTS
            table[q * count + j, at] = PLACES[k, j] * x
            table[q * count + j, at + 1] = bars[B_MU + j] if mu > 0.0 else 0.0


@internal
def stack_back_again(bars, count, n, low, table, sums, parts, whole):
    """`stack_back` by the table; returns the bar of the last angle."""
    depth = n - low
    size = (depth + 2) * PARTS
    for x in range(size):
        sums[x] = 0.0
    for q in range(3):
        for j in range(count):
            seed, row = bars[SEED_M + q * PITCH + j], table[q * count + j]
            if seed != 0.0:
                for x in range(size):
                    sums[x] += seed * row[x]
    for level in range(depth + 1):
        for c in range(PARTS):
            parts[n - level, c] += sums[level * PARTS + c]
    at = (depth + 1) * PARTS
    whole.friction += sums[at + 1]
    return sums[at]


@internal
def mass_back(lanes, bars, trail, ring, n, low, angle, m_bar, mu, parts, whole):
    """M of the stack at one angle in reverse; returns the bar of the angle."""
    lanes[SIN], lanes[VER] = pose(angle)
    retrace(lanes, 1, ring, n, low, mu, trail, False)
    bars[SEED_M], bars[SEED_G], bars[SEED_D] = m_bar, 0.0, 0.0
    stack_back(bars, 1, ring, n, low, mu, trail, parts)
    whole.friction += bars[B_MU]
    return angle_bar(bars, trail[0], 0)
