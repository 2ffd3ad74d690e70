"""Beginning and step of a batch of episodes in one call; placement without simulation."""

import math

import numpy as np

from domino_env.kernels.arrays import LANES, PROPAGATED, configure, setting_of
from domino_env.kernels.chain import is_uniform, next_fall, no_tape
from domino_env.kernels.contact import contact_rise
from domino_env.kernels.fall import start_chain
from domino_env.kernels.ground import next_place, piece_at
from domino_env.kernels.jit import always_inline, borrow, entry_point, internal, keep_alive
from domino_env.kernels.step import action
from domino_env.kernels.step.batch import (
    BEGINNING,
    OVER,
    RUNNING,
    layout_in,
    row_in,
    rules_of,
    schedule_of,
    uniform_of,
)
from domino_env.kernels.step.observation import observe

BLOCK = 16  # environments whose scenes are read together
SAME_SIZE = 1e-12  # [m] largest difference, by rounding, of sizes from those of the baseline


@internal
def is_as_uniform(rules, uniform, layout):
    """Return True if a complete layout, or whole row, is the uniform baseline but for rounding."""
    for n in range(rules.count - 1):
        behind, ahead = layout.height[n], layout.height[n + 1]
        gap, thickness = uniform[n].gap, uniform[n].thickness
        if rules.in_heights:
            gap, thickness = gap * min(behind, ahead), thickness * ahead
        if (
            abs(layout.spacing[n] - gap) > SAME_SIZE
            or abs(layout.thickness[n + 1] - thickness) > SAME_SIZE
            or abs(ahead - uniform[n].growth * behind) > SAME_SIZE
        ):
            return False
    return True


@internal
def close_episode(rules, uniform, state, episode, n, outcome, row):
    """Write score and outcome of a wave that completed the row, or stopped with leader n."""
    count = len(row.thickness)
    episode.phase, episode.outcome = OVER, outcome
    episode.uncertain = not rules.score_is_speed
    # if the wave stops, the rest of the layout is not that of the baseline
    complete = episode.placed + 1 == rules.count
    episode.as_uniform = rules.fixed and complete and is_as_uniform(rules, uniform, row)
    if outcome == PROPAGATED:
        episode.reach = 1.0
        episode.score = episode.distance / state.time
        if state.worst > rules.rtol or is_uniform(row):
            episode.uncertain = True
    else:
        episode.reach = (n + state.fraction) / count
        episode.score = episode.reach - 1.0
        if n >= count - 2 and state.worst > rules.rtol:  # it may complete with a smaller tolerance
            episode.uncertain = True


@always_inline
def pitch_of(layout, tilt, n):
    """Return the distance from pivot n to the next [m]."""
    pitch = layout.spacing[n] + layout.thickness[n + 1]
    if tilt is None:
        return pitch
    return math.hypot(pitch, contact_rise(layout, n, n + 1))


@internal
def stand_on_ground(batch, curve, b, layout, n):
    """Place domino n+1 after gap n on uneven ground: write its tilt, rise and position."""
    if curve is None:
        return
    x = batch.places[b, n]
    gap, d = layout.spacing[n], layout.thickness[n + 1]
    if len(curve.knots) == 1:  # an even slope: without rounding, so that layouts remain uniform
        tilt = layout.tilt[n]
        layout.rise[n], layout.tilt[n + 1] = -math.sin(tilt) * (gap + d), tilt
        batch.places[b, n + 1] = x + (gap + d) * math.cos(tilt)
        return
    tilt, up = next_place(curve, x, piece_at(curve, x, 0), gap, d, layout.tilt[n])
    s, c = math.sin(tilt), math.cos(tilt)
    layout.rise[n], layout.tilt[n + 1] = up * c - (gap + d) * s, tilt
    batch.places[b, n + 1] = x + (gap + d) * c + up * s


@always_inline
def fall_onto_next(rules, uniform, batch, b, lanes, row, tape):
    """Simulate the fall of the leader onto the domino just written in the row.

    After the last domino that is placed, the wave runs to the end of the row.
    """
    ring, state, episode = batch.rings[b], batch.states[b], batch.episodes[b]
    count, first = len(row.thickness), episode.placed
    episode.placed = first + 1
    last = count - 1 if first + 2 == rules.count else first  # the last domino falls freely
    for n in range(first, last + 1):
        if n + 1 < count:
            if n > first:
                stand_on_ground(batch, batch.curve, b, row, n)
            episode.distance += pitch_of(row, row.tilt, n)
        outcome = next_fall(row, lanes, ring, n, state, tape)
        if outcome != PROPAGATED or n + 1 == count:
            close_episode(rules, uniform, state, episode, n, outcome, row)
            break


@always_inline
def expected_gain(rules, uniform, batch, b):
    """Return the gain [%] if the rest of the row were that of the uniform baseline."""
    state, episode = batch.states[b], batch.episodes[b]
    rest, end = uniform[episode.placed], uniform[rules.count - 1]  # after the last one: the run-out
    length, time = rest.length_left, rest.time_left
    if rules.length > 0.0:  # the remaining length, at the speed of the baseline there
        left = rules.length - episode.distance
        length = left + end.length_left
        time = end.time_left + (time - end.time_left) * (
            left / (rest.length_left - end.length_left)
        )
    elif batch.box.shape[1] > 0:
        number, thickness = action.pieces_left(rules, batch, b)
        if number == rules.count - 1 - episode.placed:  # all of them will be placed
            length += thickness - rest.thickness_left
    speed = (episode.distance + length) / (state.time + time)
    return 100.0 * (speed / rules.uniform_speed - 1.0)


@always_inline
def expected_gain_in_tempo(rules, episode, late):
    """Return the part of the expected gain [dB] that the dominoes placed so far contribute.

    Each contributes the same part of the gain of a layout without errors of arrival times, and the
    errors reduce it; later hits count as late as the last one, `late` [s]. With all dominoes placed
    it is the gain of the layout.
    """
    pairs = rules.count - 1
    squares = episode.squared_errors + (pairs - episode.placed) * late * late
    score = 1.0 / (1.0 + math.sqrt(squares / pairs) / rules.tolerance)
    most = -math.log10(rules.score_unit)
    return 10.0 * (math.log10(max(score, rules.least_score)) + most * episode.placed / pairs)


@always_inline
def step_reward(rules, uniform, batch, b):
    """Return the reward of a step that did not end the episode: the change of expected gain.

    With a schedule, the error of the last hit is added to those of the episode.
    """
    episode = batch.episodes[b]
    if rules.tolerance > 0.0:
        late = batch.states[b].time - schedule_of(batch, b)[episode.placed, 0]
        episode.squared_errors += late * late
        return expected_gain_in_tempo(rules, episode, late) - episode.reward_sum
    if not rules.rewards_steps:
        return 0.0
    return expected_gain(rules, uniform, batch, b) - episode.reward_sum


@always_inline
def load_scenes(batch, first, last):
    """Read what the next step of some environments needs of their scenes; return any number.

    Cache misses of several environments then overlap, which otherwise wait for one another.
    """
    total = 0.0
    for b in range(first, last):
        rules, uniform, n = rules_of(batch, b), uniform_of(batch, b), batch.episodes[b].placed
        total += rules.gravity + rules.gap_low + rules.tolerance
        total += uniform[0].gap + uniform[n].gap + uniform[min(n + 1, len(uniform) - 1)].time_left
    return total


@internal
def begin_episode(rules, batch, b, layout):
    """Begin an episode; return the number of dominoes that are given with it."""
    episode, state, given = batch.episodes[b], batch.states[b], batch.episodes[b].placed
    configure(state, batch.rings[b], setting_of(rules), False)
    start_chain(layout, batch.rings[b], state)
    episode.distance = episode.reward_sum = episode.reach = episode.score = 0.0
    episode.squared_errors = 0.0
    episode.placed, episode.phase, episode.outcome, episode.uncertain = 0, RUNNING, 0, False
    action.restock(batch, b, given)
    return given


@entry_point
def step_batch(first, last, batch, actions, observations, rewards, ended):
    """Begin the episodes that are BEGINNING, and take a step in those that are RUNNING.

    For environments first … last - 1; actions: (B, A), or (B, 0) to take no step. Writes
    observations (B, O), rewards (B,) and ended (B,); where nothing is done, only rewards (0) and
    ended (False). The last reward of an episode is 0 here: the caller computes it from the score.
    An episode begins with the first `placed` gaps of its arrays; it may be OVER afterwards.
    """
    own_lanes, own_tape = np.zeros(LANES), no_tape()
    lanes, tape = borrow(own_lanes), borrow(own_tape)
    view, actions, observations = borrow(batch), borrow(actions), borrow(observations)
    for b in range(first, last):
        if (b - first) % BLOCK == 0 and len(view.rules) > 1 and actions.shape[1] > 0:
            own_lanes[0] = load_scenes(view, b, min(b + BLOCK, last))
        rules, episode = rules_of(view, b), view.episodes[b]
        rewards[b], ended[b], begins = 0.0, False, episode.phase == BEGINNING
        if not begins and (episode.phase != RUNNING or actions.shape[1] == 0):
            continue
        layout, uniform, dominoes = layout_in(view, b), uniform_of(view, b), 1
        if begins:
            dominoes = begin_episode(rules, view, b, layout)
        else:
            action.decode(actions[b], rules, view, b, episode.placed, episode.distance, layout)
            action.add_placement_error(rules, view.errors, b, episode.placed, layout.spacing)
        for _ in range(dominoes):
            stand_on_ground(view, view.curve, b, layout, episode.placed)
            fall_onto_next(rules, uniform, view, b, lanes, row_in(view, b), tape)
            if episode.phase == OVER:
                ended[b] = True
                break
            rewards[b] = step_reward(rules, uniform, view, b)
            episode.reward_sum += rewards[b]
        observe(view, b, layout, observations[b])
    keep_alive(own_lanes)
    keep_alive(own_tape)


@entry_point
def place_batch(first, last, batch, chosen, actions):
    """Place all dominoes of the chosen environments, by actions (B, N-1, A), without simulation."""
    view, actions = borrow(batch), borrow(actions)
    for b in range(first, last):
        if not chosen[b]:
            continue
        rules, layout, distance = rules_of(view, b), layout_in(view, b), 0.0
        action.restock(view, b, 0)
        for n in range(len(layout.spacing)):
            action.decode(actions[b, n], rules, view, b, n, distance, layout)
            action.add_placement_error(rules, view.errors, b, n, layout.spacing)
            distance += layout.spacing[n] + layout.thickness[n + 1]
        episode = view.episodes[b]
        episode.placed, episode.phase, episode.uncertain = len(layout.spacing), OVER, True
        uniform = uniform_of(view, b)
        episode.as_uniform = rules.fixed and is_as_uniform(rules, uniform, layout)


@entry_point
def place_vjp(first, last, batch, actions, bars, action_bars):
    """Write derivatives by the actions (B, N-1, A) of `place_batch`, which wrote the layouts.

    bars: (B, N-1, 3) derivatives by each gap, and by thickness and height of the domino after it.
    """
    view, actions, later_bars = borrow(batch), borrow(actions), np.zeros(2)
    distances = np.zeros(actions.shape[1] + 1)
    for b in range(first, last):
        rules, uniform, layout = rules_of(view, b), uniform_of(view, b), layout_in(view, b)
        pairs, kinds = len(layout.spacing), view.box.shape[1]
        for n in range(pairs):
            distances[n + 1] = distances[n] + (layout.spacing[n] + layout.thickness[n + 1])
        later_bars[0] = later_bars[1] = 0.0
        for n in range(pairs - 1, -1, -1):
            taken, bar, action_bar = actions[b, n], bars[b, n], action_bars[b, n]
            action.decode_back(
                taken, rules, uniform[n], kinds, n, distances[n], layout, bar, later_bars,
                action_bar,
            )  # fmt: skip


@entry_point
def encode_batch(first, last, batch, target, actions):
    """Write the actions (B, A) that come nearest to given dominoes, in running episodes.

    target: (B, 4) next gap and thickness, and heights of the last and the next domino [m].
    """
    for b in range(first, last):
        episode = batch.episodes[b]
        if episode.phase == RUNNING:
            rules, spacing, n = rules_of(batch, b), layout_in(batch, b).spacing, episode.placed
            action.encode(rules, batch, b, spacing, n, episode.distance, target[b], actions[b])
