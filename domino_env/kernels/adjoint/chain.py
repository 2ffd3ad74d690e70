"""Reverse mode of a whole chain, and of a batch."""

import math

import numpy as np

from domino_env.kernels import arrays
from domino_env.kernels.adjoint import contact
from domino_env.kernels.adjoint.contact import (
    PARAM_GAP,
    PARAM_HALF,
    PARAM_INERTIA,
    PARAM_PITCH,
    PARAM_RISE,
    PARAM_TAN_PHI,
    PARAM_THICKNESS,
    PARAM_TURN,
    PARAMS,
)
from domino_env.kernels.adjoint.interval import SHARED_STACK, fall_back, interval_back, reset_shared
from domino_env.kernels.adjoint.stack import mass_back
from domino_env.kernels.chain import is_uniform, layout_of, new_arrays, ring_length, solve
from domino_env.kernels.contact import at_or_zero, new_ring, place_contact, place_domino
from domino_env.kernels.fall import fall_angle
from domino_env.kernels.jit import borrow, entry_point, internal, keep_alive, noinline
from domino_env.kernels.quadrature import ORDERS
from domino_env.kernels.records import summarise

# how an interval ends: at no event, at a hit, at a change of contact
AT_SPLIT, AT_HIT, AT_SWITCH = 0, 1, 2


@internal
def backward(tape, reverse, arrival_bar, table):
    """Process the tape from its end, adding to the bars of all parameters; return the bar of push².

    The contacts of the ring are those at the end of the wave.  table: working array for the stack
    that all falls of a uniform layout share; empty for other layouts.
    """
    ring, param_bars = reverse.ring, reverse.param_bars
    u_bar, m_bar, t_bar = 0.0, 0.0, 0.0
    own_shared = np.empty(1, SHARED_STACK)
    shared = own_shared[0]
    reset_shared(shared)
    # how the next interval to process ends, the bar of its last angle, the index of the event there
    edge, edge_bar, edge_event = AT_SPLIT, 0.0, 0
    counted = len(arrival_bar)  # t_bar is the sum of arrival_bar from here on
    last_hit = len(tape) - 1
    while last_hit >= 0 and tape[last_hit].kind != arrays.HIT:
        last_hit -= 1
    for at in range(len(tape) - 1, -1, -1):
        event = tape[at]
        kind, n = event.kind, event.leader
        if edge == AT_HIT and at < last_hit and kind != arrays.INTERVAL:
            # a change of contact at the time of the hit; M of the hit is that of the new contacts
            leader, low = tape[edge_event].leader, tape[edge_event].low
            b = fall_angle(ring[leader], True)
            x_bar = mass_back(reverse, leader, low, b, m_bar)
            cosine = math.cos(b + arrays.turn_of(ring[leader]))
            contact.hit_angle_back(cosine, x_bar, param_bars[leader])
            m_bar, edge, edge_bar = 0.0, AT_SPLIT, 0.0
        if kind == arrays.FLIP:
            ring[n].kind = arrays.TIP
        elif at > last_hit:
            continue  # no arrival time depends on it
        elif kind == arrays.HIT:
            while counted > n + 1:  # the time of a fall is part of all later arrival times
                counted -= 1
                t_bar += arrival_bar[counted]
            u_bar, m_bar = contact.hit_back(reverse, event, u_bar)
            edge, edge_bar, edge_event = AT_HIT, 0.0, at
        elif kind == arrays.SWITCH:
            if event.is_flush and reverse.setting.friction > 0.0:
                for i in range(at + 1, at + 1 + event.flips):
                    ring[tape[i].leader].kind = contact.FLUSHING
                u_bar, x_bar = contact.flush_back(reverse, event, u_bar)
                edge_bar += x_bar
                for i in range(at + 1, at + 1 + event.flips):
                    ring[tape[i].leader].kind = arrays.TIP
            edge, edge_event = AT_SWITCH, at
            if at == 0 or tape[at - 1].kind != arrays.INTERVAL or tape[at - 1].leader != n:
                contact.switch_back(reverse, event, edge_bar)
                edge, edge_bar = AT_SPLIT, 0.0
        else:
            if len(table) > 0 and edge == AT_HIT and event.angle == 0.0:
                u_bar, end_bar = fall_back(reverse, shared, table, event, u_bar, t_bar, m_bar)
                start_bar = 0.0  # a fall always starts upright
            else:
                reset_shared(shared)
                u_bar, start_bar, end_bar = interval_back(reverse, event, u_bar, t_bar, m_bar)
            edge_bar += end_bar
            if edge == AT_HIT:
                domino = ring[n]
                cosine = math.sqrt(domino.rest * (1.0 + domino.s_l))
                contact.hit_angle_back(cosine, edge_bar, param_bars[n])
            elif edge == AT_SWITCH:
                contact.switch_back(reverse, tape[edge_event], edge_bar)
            edge, edge_bar, m_bar = AT_SPLIT, start_bar, 0.0
    keep_alive(own_shared)
    return u_bar


@internal
def tilt_back(layout, ring, param_bars, bar, tilt):
    """Convert the bars of dominoes on slopes to those of the tilts and of upright dominoes."""
    if tilt is None:
        return
    count = len(tilt)
    arrays.set_zero(bar.tilt)
    for i in range(count):
        tan_phi, domino = layout.thickness[i] / layout.height[i], ring[i]
        s, c = math.sin(tilt[i]), math.cos(tilt[i])
        half_bar, tan_phi_bar = param_bars[i, PARAM_HALF], param_bars[i, PARAM_TAN_PHI]
        half = 0.5 * layout.density[i] * layout.height[i] * layout.height[i] * layout.thickness[i]
        rate = 1.0 + domino.tan_phi * domino.tan_phi  # derivative of tan(φ - α)
        bar.tilt[i] += half * (tan_phi * c - s) * half_bar - rate * tan_phi_bar
        param_bars[i, PARAM_HALF] = (c + tan_phi * s) * half_bar
        upright_rate = 1.0 + tan_phi * tan_phi
        param_bars[i, PARAM_TAN_PHI] = rate / upright_rate * tan_phi_bar
        param_bars[i, PARAM_TAN_PHI] += half * s * half_bar
        if i + 1 < count:
            bar.tilt[i] += param_bars[i, PARAM_TURN]
    for i in range(count - 1):
        e_bar = param_bars[i, PARAM_RISE] / layout.height[i]
        tan, sec = math.tan(tilt[i + 1]), 1.0 / math.cos(tilt[i + 1])
        pitch, rise = layout.spacing[i] + layout.thickness[i + 1], layout.rise[i]
        bar.rise[i] = sec * e_bar
        bar.tilt[i + 1] += (pitch * sec + rise * tan) * sec * e_bar - param_bars[i, PARAM_TURN]
        param_bars[i, PARAM_PITCH] += tan * param_bars[i, PARAM_RISE]


@internal
def layout_back(layout, ring, param_bars, bar):
    """Convert the bars of contacts and dominoes to those of the layout."""
    tilt_back(layout, ring, param_bars, bar, layout.tilt)
    count = len(layout.thickness)
    arrays.set_zero(bar.thickness)
    arrays.set_zero(bar.height)
    for i in range(count):
        length, d, rho = layout.height[i], layout.thickness[i], layout.density[i]
        inertia_bar, half_bar = param_bars[i, PARAM_INERTIA], param_bars[i, PARAM_HALF]
        tan_phi_bar = param_bars[i, PARAM_TAN_PHI]
        square = (length * length + d * d) / 3.0
        bar.thickness[i] += (
            rho * length * (square + 2.0 * d * d / 3.0) * inertia_bar
            + 0.5 * rho * length * length * half_bar
            + tan_phi_bar / length
        )
        bar.height[i] += (
            rho * d * (square + 2.0 * length * length / 3.0) * inertia_bar
            + rho * length * d * half_bar
            - d / (length * length) * tan_phi_bar
        )
        bar.density[i] = length * d * (square * inertia_bar + 0.5 * length * half_bar)
        if i + 1 < count:
            domino = ring[i]
            p_bar, s_bar = param_bars[i, PARAM_PITCH], param_bars[i, PARAM_GAP]
            d_bar = param_bars[i, PARAM_THICKNESS]
            bar.spacing[i] = (p_bar + s_bar) / length
            bar.thickness[i + 1] += (p_bar + d_bar) / length
            bar.height[i] -= (domino.p_l * p_bar + domino.s_l * s_bar + domino.d_l * d_bar) / length
            if arrays.is_uneven(domino):
                upright = at_or_zero(layout.rise, i) / math.cos(at_or_zero(layout.tilt, i + 1))
                bar.height[i] -= upright * param_bars[i, PARAM_RISE] / (length * length)


@noinline
def chain_vjp(layout, setting, tape, arrival_bar, bar, physics_bar):
    """Write the derivatives of Σ arrival_bar · arrival times with respect to layout and physics.

    tape: events of the simulation.  bar: `Arrays` of the layout's shapes.  physics_bar: zeros.
    """
    layout, tape, arrival_bar, bar = borrow((layout, tape, arrival_bar, bar))
    count = len(layout.thickness)
    own_ring = new_ring(layout, count)
    ring = borrow(own_ring)
    for i in range(count):
        place_domino(ring, arrays.ALL_KEPT, i, layout, i)
        if i + 1 < count:
            place_contact(ring, arrays.ALL_KEPT, i, layout, i, i + 1)
    depth, max_lanes = 0, 0  # largest of all events
    for at in range(len(tape)):
        event = tape[at]
        if event.kind == arrays.FLIP:
            ring[event.leader].kind = arrays.CORNER
        else:
            depth = max(depth, event.leader - event.low)
            if event.kind == arrays.INTERVAL:
                max_lanes = max(max_lanes, ORDERS[event.rule] + 2)
    table = np.empty((0, 0))
    if count > 3 and is_uniform(layout):  # as in `solve`
        # a line for each of three sums in each lane and one for their total; in it PARAMS bars for
        # each domino of the stack, then those of the last angle and of friction
        table = np.empty((3 * max_lanes + 1, (depth + 2) * PARAMS))
    saved = np.empty((depth + 2, 8 * arrays.STRIDE))  # the lanes from SIN to SUM_D
    own = np.zeros(arrays.LANES), np.zeros(contact.BARS), saved, np.zeros((count, PARAMS)), table
    lanes, bars, saved, param_bars, table = borrow(own)
    setting = arrays.Setting(*setting)
    reverse = contact.Reverse(ring, setting, lanes, bars, saved, param_bars, physics_bar)
    physics_bar.push = 2.0 * setting.push * backward(tape, reverse, arrival_bar, table)
    layout_back(layout, ring, param_bars, bar)
    keep_alive(own_ring)
    keep_alive(own)


@internal
def clear(bar, tilt):
    """Set all bars of a layout to 0."""
    for values in (bar.spacing, bar.thickness, bar.height, bar.density):
        arrays.set_zero(values)
    if tilt is not None:
        arrays.set_zero(bar.rise)
        arrays.set_zero(tilt)


@entry_point
def vjp(layout, setting, tape, arrival_bar, bar, physics_bars):
    """Write the derivatives of Σ arrival_bar · arrival times; see `chain_vjp`."""
    layout, tape = borrow((layout, tape))
    chain_vjp(layout, setting, tape, arrival_bar, bar, physics_bars[0])


@entry_point
def vjp_batch(first, last, layouts, setting, arrival_bars, summaries, bars, physics_bars):
    """Simulate layouts first … last - 1 and write gradients of arrival times; 0 if a wave stops.

    arrival_bars: (B, N), or (1, N) for all layouts, as `arrival_bar` of `chain_vjp`.
    bars: `Arrays` of the shapes of `layouts` for B layouts.  physics_bars: (B,) zeros.
    """
    count = layouts.thickness.shape[1]
    own = new_arrays(layouts, ring_length(count), setting, True)
    unrecorded = np.empty(0, arrays.ARRIVAL)
    layouts, bars = borrow((layouts, bars))
    states, lanes, ring = borrow(own)
    state = states[0]
    tape = np.empty(4 * count + 16, arrays.EVENT)  # usually long enough
    for b in range(first, last):
        layout, bar, physics_bar = layout_of(layouts, b), layout_of(bars, b), physics_bars[b]
        while True:
            result = solve(layout, lanes, ring, state, unrecorded, tape)
            if state.event_count <= len(tape):
                break
            # long enough for this layout, and probably for the later ones
            tape = np.empty(int(1.5 * state.event_count), arrays.EVENT)
        summarise(summaries[b], count, result, state)
        if result[0] == arrays.PROPAGATED:
            arrival_bar = arrival_bars[b if len(arrival_bars) > 1 else 0]
            events = tape[: state.event_count]
            chain_vjp(layout, setting, events, arrival_bar, bar, physics_bar)
        else:
            clear(bar, bar.tilt)
    keep_alive(own)
