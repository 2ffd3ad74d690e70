"""What an action stands for: a gap, a thickness, a growth, within what the rules still leave."""

import numpy as np

from domino_env.kernels.jit import always_inline, entry_point, internal


@always_inline
def between(action, low, high):
    """The value that an action in [-1, 1] stands for; beyond them, the nearer bound."""
    value = low + 0.5 * (min(max(action, -1.0), 1.0) + 1.0) * (high - low)
    return min(max(value, low), high)


@always_inline
def reachable(low, high, least, most):
    """[low, high] narrowed to [least, most]; a single value where rounding leaves none."""
    new_low, new_high = max(low, least), min(high, most)
    if new_low > new_high:
        middle = min(max(0.5 * (least + most), low), high)
        return middle, middle
    return new_low, new_high


@always_inline
def pitch_bounds(rules, pairs_left, way):
    """Least and largest pitch of this pair from which the course length can still be met."""
    low = rules.gap_low + rules.thick_low
    high = rules.gap_high + rules.thick_high
    if rules.length <= 0.0:
        return low, high
    left, after = rules.length - way, pairs_left - 1
    return left - after * high, left - after * low


@always_inline
def thickness_bounds(rules, pairs_left, way):
    """Bounds of the next domino's thickness: some gap must still fit its pitch."""
    low, high = rules.thick_low, rules.thick_high
    if rules.length <= 0.0:
        return low, high
    least, most = pitch_bounds(rules, pairs_left, way)
    return reachable(low, high, least - rules.gap_high, most - rules.gap_low)


@always_inline
def gap_bounds(rules, pairs_left, way, thickness):
    """Bounds of the next gap, once the thickness of the domino behind it is chosen."""
    low, high = rules.gap_low, rules.gap_high
    if rules.length <= 0.0:
        return low, high
    least, most = pitch_bounds(rules, pairs_left, way)
    return reachable(low, high, least - thickness, most - thickness)


@entry_point
def thickness_range(rules, pairs_left, way):
    """`thickness_bounds`, for Python."""
    return thickness_bounds(rules, pairs_left, way)


@entry_point
def gap_range(rules, pairs_left, way, thickness):
    """`gap_bounds`, for Python."""
    return gap_bounds(rules, pairs_left, way, thickness)


@internal
def nearest_left(kinds, left, thickness):
    """Which of the kinds that are still in the box comes nearest."""
    best, away = 0, np.inf
    for k in range(len(kinds)):
        if left[k] > 0.0 and abs(kinds[k] - thickness) < away:
            best, away = k, abs(kinds[k] - thickness)
    return best


@internal
def nearest_within(values, low, high, gap):
    """The value of a list nearest to a gap among those in [low, high]."""
    best, away = gap, np.inf
    for value in values:
        if low - 1e-12 <= value <= high + 1e-12 and abs(value - gap) < away:
            best, away = value, abs(value - gap)
    return best


@always_inline
def choose(action, rules, batch, left, n, way, row):
    """Write what an action stands for into a row: gap n, thickness (and height) of domino n+1.

    rules: of the row.  batch: with the only gaps and thicknesses allowed, if any.
    left: (K,) how many there still are of each kind of domino.
    """
    spacing, height = row.spacing, row.height
    pairs_left, column = len(spacing) - n, len(action) - 1
    behind = height[n]
    if rules.grows:
        growth = rules.growth_low
        if rules.growth_low < rules.growth_high:
            growth = between(action[column], rules.growth_low, rules.growth_high)
            column -= 1
        height[n + 1] = behind * growth
    ahead = height[n + 1]
    thick = rules.thick_low
    if rules.thick_low < rules.thick_high:
        low, high = thickness_bounds(rules, pairs_left, way)
        thick = between(action[column], low, high)
        if len(batch.kinds) > 0:
            k = nearest_left(batch.kinds, left, thick)
            left[k] -= 1.0
            thick = batch.kinds[k]
    gap = rules.gap_low
    if rules.gap_low < rules.gap_high:
        low, high = gap_bounds(rules, pairs_left, way, thick)
        if rules.largest_change > 0.0 and n > 0:
            before, change = spacing[n - 1], rules.largest_change
            low, high = max(low, before - change), min(high, before + change)
        gap = between(action[0], low, high)
        if len(batch.gap_values) > 0:
            gap = nearest_within(batch.gap_values, low, high, gap)
    if rules.in_heights:
        thick *= ahead
        gap *= min(behind, ahead)
    spacing[n], row.thickness[n + 1] = gap, thick


@always_inline
def put_down(rules, errors, b, n, spacing):
    """Let gap n come out wrong where the hand is unsteady."""
    if len(errors) > 0:
        spacing[n] = max(spacing[n] + errors[b, n], rules.least_placed)
