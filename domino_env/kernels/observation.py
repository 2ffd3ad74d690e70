"""What is observed of a row; the order of the entries is that of the environment's page."""

import math

from domino_env.kernels.batch import OVER, rules_of
from domino_env.kernels.jit import always_inline, overloaded
from domino_env.kernels.slots import PROPAGATED

FRONT_LIMIT, LEAD_LIMIT, SPEED_LIMIT = 50.0, 100.0, 20.0  # observations are cut off there
RISE_LIMIT = 50.0
LEAD_UNIT = 10.0  # heights of lead that an observation of 1 stands for


@always_inline
def scaled(value, low, high):
    """-1 for the least, 1 for the largest value."""
    return min(max(2.0 / (high - low) * (value - low) - 1.0, -1.0), 1.0)


@always_inline
def leave_blank(observation, at, there, window):
    """The places of a window that no domino fills yet; returns where the next entry goes."""
    for j in range(there, window):
        observation[at + j] = 0.0
    return at + window


@always_inline
def observe_front(rules, state, episode, observation):
    """Speed of the front, lead and mean speed; returns how many entries that is."""
    way, unit = episode.way, rules.unit
    dead = episode.phase == OVER and episode.outcome != PROPAGATED
    front = 0.0 if dead else math.sqrt(state.u * unit / rules.gravity)
    lead = (way - rules.reference_speed * state.time) / (unit * LEAD_UNIT)
    speed = way / (state.time * rules.reference_speed) - 1.0 if state.time > 0.0 else 0.0
    observation[0] = min(front, FRONT_LIMIT)
    observation[1] = min(max(lead, -LEAD_LIMIT), LEAD_LIMIT)
    observation[2] = min(max(speed, -1.0), SPEED_LIMIT)
    return 3


@always_inline
def observe_course(rules, way, pairs, observation, at):
    """The length that is left, and the mean pitch that it leaves."""
    rest = max(rules.length - way, 0.0)
    least = rules.gap_low + rules.thick_low
    most = rules.gap_high + rules.thick_high
    mean = 2.0 * (rest / pairs - least) / (most - least) - 1.0 if pairs > 0 else 0.0
    observation[at] = min(rest / rules.length, 1.0)
    observation[at + 1] = min(max(mean, -1.0), 1.0)
    return at + 2


@overloaded
@always_inline
def observe_ground(batch, b, observation, at):
    """What lies ahead; on flat ground nothing."""


@always_inline
def observe(batch, b, row, observation):
    """Write what is observed of row b."""
    rules, state, episode = rules_of(batch, b), batch.states[b], batch.episodes[b]
    spacing, thickness, height = row.spacing, row.thickness, row.height
    placed, window = episode.placed, rules.window
    there = min(window, placed)
    at = observe_front(rules, state, episode, observation)
    if rules.length > 0.0:
        pairs = len(spacing) - placed
        at = observe_course(rules, episode.way, pairs, observation, at)
    if rules.gap_low < rules.gap_high:
        for j in range(there):
            i = placed - 1 - j
            x = spacing[i] / min(height[i], height[i + 1]) if rules.in_heights else spacing[i]
            observation[at + j] = scaled(x, rules.gap_low, rules.gap_high)
        at = leave_blank(observation, at, there, window)
    if rules.thick_low < rules.thick_high:
        for j in range(there):
            i = placed - j
            x = thickness[i] / height[i] if rules.in_heights else thickness[i]
            observation[at + j] = scaled(x, rules.thick_low, rules.thick_high)
        at = leave_blank(observation, at, there, window)
    if rules.growth_low < rules.growth_high:
        for j in range(there):
            i = placed - j
            x = height[i] / height[i - 1]
            observation[at + j] = scaled(x, rules.growth_low, rules.growth_high)
        at = leave_blank(observation, at, there, window)
        most = math.log(rules.growth_high) * len(spacing)
        observation[at] = min(math.log(height[placed] / height[0]) / most, 1.0)
        at += 1
    if rules.has_stock:
        for k in range(len(batch.kinds)):
            observation[at + k] = batch.left[b, k] / max(batch.stock[k], 1.0)
        at += len(batch.kinds)
    observation[at] = placed / len(spacing)
    at += 1
    for away in (placed, len(spacing) - placed):
        for j in range(batch.closeness.shape[1]):
            observation[at + j] = batch.closeness[away, j]
        at += batch.closeness.shape[1]
    for j in range(batch.features.shape[1]):
        observation[at + j] = batch.features[b, j]
    observe_ground(batch, b, observation, at + batch.features.shape[1])
