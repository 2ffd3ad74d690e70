"""Records of a chain: its arrival times, its summary, and the event tape for gradients.

If the tape is full, further events are only counted, so that a longer tape can be made.
"""

import math

import numpy as np

from domino_env.kernels.arrays import CORNER, FLIP, HIT, INTERVAL, JAMMED, PROPAGATED, SWITCH
from domino_env.kernels.jit import always_inline, internal


@internal
def clear_arrivals(arrivals, state):
    """Reset all arrivals and set that of domino 0."""
    for i in range(len(arrivals)):
        arrival = arrivals[i]
        arrival.time = np.inf
        arrival.release = arrival.impact = arrival.margin = np.nan
    if len(arrivals) > 0:
        arrivals[0].time = 0.0
        arrivals[0].release = state.push


@internal
def record_fall(arrivals, n, outcome, state):
    """Record the margin of fall n and, after a hit, ω before and after it and its time."""
    if len(arrivals) == 0:
        return
    arrivals[n].margin = state.margin
    if n + 1 < len(arrivals) and state.fraction == 1.0 and outcome in (PROPAGATED, JAMMED):
        arrivals[n].impact = math.sqrt(state.u_impact)
        arrivals[n + 1].time = state.time
        if outcome == PROPAGATED:
            arrivals[n + 1].release = math.sqrt(state.u)


@internal
def summarise(summary, count, result, state):
    """Write the summary of a chain of `count` dominoes from the result of `solve`."""
    outcome, leader, summary.hit, summary.toppled = result
    summary.outcome = outcome
    summary.reach = 1.0 if outcome == PROPAGATED else (leader + state.fraction) / count
    summary.total_time = state.time if outcome == PROPAGATED else np.inf
    summary.estimate = state.worst
    summary.flushes, summary.releases = state.flushes, state.releases
    summary.flush_loss, summary.lowest_margin = state.flush_loss, state.lowest_margin
    summary.event_count = state.event_count


@always_inline
def has_tape(tape):
    """Return True if events are recorded; the tape of a simulation without gradient is empty."""
    return len(tape) > 0


@always_inline
def next_event(tape, state):
    """Return the index of the next event, and True if the tape has room for it."""
    at = state.event_count
    state.event_count += 1
    return at, at < len(tape)


@internal
def record_interval(tape, state, n, a, h, rule, low, u):
    """Record the interval [a, a + h] of leader n, with u at its start."""
    at, has_room = next_event(tape, state)
    if has_room:
        event = tape[at]
        event.kind, event.leader, event.low = INTERVAL, n, low
        event.angle, event.length, event.rule = a, h, rule
        event.u, event.slowest_at = u, state.slowest_at


@internal
def record_hit(tape, state, n):
    """Record that leader n hit the next domino."""
    at, has_room = next_event(tape, state)
    if has_room:
        event = tape[at]
        event.kind, event.leader, event.low = HIT, n, n - state.depth
        event.u, event.m = state.u_impact, state.m_end


@internal
def record_flips(tape, ring, state, n, low):
    """Record the contacts that moved to the corner since the last event; return their number."""
    flips = 0
    for i in range(low, n):
        contact = ring[i & state.mask]
        if contact.kind == CORNER and contact.on_tape == 0:
            contact.on_tape = 1
            at, has_room = next_event(tape, state)
            if has_room:
                tape[at].kind, tape[at].leader = FLIP, i
            flips += 1
    return flips


@internal
def record_switch(tape, ring, state, n, due_contact, low, angle, is_flush):
    """Record a change of contact at the leader's angle, then the contacts that moved to the corner.

    is_flush: True for a face impact, False for a separation.
    """
    at, has_room = next_event(tape, state)
    flips = record_flips(tape, ring, state, n, low)
    if has_room:
        event = tape[at]
        event.kind, event.leader, event.low = SWITCH, n, low
        event.contact, event.is_flush, event.flips = due_contact, is_flush, flips
        event.angle, event.u = angle, state.u
