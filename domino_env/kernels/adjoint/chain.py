"""A whole chain, backwards, and batches of them."""

import math

import numpy as np

from domino_env.kernels.adjoint.contact import (
    BARS,
    FLUSHING,
    PART_GAP,
    PART_HALF,
    PART_INERTIA,
    PART_PITCH,
    PART_RISE,
    PART_SLENDER,
    PART_THICK,
    PART_TURN,
    PARTS,
    flush_back,
    hit_angle_back,
    hit_back,
    switch_back,
)
from domino_env.kernels.adjoint.interval import SHARED, fall_back, forget, ride_back, room_for_table
from domino_env.kernels.adjoint.stack import mass_back
from domino_env.kernels.chain import is_uniform, ring_size, row_of, solve
from domino_env.kernels.contact import at_or_zero, join, new_ring, stand
from domino_env.kernels.fall import fall_angle
from domino_env.kernels.jit import entry_point, internal, keep_alive, noinline
from domino_env.kernels.quadrature import ORDERS
from domino_env.kernels.records import summarise
from domino_env.kernels.slots import (
    ARRIVAL,
    CORNER,
    EVENT,
    FLIP,
    HIT,
    LANES,
    PITCH,
    PROPAGATED,
    RIDE,
    STATE,
    SWITCH,
    TIP,
    is_uneven,
    turn_of,
)

AT_SPLIT, AT_HIT, AT_SWITCH = 0, 1, 2  # what an interval ends at


@internal
def rewind(tape, used, ring, mu, gravity, arrival_bar, lanes, bars, trail, table, parts, whole):
    """Walk the tape back, gathering bars in `parts` and `whole`; returns the bar of the first u.

    ring: all dominoes and links, in the contacts of the end.
    table: room for what the falls of a uniform row share; empty for others.
    """
    u_bar, m_bar, t_bar = 0.0, 0.0, 0.0
    own_shared = np.empty(1, SHARED)
    shared = own_shared[0]
    forget(shared)
    edge, edge_bar, edge_row = AT_SPLIT, 0.0, 0
    counted = len(arrival_bar)
    last_hit = used - 1
    while last_hit >= 0 and tape[last_hit].kind != HIT:
        last_hit -= 1
    for at in range(used - 1, -1, -1):
        event = tape[at]
        kind, n = event.kind, event.leader
        if edge == AT_HIT and at < last_hit and kind != RIDE:
            # a switch at the very instant of the hit: M there is that of the new states
            struck, low = tape[edge_row].leader, tape[edge_row].low
            b = fall_angle(ring[struck], True)
            x_bar = mass_back(lanes, bars, trail, ring, struck, low, b, m_bar, mu, parts, whole)
            hit_angle_back(ring[struck], math.cos(b + turn_of(ring[struck])), x_bar, parts[struck])
            m_bar, edge, edge_bar = 0.0, AT_SPLIT, 0.0
        if kind == FLIP:
            ring[n].contact = TIP
        elif at > last_hit:
            continue  # what no arrival has seen
        elif kind == HIT:
            while counted > n + 1:  # the time of a fall is part of all later arrivals
                counted -= 1
                t_bar += arrival_bar[counted]
            u_bar, m_bar = hit_back(ring, event, u_bar, mu, parts, whole)
            edge, edge_bar, edge_row = AT_HIT, 0.0, at
        elif kind == SWITCH:
            if event.flushed and mu > 0.0:
                for i in range(at + 1, at + 1 + event.flips):
                    ring[tape[i].leader].contact = FLUSHING
                u_bar, x_bar = flush_back(trail, ring, event, u_bar, mu, parts, whole)
                edge_bar += x_bar
                for i in range(at + 1, at + 1 + event.flips):
                    ring[tape[i].leader].contact = TIP
            edge, edge_row = AT_SWITCH, at
            if at == 0 or tape[at - 1].kind != RIDE or tape[at - 1].leader != n:
                switch_back(trail, ring, event, edge_bar, mu, parts)
                edge, edge_bar = AT_SPLIT, 0.0
        else:
            if len(table) > 0 and edge == AT_HIT and event.angle == 0.0:
                u_bar, end_bar = fall_back(
                    shared, lanes, bars, trail, table, ring, event, u_bar, t_bar, m_bar, mu,
                    gravity, parts, whole,
                )  # fmt: skip
                start_bar = 0.0  # a fall starts upright, always
            else:
                forget(shared)
                u_bar, start_bar, end_bar = ride_back(
                    lanes, bars, trail, ring, event, u_bar, t_bar, m_bar, mu, gravity, parts, whole
                )
            edge_bar += end_bar
            if edge == AT_HIT:
                leader = ring[n]
                cosine = math.sqrt(leader.rest * (1.0 + leader.s_l))
                hit_angle_back(leader, cosine, edge_bar, parts[n])
            elif edge == AT_SWITCH:
                switch_back(trail, ring, tape[edge_row], edge_bar, mu, parts)
            edge, edge_bar, m_bar = AT_SPLIT, start_bar, 0.0
    keep_alive(own_shared)
    return u_bar


@internal
def stands_back(row, ring, parts, bar, tilt):
    """From the bars of bodies on their slopes to those of the slopes and of upright bodies."""
    if tilt is None:
        return
    count = len(tilt)
    bar.tilt[:] = 0.0
    for i in range(count):
        slender, domino = row.thickness[i] / row.height[i], ring[i]
        s, c = math.sin(tilt[i]), math.cos(tilt[i])
        half_bar, slender_bar = parts[i, PART_HALF], parts[i, PART_SLENDER]
        half = 0.5 * row.density[i] * row.height[i] * row.height[i] * row.thickness[i]
        turned = 1.0 + domino.slender * domino.slender  # of tan(φ - α)
        bar.tilt[i] += half * (slender * c - s) * half_bar - turned * slender_bar
        parts[i, PART_HALF] = (c + slender * s) * half_bar
        parts[i, PART_SLENDER] = turned / (1.0 + slender * slender) * slender_bar
        parts[i, PART_SLENDER] += half * s * half_bar
        if i + 1 < count:
            bar.tilt[i] += parts[i, PART_TURN]
    for i in range(count - 1):
        e_bar = parts[i, PART_RISE] / row.height[i]
        tan, sec = math.tan(tilt[i + 1]), 1.0 / math.cos(tilt[i + 1])
        pitch, rise = row.spacing[i] + row.thickness[i + 1], row.rise[i]
        bar.rise[i] = sec * e_bar
        bar.tilt[i + 1] += (pitch * sec + rise * tan) * sec * e_bar - parts[i, PART_TURN]
        parts[i, PART_PITCH] += tan * parts[i, PART_RISE]


@internal
def bodies_back(row, ring, parts, bar):
    """From the bars of links and bodies to those of all that the row is made of."""
    stands_back(row, ring, parts, bar, row.tilt)
    count = len(row.thickness)
    bar.thickness[:] = 0.0
    bar.height[:] = 0.0
    for i in range(count):
        length, d, rho = row.height[i], row.thickness[i], row.density[i]
        inertia_bar, half_bar = parts[i, PART_INERTIA], parts[i, PART_HALF]
        slender_bar = parts[i, PART_SLENDER]
        square = (length * length + d * d) / 3.0
        bar.thickness[i] += (
            rho * length * (square + 2.0 * d * d / 3.0) * inertia_bar
            + 0.5 * rho * length * length * half_bar
            + slender_bar / length
        )
        bar.height[i] += (
            rho * d * (square + 2.0 * length * length / 3.0) * inertia_bar
            + rho * length * d * half_bar
            - d / (length * length) * slender_bar
        )
        bar.density[i] = length * d * (square * inertia_bar + 0.5 * length * half_bar)
        if i + 1 < count:
            link = ring[i]
            p_bar, s_bar, d_bar = parts[i, PART_PITCH], parts[i, PART_GAP], parts[i, PART_THICK]
            bar.spacing[i] = (p_bar + s_bar) / length
            bar.thickness[i + 1] += (p_bar + d_bar) / length
            bar.height[i] -= (link.p_l * p_bar + link.s_l * s_bar + link.d_l * d_bar) / length
            if is_uneven(link):
                upright = at_or_zero(row.rise, i) / math.cos(at_or_zero(row.tilt, i + 1))
                bar.height[i] -= upright * parts[i, PART_RISE] / (length * length)


@noinline
def pull_bars(row, mu, gravity, push, tape, used, arrival_bar, bar, whole):
    """Pull bars of the arrival times back to all that a chain is made of.

    bar: a `Row` that is written, as is `whole`.
    """
    count = len(row.thickness)
    ring = new_ring(row, count)
    for i in range(count):
        stand(ring, -1, i, row, i)
        if i + 1 < count:
            join(ring, -1, i, row, i, i + 1)
    depth, count_lanes = 0, 0
    for at in range(used):
        event = tape[at]
        if event.kind == FLIP:
            ring[event.leader].contact = CORNER
        else:
            depth = max(depth, event.leader - event.low)
            if event.kind == RIDE:
                count_lanes = max(count_lanes, ORDERS[event.rule] + 2)
    lanes, bars = np.zeros(LANES), np.zeros(BARS)
    trail, parts = np.empty((depth + 2, 8 * PITCH)), np.zeros((count, PARTS))
    whole.friction = whole.gravity = 0.0
    table = np.empty((0, 0))
    if count > 3 and is_uniform(row):
        table = room_for_table(depth, count_lanes)
    u_bar = rewind(
        tape, used, ring, mu, gravity, arrival_bar, lanes, bars, trail, table, parts, whole
    )
    whole.push = 2.0 * push * u_bar
    bodies_back(row, ring, parts, bar)
    keep_alive(ring)


@internal
def clear(bar, tilt):
    """Set all bars of a row to zero."""
    bar.spacing[:] = bar.thickness[:] = bar.height[:] = bar.density[:] = 0.0
    if tilt is not None:
        bar.rise[:] = 0.0
        tilt[:] = 0.0


@entry_point
def pull(row, mu, gravity, push, tape, used, arrival_bar, bar, whole):
    """`pull_bars`, for Python."""
    pull_bars(row, mu, gravity, push, tape, used, arrival_bar, bar, whole)


@entry_point
def pull_rows(first, last, rows, mu, gravity, push, rtol, summaries, bars, wholes):
    """`solve_rows` with the gradient of the last arrival time; zeros where it never comes.

    bars: a `Row` of (B, N-1) and thrice (B, N).  wholes: (B,).
    """
    count = rows.thickness.shape[1]
    ring, lanes = new_ring(rows, ring_size(count)), np.zeros(LANES)
    own_state, unrecorded = np.zeros(1, STATE), np.empty(0, ARRIVAL)
    tape, arrival_bar, state = np.empty(4 * count + 16, EVENT), np.zeros(count), own_state[0]
    arrival_bar[count - 1] = 1.0
    for b in range(first, last):
        row = row_of(rows, b)
        bar = row_of(bars, b)
        while True:
            outcome, leader, struck, toppled = solve(
                row, mu, gravity, push, rtol, lanes, ring, state, True, unrecorded, tape
            )
            if state.taped <= len(tape):
                break
            tape = np.empty(int(1.5 * state.taped), EVENT)  # the same run writes as many again
        summarise(summaries[b], count, outcome, leader, struck, toppled, state)
        if outcome == PROPAGATED:
            used = state.taped
            pull_bars(row, mu, gravity, push, tape, used, arrival_bar, bar, wholes[b])
        else:
            clear(bar, bar.tilt)
            wholes[b].friction = wholes[b].gravity = wholes[b].push = 0.0
    keep_alive(own_state)
    keep_alive(ring)
