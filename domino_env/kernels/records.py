"""What is kept of a chain: of each domino, of the whole, and the tape for gradients.

Where the tape is full, events are only counted, so that a longer one can be made.
"""

import math

import numpy as np

from domino_env.kernels.arrays import CORNER, FLIP, HIT, INTERVAL, JAMMED, PROPAGATED, SWITCH
from domino_env.kernels.jit import internal


@internal
def clear_arrivals(arrivals, push):
    """No domino has been reached but the first."""
    for i in range(len(arrivals)):
        arrival = arrivals[i]
        arrival.time = np.inf
        arrival.release = arrival.impact = arrival.margin = np.nan
    if len(arrivals) > 0:
        arrivals[0].time = 0.0
        arrivals[0].release = push


@internal
def record_fall(arrivals, n, outcome, state):
    """Write what fall n has shown: margin, and where it struck, both speeds and the arrival."""
    if len(arrivals) == 0:
        return
    arrivals[n].margin = state.margin
    if n + 1 < len(arrivals) and state.fraction == 1.0 and outcome in (PROPAGATED, JAMMED):
        arrivals[n].impact = math.sqrt(state.u_impact)
        arrivals[n + 1].time = state.time
        if outcome == PROPAGATED:
            arrivals[n + 1].release = math.sqrt(state.u)


@internal
def summarise(summary, count, outcome, leader, struck, toppled, state):
    """Write what became of a chain of `count` dominoes."""
    summary.outcome, summary.hit, summary.toppled = outcome, struck, toppled
    summary.reach = 1.0 if outcome == PROPAGATED else (leader + state.fraction) / count
    summary.total_time = state.time if outcome == PROPAGATED else np.inf
    summary.estimate = state.worst
    summary.flushes, summary.releases = state.flushes, state.releases
    summary.flush_loss, summary.lowest_margin = state.flush_loss, state.lowest_margin
    summary.taped = state.taped


@internal
def record_interval(tape, state, n, a, h, rule, low, u):
    """Leader n rode over the interval [a, a + h], with u at its start."""
    if state.taped < len(tape):
        event = tape[state.taped]
        event.kind, event.leader, event.low = INTERVAL, n, low
        event.angle, event.length, event.rule = a, h, rule
        event.u, event.slowest_at = u, state.slowest_at
    state.taped += 1


@internal
def record_hit(tape, state, n):
    """Leader n has struck the next."""
    if state.taped < len(tape):
        event = tape[state.taped]
        event.kind, event.leader, event.low = HIT, n, n - state.depth
        event.u, event.m = state.u_impact, state.m_end
    state.taped += 1


@internal
def record_flips(tape, ring, mask, n, low, state):
    """The links that have turned corner unseen; returns how many."""
    flips = 0
    for i in range(low, n):
        contact = ring[i & mask]
        if contact.kind == CORNER and contact.on_tape == 0:
            contact.on_tape = 1
            if state.taped < len(tape):
                event = tape[state.taped]
                event.kind, event.leader = FLIP, i
            state.taped += 1
            flips += 1
    return flips


@internal
def record_switch(tape, ring, mask, n, due_contact, low, angle, flushes, state):
    """A switch at the leader's angle, and the links that it has turned."""
    at = state.taped
    state.taped += 1
    flips = record_flips(tape, ring, mask, n, low, state)
    if at < len(tape):
        event = tape[at]
        event.kind, event.leader, event.low = SWITCH, n, low
        event.contact, event.flushed, event.flips = due_contact, flushes, flips
        event.angle, event.u = angle, state.u
