"""The environments' step: one domino placed, one fall, for all rows of a batch in one call."""

import numpy as np

from domino_env.kernels.batch import OVER, RUNNING, Batch, row_built, rules_of
from domino_env.kernels.chain import prepare
from domino_env.kernels.choice import choose, nearest_left, put_down
from domino_env.kernels.fall import step
from domino_env.kernels.front import open_chain
from domino_env.kernels.jit import (
    always_inline,
    borrowed,
    entry_point,
    internal,
    keep_alive,
    overloaded,
)
from domino_env.kernels.observation import observe
from domino_env.kernels.slots import EVENT, LANES, OUT_OF_REACH, PROPAGATED
from domino_env.kernels.uniform import is_uniform


@internal
def close_episode(rules, state, episode, n, outcome, row):
    """The wave has run through or died under leader n: what the row scores."""
    count = len(row.thickness)
    episode.phase, episode.outcome = OVER, outcome
    episode.unsure = not rules.score_is_speed
    if outcome == PROPAGATED:
        episode.reach = 1.0
        episode.score = episode.way / state.time
        if state.worst > rules.rtol or is_uniform(row):
            episode.unsure = True
    else:
        episode.reach = (n + state.part) / count
        episode.score = episode.reach - 1.0
        if n >= count - 2 and state.worst > rules.rtol:
            episode.unsure = True


@overloaded
@always_inline
def pitch_of(row, n):
    """From pivot n to the next [m]."""
    return row.spacing[n] + row.thickness[n + 1]


@overloaded
@always_inline
def stand_next(batch, b, row, n):
    """Stand domino n+1 behind gap n; on flat ground nothing else is to be said of it."""


@always_inline
def place_next(rules, lanes, ring, state, episode, row, untaped):
    """Let the leader fall on the domino just written in the row; returns the lead gained over a
    wave at the reference speed, in heights."""
    mask, count = len(ring) - 1, len(row.thickness)
    first = episode.placed
    pitch = pitch_of(row, first)
    episode.placed = first + 1
    episode.way += pitch
    lead = 0.0
    last = first + 1 if first + 2 == count else first  # the last domino falls free
    for n in range(first, last + 1):
        strikes = n + 1 < count and row.spacing[n] < row.height[n]
        prepare(row, ring, mask, n, state)
        outcome = step(
            lanes, ring, mask, n, strikes, rules.friction, rules.gravity, rules.rtol, state, False,
            untaped,
        )  # fmt: skip
        if outcome == PROPAGATED and not strikes and n + 1 < count:
            outcome = OUT_OF_REACH
        if n == first:
            lead = (pitch - rules.reference_speed * state.fall_time) / rules.unit
        if outcome != PROPAGATED or n + 1 == count:
            close_episode(rules, state, episode, n, outcome, row)
            break
    return lead


@overloaded
@always_inline
def lend(batch):
    """The same batch without reference counts."""
    return Batch(
        borrowed(batch.rules),
        borrowed(batch.features),
        borrowed(batch.closeness),
        borrowed(batch.gap_values),
        borrowed(batch.kinds),
        borrowed(batch.stock),
        borrowed(batch.left),
        borrowed(batch.errors),
        borrowed(batch.rings),
        borrowed(batch.states),
        borrowed(batch.episodes),
        borrowed(batch.spacing),
        borrowed(batch.thickness),
        borrowed(batch.height),
        borrowed(batch.density),
    )


@entry_point
def reset_rows(first, last, batch, chosen, given, observations):
    """Begin anew in the rows that are chosen, with the first `given` gaps as they are written.

    A row whose wave does not get past what is given is OVER afterwards.
    """
    lanes, untaped = np.zeros(LANES), np.empty(0, EVENT)
    for b in range(first, last):
        if not chosen[b]:
            continue
        rules, row = rules_of(batch, b), row_built(batch, b)
        ring, left = batch.rings[b], batch.left[b]
        state, episode = batch.states[b], batch.episodes[b]
        open_chain(row, rules.push, ring, state)
        episode.way = episode.paid = episode.reach = episode.score = 0.0
        episode.placed, episode.phase, episode.outcome, episode.unsure = 0, RUNNING, 0, False
        for k in range(len(left)):
            left[k] = batch.stock[k]
        for i in range(given[b]):
            if len(batch.kinds) > 0:
                left[nearest_left(batch.kinds, left, row.thickness[i + 1])] -= 1.0
            stand_next(batch, b, row, i)
            lead = place_next(rules, lanes, ring, state, episode, row, untaped)
            episode.paid += lead * rules.pays
            if episode.phase == OVER:
                break
        observe(batch, b, row, observations[b])


@entry_point
def step_rows(first, last, batch, actions, observations, rewards, ended):
    """One step of those rows first … last - 1 that run.

    actions: (B, A).  Written are observations (B, O), rewards (B,) and ended (B,); of rows that are
    over, only rewards (0) and ended (False).  The last reward of an episode follows from its score,
    and is left at 0.
    """
    own_lanes, own_tape = np.zeros(LANES), np.empty(0, EVENT)
    lanes, untaped = borrowed(own_lanes), borrowed(own_tape)
    lent, actions, observations = lend(batch), borrowed(actions), borrowed(observations)
    for b in range(first, last):
        rules = rules_of(lent, b)
        state, episode = lent.states[b], lent.episodes[b]
        rewards[b], ended[b] = 0.0, False
        if episode.phase != RUNNING:
            continue
        row = row_built(lent, b)
        choose(actions[b], rules, lent, lent.left[b], episode.placed, episode.way, row)
        put_down(rules, lent.errors, b, episode.placed, row.spacing)
        stand_next(lent, b, row, episode.placed)
        lead = place_next(rules, lanes, lent.rings[b], state, episode, row, untaped)
        if episode.phase == OVER:
            ended[b] = True
        else:
            rewards[b] = lead * rules.pays
            episode.paid += rewards[b]
        observe(lent, b, row, observations[b])
    keep_alive(own_lanes)
    keep_alive(own_tape)


@entry_point
def place_rows(first, last, batch, actions):
    """Place all dominoes of those rows that run, as actions (B, N-1, A) choose them; none falls."""
    lent, actions = lend(batch), borrowed(actions)
    for b in range(first, last):
        rules, row, left, way = rules_of(lent, b), row_built(lent, b), lent.left[b], 0.0
        episode = lent.episodes[b]
        if episode.phase != RUNNING:
            continue
        for k in range(len(left)):
            left[k] = lent.stock[k]
        for n in range(len(row.spacing)):
            choose(actions[b, n], rules, lent, left, n, way, row)
            put_down(rules, lent.errors, b, n, row.spacing)
            way += row.spacing[n] + row.thickness[n + 1]
        episode.placed, episode.phase, episode.unsure = len(row.spacing), OVER, True
