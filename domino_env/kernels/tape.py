"""The tape: what a chain did, event by event, for those who ask for gradients.

Where the tape is full, events are only counted, so that a longer one can be made.
"""

from domino_env.kernels.jit import internal
from domino_env.kernels.slots import CORNER, FLIP, HIT, RIDE, SWITCH


@internal
def note_ride(tape, state, n, a, h, rule, low, u):
    """Leader n rode over the interval [a, a + h], with u at its start."""
    if state.taped < len(tape):
        event = tape[state.taped]
        event.kind, event.leader, event.low = RIDE, n, low
        event.angle, event.length, event.rule = a, h, rule
        event.u, event.crept = u, state.crept
    state.taped += 1


@internal
def note_hit(tape, state, n):
    """Leader n has struck the next."""
    if state.taped < len(tape):
        event = tape[state.taped]
        event.kind, event.leader, event.low = HIT, n, n - state.depth
        event.u, event.m = state.u_impact, state.m_end
    state.taped += 1


@internal
def note_flips(tape, ring, mask, n, low, state):
    """The links that have turned corner unseen; returns how many."""
    flips = 0
    for i in range(low, n):
        link = ring[i & mask]
        if link.contact == CORNER and link.noted == 0:
            link.noted = 1
            if state.taped < len(tape):
                event = tape[state.taped]
                event.kind, event.leader = FLIP, i
            state.taped += 1
            flips += 1
    return flips


@internal
def note_switch(tape, ring, mask, n, due_link, low, angle, flushes, state):
    """A switch at the leader's angle, and the links that it has turned."""
    at = state.taped
    state.taped += 1
    flips = note_flips(tape, ring, mask, n, low, state)
    if at < len(tape):
        event = tape[at]
        event.kind, event.leader, event.low = SWITCH, n, low
        event.link, event.flushed, event.flips = due_link, flushes, flips
        event.angle, event.u = angle, state.u
