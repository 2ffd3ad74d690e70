"""Observations: parts that have names, in the order of the environment's page."""

import math

from domino_env.kernels.ground import at as ground_at
from domino_env.kernels.ground import piece_at
from domino_env.kernels.jit import always_inline, internal
from domino_env.kernels.slots import PROPAGATED, record_type
from domino_env.kernels.step.batch import OVER, rules_of

FRONT_LIMIT, LEAD_LIMIT, SPEED_LIMIT = 50.0, 100.0, 20.0  # observations are cut off there
RISE_LIMIT = 50.0
LEAD_UNIT = 10.0  # heights of lead that an observation of 1 stands for
PARTS = (  # of an observation
    "front", "lead", "speed", "length_left", "pitch_left", "gaps", "thicknesses", "growths",
    "height", "stock", "placed", "near_start", "near_end", "features", "slopes", "rises",
)  # fmt: skip
OBSERVATION = record_type(
    None, window=int, **dict.fromkeys(PARTS, int)
)  # where each begins; -1: nowhere


@always_inline
def scaled(value, low, high):
    """Return -1 for the least, 1 for the largest value."""
    return min(max(2.0 / (high - low) * (value - low) - 1.0, -1.0), 1.0)


@always_inline
def observe_front(rules, state, episode, part, observation):
    """Write the speed of the front, lead and mean speed."""
    way, unit = episode.way, rules.unit
    stopped = episode.phase == OVER and episode.outcome != PROPAGATED
    front = 0.0 if stopped else math.sqrt(state.u * unit / rules.gravity)
    lead = (way - rules.reference_speed * state.time) / (unit * LEAD_UNIT)
    speed = way / (state.time * rules.reference_speed) - 1.0 if state.time > 0.0 else 0.0
    observation[part.front] = min(front, FRONT_LIMIT)
    observation[part.lead] = min(max(lead, -LEAD_LIMIT), LEAD_LIMIT)
    observation[part.speed] = min(max(speed, -1.0), SPEED_LIMIT)


@always_inline
def observe_course(rules, way, pairs, part, observation):
    """Write the length that is left, and the mean pitch that it leaves."""
    rest = max(rules.length - way, 0.0)
    least = rules.gap_low + rules.thick_low
    most = rules.gap_high + rules.thick_high
    mean = 2.0 * (rest / pairs - least) / (most - least) - 1.0 if pairs > 0 else 0.0
    observation[part.length_left] = min(rest / rules.length, 1.0)
    observation[part.pitch_left] = min(max(mean, -1.0), 1.0)


@always_inline
def observe_window(rules, row, placed, part, observation):
    """Write the latest gaps, thicknesses and growths, 0 where no domino is placed yet."""
    spacing, thickness, height = row.spacing, row.thickness, row.height
    for j in range(part.window):
        i = placed - j
        if part.gaps >= 0:
            x = 0.0
            if i > 0:
                unit = min(height[i - 1], height[i]) if rules.in_heights else 1.0
                x = scaled(spacing[i - 1] / unit, rules.gap_low, rules.gap_high)
            observation[part.gaps + j] = x
        if part.thicknesses >= 0:
            x = 0.0
            if i > 0:
                unit = height[i] if rules.in_heights else 1.0
                x = scaled(thickness[i] / unit, rules.thick_low, rules.thick_high)
            observation[part.thicknesses + j] = x
        if part.growths >= 0:
            x = 0.0
            if i > 0:
                x = scaled(height[i] / height[i - 1], rules.growth_low, rules.growth_high)
            observation[part.growths + j] = x


@internal
def observe_ground(batch, curve, b, observation):
    """Write slope and rise of the next places on uneven ground, a mean pitch apart each.

    Slopes count downhill, in slopes that tip the thinnest domino; rises over the last pivot, in
    heights.
    """
    if curve is None:
        return
    rules, part = rules_of(batch, b), batch.parts[0]
    unit = rules.unit if rules.in_heights else 1.0
    pitch = 0.5 * unit * (rules.gap_low + rules.gap_high + rules.thick_low + rules.thick_high)
    steepest = unit * rules.thick_low / rules.unit
    x = batch.places[b, batch.episodes[b].placed]
    k = piece_at(curve, x, 0)
    here, _ = ground_at(curve, x, k)
    for j in range(part.window):
        x += pitch
        k = piece_at(curve, x, k)
        height, slope = ground_at(curve, x, k)
        rise = (height - here) / rules.unit
        observation[part.slopes + j] = min(max(-slope / steepest, -1.0), 1.0)
        observation[part.rises + j] = min(max(rise, -RISE_LIMIT), RISE_LIMIT)


@always_inline
def observe(batch, b, row, observation):
    """Write the observation of environment b."""
    rules, state, episode, part = (
        rules_of(batch, b),
        batch.states[b],
        batch.episodes[b],
        batch.parts[0],
    )
    placed, pairs = episode.placed, len(row.spacing)
    observe_front(rules, state, episode, part, observation)
    if part.length_left >= 0:
        observe_course(rules, episode.way, pairs - placed, part, observation)
    observe_window(rules, row, placed, part, observation)
    if part.height >= 0:
        most = math.log(rules.growth_high) * pairs
        observation[part.height] = min(math.log(row.height[placed] / row.height[0]) / most, 1.0)
    if part.stock >= 0:
        for k in range(batch.kinds.shape[1]):
            observation[part.stock + k] = batch.left[b, k] / max(batch.kinds[1, k], 1.0)
    observation[part.placed] = placed / pairs
    for j in range(batch.closeness.shape[1]):
        observation[part.near_start + j] = batch.closeness[placed, j]
        observation[part.near_end + j] = batch.closeness[pairs - placed, j]
    for j in range(batch.features.shape[1]):
        observation[part.features + j] = batch.features[b, j]
    observe_ground(batch, batch.curve, b, observation)
