"""A whole chain, and batches of them."""

import numpy as np

from domino_env.kernels.contact import pose
from domino_env.kernels.fall import step
from domino_env.kernels.front import lengthen_tail, open_chain, place
from domino_env.kernels.jit import (
    always_inline,
    borrowed,
    entry_point,
    internal,
    keep_alive,
    noinline,
    select,
)
from domino_env.kernels.links import join, new_ring
from domino_env.kernels.records import blank, record, summarise
from domino_env.kernels.slots import (
    ARRIVAL,
    EVENT,
    JAMMED,
    LANES,
    OUT_OF_REACH,
    PROPAGATED,
    RING_ROWS,
    STATE,
    Row,
)
from domino_env.kernels.stack import renew_tails
from domino_env.kernels.switch import census
from domino_env.kernels.uniform import is_uniform, uniform_chain


@internal
def ring_size(count):
    """Rows of the ring of a chain: a power of two with room for all, up to RING_ROWS."""
    size = 2
    while size < count + 1 and size < RING_ROWS:
        size *= 2
    return size


@always_inline
def prepare(row, ring, mask, n, state):
    """Make ready for the fall of leader n: the domino that it is to hit, and the bound on what
    lies behind."""
    place(row, ring, mask, n, state)
    if n % 4 == 0 and n > 0:
        renew_tails(ring, mask, max(n - 1 - state.depth, 0, n - mask), n)
    else:
        lengthen_tail(ring, mask, n)


@always_inline
def ending(ring, mask, n, mu, state, outcome):
    """(outcome, leader, dominoes struck, dominoes past tipping) of a wave that ends under n."""
    s, v = pose(state.angle)
    toppled = census(ring, mask, n, state.back, s, v, mu, state)
    if outcome in (OUT_OF_REACH, PROPAGATED):  # the leader is just at tipping
        toppled = n + 1
    struck = n + 2 if outcome == JAMMED and state.part == 1.0 else n + 1
    return outcome, n, struck, toppled


@noinline
def chain(row, mu, gravity, push, rtol, lanes, ring, state, deep, arrivals, tape):
    """A whole chain.  Returns (outcome, leader at the end, dominoes struck, dominoes past tipping).

    push = 0 rides no wave but composes the maps of all falls: gain, offset and need in `state`.
    deep: find the true minimum of u in every interval, not only where a stall is near.
    arrivals: of each domino, or empty where only what is in `state` is wanted.
    tape: rows for what `pull` needs, of which state.taped would be used; none where it is empty.
    """
    count = len(row.thickness)
    open_chain(row, push, ring, state)
    blank(arrivals, push)
    first, mask = 0, len(ring) - 1
    n, outcome = 0, PROPAGATED
    if push == 0.0:
        state.composing = True
    elif count > 3 and is_uniform(row):
        join(ring, 0, 0, row, 0, 0)
        ring[0].tail = count * ring[0].inertia
        outcome, first = uniform_chain(
            lanes, ring, count, mu, gravity, rtol, state, deep, arrivals, tape
        )
        n, mask = first, 0
    if outcome == PROPAGATED:
        for n in range(first, count):
            strikes = n + 1 < count and row.spacing[n] < row.height[n]
            if mask > 0:
                prepare(row, ring, mask, n, state)
            outcome = step(lanes, ring, mask, n, strikes, mu, gravity, rtol, state, deep, tape)
            if outcome == PROPAGATED and not strikes and n + 1 < count:
                outcome = OUT_OF_REACH
            record(arrivals, n, outcome, state)
            if outcome != PROPAGATED:
                break
    return ending(ring, mask, n, mu, state, outcome)


@internal
def solve(row, mu, gravity, push, rtol, lanes, ring, state, deep, arrivals, tape):
    """`chain`, again with a smaller tolerance while its own estimate exceeds the one asked for.

    Where rounding alone exceeds it, no rule helps, and the estimate says so.
    """
    inner = rtol
    result = PROPAGATED, 0, 0, 0
    for _ in range(4):
        result = chain(row, mu, gravity, push, inner, lanes, ring, state, deep, arrivals, tape)
        if state.worst <= rtol or state.worst_round > 0.5 * rtol or inner < 1e-15:
            break
        inner *= max(0.3 * rtol / state.worst, 1e-3)
    return result


@always_inline
def row_of(rows, b):
    """Row b of a batch; where all have the same height or density, it stands there once."""
    return Row(
        rows.spacing[b],
        rows.thickness[b],
        rows.height[b if len(rows.height) > 1 else 0],
        rows.density[b if len(rows.density) > 1 else 0],
        select(rows.rise, b),
        select(rows.tilt, b),
    )


@entry_point
def solve_rows(first, last, rows, mu, gravity, push, rtol, deep, summaries, arrivals, tape):
    """Chains first … last - 1 of a batch.

    rows: a `Row` of (B, N-1), (B, N) and twice (B, N) or (1, N).  summaries: (B,).
    arrivals: (B, N), or (0, 0).  tape: for one chain, or empty.
    """
    count = rows.thickness.shape[1]
    own_ring, own_lanes = new_ring(rows, ring_size(count)), np.zeros(LANES)
    own_state = np.zeros(1, STATE)
    ring, lanes, state = borrowed(own_ring), borrowed(own_lanes), own_state[0]
    unrecorded = np.empty(0, ARRIVAL)
    for b in range(first, last):
        outcome, leader, struck, toppled = solve(
            row_of(rows, b), mu, gravity, push, rtol, lanes, ring, state, deep,
            arrivals[b] if len(arrivals) > 0 else unrecorded, tape,
        )  # fmt: skip
        summarise(summaries[b], count, outcome, leader, struck, toppled, state)
    keep_alive(own_ring)
    keep_alive(own_lanes)
    keep_alive(own_state)


@entry_point
def compose_row(row, mu, gravity, rtol):
    """The maps of all falls of a chain, composed: (outcome, least u_0 that runs through)."""
    own_state, ring = np.zeros(1, STATE), new_ring(row, ring_size(len(row.thickness)))
    lanes, state = np.zeros(LANES), own_state[0]
    unrecorded, untaped = np.empty(0, ARRIVAL), np.empty(0, EVENT)
    outcome, _, _, _ = chain(
        row, mu, gravity, 0.0, rtol, lanes, ring, state, True, unrecorded, untaped
    )
    need = state.need
    keep_alive(own_state)
    keep_alive(ring)
    return outcome, need
