"""The environments' step: one domino placed, one fall, for a whole batch in one call."""

import math

import numpy as np

from domino_env.kernels.chain import is_uniform, prepare
from domino_env.kernels.contact import step_of
from domino_env.kernels.fall import open_chain, step
from domino_env.kernels.ground import next_place, piece_at
from domino_env.kernels.jit import (
    always_inline,
    borrowed,
    entry_point,
    internal,
    keep_alive,
)
from domino_env.kernels.slots import EVENT, LANES, OUT_OF_REACH, PROPAGATED
from domino_env.kernels.step.action import (
    aim,
    choose,
    choose_back,
    gap_bounds,
    nearest_left,
    put_down,
    thickness_bounds,
)
from domino_env.kernels.step.batch import OVER, RUNNING, row_built, rules_of
from domino_env.kernels.step.observation import observe


@internal
def close_episode(rules, state, episode, n, outcome, row):
    """Write score and outcome of a wave that has completed, or stopped under leader n."""
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


@always_inline
def pitch_of(row, tilt, n):
    """Return the distance from pivot n to the next [m]."""
    pitch = row.spacing[n] + row.thickness[n + 1]
    if tilt is None:
        return pitch
    return math.hypot(pitch, step_of(row, n, n + 1))


@internal
def stand_next(batch, curve, b, row, n):
    """Stand domino n+1 behind gap n on uneven ground: write its tilt, its rise and its place."""
    if curve is None:
        return
    x = batch.places[b, n]
    gap, d = row.spacing[n], row.thickness[n + 1]
    if len(curve.knots) == 1:  # an even slope, whose rows stay as even as they are
        tilt = row.tilt[n]
        row.rise[n], row.tilt[n + 1] = -math.sin(tilt) * (gap + d), tilt
        batch.places[b, n + 1] = x + (gap + d) * math.cos(tilt)
        return
    tilt, up = next_place(curve, x, piece_at(curve, x, 0), gap, d, row.tilt[n])
    s, c = math.sin(tilt), math.cos(tilt)
    row.rise[n], row.tilt[n + 1] = up * c - (gap + d) * s, tilt
    batch.places[b, n + 1] = x + (gap + d) * c + up * s


@always_inline
def place_next(rules, lanes, ring, state, episode, row, untaped):
    """Let the leader fall onto the domino just written in the row.

    Returns the lead gained over a wave at the reference speed, in heights.
    """
    mask, count = len(ring) - 1, len(row.thickness)
    first = episode.placed
    pitch = pitch_of(row, row.tilt, first)
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


@entry_point
def reset_batch(first, last, batch, chosen, given, observations):
    """Begin episodes in the chosen environments, with the first `given` gaps as they are written.

    An episode whose wave does not get past what is given is OVER afterwards.
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
            left[k] = batch.kinds[1, k]
        for i in range(given[b]):
            if len(left) > 0:
                left[nearest_left(batch.kinds[0], left, row.thickness[i + 1])] -= 1.0
            stand_next(batch, batch.curve, b, row, i)
            lead = place_next(rules, lanes, ring, state, episode, row, untaped)
            episode.paid += lead * rules.reward_scale
            if episode.phase == OVER:
                break
        observe(batch, b, row, observations[b])


@entry_point
def step_batch(first, last, batch, actions, observations, rewards, ended):
    """Take one step in those environments first … last - 1 that run.

    actions: (B, A).  Written are observations (B, O), rewards (B,) and ended (B,); where an episode
    is over, only rewards (0) and ended (False).  The last reward of an episode follows from its
    score, and is left at 0.
    """
    own_lanes, own_tape = np.zeros(LANES), np.empty(0, EVENT)
    lanes, untaped = borrowed(own_lanes), borrowed(own_tape)
    lent, actions, observations = borrowed(batch), borrowed(actions), borrowed(observations)
    for b in range(first, last):
        rules = rules_of(lent, b)
        state, episode = lent.states[b], lent.episodes[b]
        rewards[b], ended[b] = 0.0, False
        if episode.phase != RUNNING:
            continue
        row = row_built(lent, b)
        choose(actions[b], rules, lent, lent.left[b], episode.placed, episode.way, row)
        put_down(rules, lent.errors, b, episode.placed, row.spacing)
        stand_next(lent, lent.curve, b, row, episode.placed)
        lead = place_next(rules, lanes, lent.rings[b], state, episode, row, untaped)
        if episode.phase == OVER:
            ended[b] = True
        else:
            rewards[b] = lead * rules.reward_scale
            episode.paid += rewards[b]
        observe(lent, b, row, observations[b])
    keep_alive(own_lanes)
    keep_alive(own_tape)


@entry_point
def place_batch(first, last, batch, chosen, actions):
    """Place all dominoes of the chosen environments, by actions (B, N-1, A); none falls yet."""
    lent, actions = borrowed(batch), borrowed(actions)
    for b in range(first, last):
        if not chosen[b]:
            continue
        rules, row, left, way = rules_of(lent, b), row_built(lent, b), lent.left[b], 0.0
        for k in range(len(left)):
            left[k] = lent.kinds[1, k]
        for n in range(len(row.spacing)):
            choose(actions[b, n], rules, lent, left, n, way, row)
            put_down(rules, lent.errors, b, n, row.spacing)
            way += row.spacing[n] + row.thickness[n + 1]
        episode = lent.episodes[b]
        episode.placed, episode.phase, episode.unsure = len(row.spacing), OVER, True


@entry_point
def place_back(first, last, batch, actions, bars, action_bars):
    """Write derivatives by the actions (B, N-1, A) of layouts that `place_batch` has written.

    bars: (B, N-1, 3) by each gap, and by thickness and height of the domino behind it.
    """
    lent, actions, carried = borrowed(batch), borrowed(actions), np.zeros(3)
    ways = np.zeros(actions.shape[1] + 1)
    for b in range(first, last):
        rules, row = rules_of(lent, b), row_built(lent, b)
        pairs = len(row.spacing)
        for n in range(pairs):
            ways[n + 1] = ways[n] + (row.spacing[n] + row.thickness[n + 1])
        carried[:] = 0.0
        for n in range(pairs - 1, -1, -1):
            choose_back(
                actions[b, n], rules, n, ways[n], row, bars[b, n], carried, action_bars[b, n]
            )


@entry_point
def aim_batch(first, last, batch, wanted, actions):
    """Write the actions (B, A) that come nearest to the wanted dominoes, where episodes run.

    wanted: (B, 4) gap, thickness, and the heights of the domino before and of this one [m].
    """
    for b in range(first, last):
        episode = batch.episodes[b]
        if episode.phase == RUNNING:
            spacing = row_built(batch, b).spacing
            aim(rules_of(batch, b), spacing, episode.placed, episode.way, wanted[b], actions[b])


@entry_point
def bounds_ahead(batch, b):
    """Return the bounds of the next gap and thickness; of the gap for the middle thickness."""
    rules, episode, spacing = rules_of(batch, b), batch.episodes[b], row_built(batch, b).spacing
    n, way = episode.placed, episode.way
    thin, thick = thickness_bounds(rules, len(spacing) - n, way)
    low, high = gap_bounds(rules, spacing, n, way, 0.5 * (thin + thick))
    return low, high, thin, thick
