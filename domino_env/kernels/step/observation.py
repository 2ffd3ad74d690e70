"""Observations: named parts, in the order of the documentation of `DominoChain`."""

import math

from domino_env.kernels.arrays import PROPAGATED, record_type
from domino_env.kernels.ground import height_and_slope as ground_at
from domino_env.kernels.ground import piece_at
from domino_env.kernels.jit import always_inline, internal
from domino_env.kernels.step.batch import OVER, kinds_of, rules_of, schedule_of, uniform_of

# sizes at which these parts are clipped
FRONT_LIMIT, LEAD_LIMIT, SPEED_LIMIT, RISE_LIMIT = 50.0, 100.0, 20.0, 50.0
LATE_LIMIT, RATIO_LIMIT = 10.0, 5.0
LEAD_UNIT = 10.0  # heights per unit of `lead`
ENTRIES = (
    "front", "lead", "speed", "lateness", "intervals", "length_left", "pitch_left", "gaps",
    "thicknesses", "growths", "height", "hand", "stock", "placed", "near_start", "near_end",
    "features", "slopes", "rises",
)  # fmt: skip
# number of dominoes observed, and start of each part in an observation: -1 if it is absent
OBSERVATION = record_type(None, window=int, **dict.fromkeys(ENTRIES, int))


@always_inline
def log_ratio(value, uniform):
    """Return the logarithm of the ratio to the uniform baseline, clipped."""
    return min(max(math.log(value / uniform), -RATIO_LIMIT), RATIO_LIMIT)


@always_inline
def observe_wave(rules, state, episode, start, observation):
    """Write ω of the leader [√(g/L)] as `front`, and lead and speed against the baseline."""
    distance, unit = episode.distance, rules.unit
    stopped = episode.phase == OVER and episode.outcome != PROPAGATED
    front = 0.0 if stopped else math.sqrt(state.u * unit / rules.gravity)
    lead = (distance - rules.uniform_speed * state.time) / (unit * LEAD_UNIT)
    speed = distance / (state.time * rules.uniform_speed) - 1.0 if state.time > 0.0 else 0.0
    observation[start.front] = min(front, FRONT_LIMIT)
    observation[start.lead] = min(max(lead, -LEAD_LIMIT), LEAD_LIMIT)
    observation[start.speed] = min(max(speed, -1.0), SPEED_LIMIT)


@always_inline
def observe_tempo(rules, schedule, state, placed, start, observation):
    """Write the delay of the last hit from the schedule, and the next intervals of the schedule.

    The delay is scaled by sign(x) ln(1 + |x|), with x in tolerances.
    """
    late = (state.time - schedule[placed, 0]) / rules.tolerance
    late = math.copysign(math.log1p(abs(late)), late)
    observation[start.lateness] = min(max(late, -LATE_LIMIT), LATE_LIMIT)
    for j in range(start.window):
        i = placed + 1 + j
        observation[start.intervals + j] = schedule[i, 1] if i < rules.count else 0.0


@always_inline
def observe_length(rules, distance, pairs_left, start, observation):
    """Write the remaining length of the chain, and the mean pitch that meets it."""
    remaining = max(rules.length - distance, 0.0)
    least = rules.gap_low + rules.thickness_low
    most = rules.gap_high + rules.thickness_high
    mean = 2.0 * (remaining / pairs_left - least) / (most - least) - 1.0 if pairs_left > 0 else 0.0
    observation[start.length_left] = min(remaining / rules.length, 1.0)
    observation[start.pitch_left] = min(max(mean, -1.0), 1.0)


@always_inline
def observe_window(rules, layout, first, placed, start, observation):
    """Write the latest gaps, thicknesses and growths, the last first; 0 where there is none."""
    spacing, thickness, height = layout.spacing, layout.thickness, layout.height
    for j in range(start.window):
        i = placed - j
        if start.gaps >= 0:
            x = 0.0
            if i > 0:
                unit = min(height[i - 1], height[i]) if rules.in_heights else 1.0
                x = log_ratio(spacing[i - 1] / unit, first.gap)
            observation[start.gaps + j] = x
        if start.thicknesses >= 0:
            x = 0.0
            if i > 0:
                unit = height[i] if rules.in_heights else 1.0
                x = log_ratio(thickness[i] / unit, first.thickness)
            observation[start.thicknesses + j] = x
        if start.growths >= 0:
            x = 0.0
            if i > 0:
                x = log_ratio(height[i] / height[i - 1], first.growth)
            observation[start.growths + j] = x


@internal
def observe_ground(batch, curve, b, observation):
    """Write slope and rise of uneven ground at the next positions, a mean pitch apart.

    Slopes are positive downhill, relative to that on which the thinnest domino tips; rises are
    relative to the last pivot, in heights.
    """
    if curve is None:
        return
    rules, start = rules_of(batch, b), batch.entries[0]
    unit = rules.unit if rules.in_heights else 1.0
    bounds = rules.gap_low + rules.gap_high + rules.thickness_low + rules.thickness_high
    pitch = 0.5 * unit * bounds
    steepest = unit * rules.thickness_low / rules.unit
    x = batch.places[b, batch.episodes[b].placed]
    k = piece_at(curve, x, 0)
    here, _ = ground_at(curve, x, k)
    for j in range(start.window):
        x += pitch
        k = piece_at(curve, x, k)
        height, slope = ground_at(curve, x, k)
        rise = (height - here) / rules.unit
        observation[start.slopes + j] = min(max(-slope / steepest, -1.0), 1.0)
        observation[start.rises + j] = min(max(rise, -RISE_LIMIT), RISE_LIMIT)


@always_inline
def observe(batch, b, layout, observation):
    """Write the observation of environment b."""
    rules, start = rules_of(batch, b), batch.entries[0]
    state, episode = batch.states[b], batch.episodes[b]
    placed, pairs = episode.placed, len(layout.spacing)
    observe_wave(rules, state, episode, start, observation)
    if start.lateness >= 0:
        observe_tempo(rules, schedule_of(batch, b), state, placed, start, observation)
    if start.length_left >= 0:
        observe_length(rules, episode.distance, pairs - placed, start, observation)
    observe_window(rules, layout, uniform_of(batch, b)[0], placed, start, observation)
    if start.height >= 0:
        most = math.log(rules.growth_high) * pairs
        grown = math.log(layout.height[placed] / layout.height[0])
        observation[start.height] = min(grown / most, 1.0) if most > 0.0 else 0.0
    if start.hand >= 0:
        for k in range(batch.box.shape[1]):
            observation[start.hand + k] = 0.0
        for j in range(placed, min(placed + rules.hand, batch.order.shape[1])):
            observation[start.hand + batch.order[b, j]] += 1.0 / rules.hand
    if start.stock >= 0:
        kinds = kinds_of(batch, b)
        for k in range(batch.box.shape[1]):
            observation[start.stock + k] = batch.box[b, k] / max(kinds[1, k], 1.0)
    observation[start.placed] = placed / pairs
    for j in range(batch.closeness.shape[1]):
        observation[start.near_start + j] = batch.closeness[placed, j]
        observation[start.near_end + j] = batch.closeness[pairs - placed, j]
    for j in range(batch.features.shape[1]):
        observation[start.features + j] = batch.features[batch.scene[b], j]
    observe_ground(batch, batch.curve, b, observation)
