"""Actions: numbers in [-1, 1] for the gap, thickness and growth of the next domino.

An action has one entry for each of these that is free, in this order. `decode` scales the entries
to the bounds that the rules still leave; `encode` is its inverse, `decode_back` its reverse mode.
"""

import numpy as np

from domino_env.kernels.jit import always_inline, internal


@always_inline
def scale_entry(entry, low, high):
    """Return the value of an entry, scaled from [-1, 1] to [low, high] and clipped."""
    value = low + 0.5 * (min(max(entry, -1.0), 1.0) + 1.0) * (high - low)
    return min(max(value, low), high)


@always_inline
def entry_for(value, low, high):
    """Return the entry for a value, or for the nearer bound; 0 for equal bounds."""
    if not low < high:
        return 0.0
    return min(max(2.0 * (value - low) / (high - low) - 1.0, -1.0), 1.0)


@always_inline
def narrow_bounds(low, high, least, most):
    """Return [low, high] narrowed to [least, most]; twice one value if rounding leaves none."""
    new_low, new_high = max(low, least), min(high, most)
    if new_low > new_high:
        middle = min(max(0.5 * (least + most), low), high)
        return middle, middle
    return new_low, new_high


@always_inline
def pitch_bounds(rules, pairs_left, distance):
    """Return the bounds of the next pitch within which the total length can still be met.

    pairs_left: number of gaps to place, with this one. distance: from the first pivot to the last.
    """
    low = rules.gap_low + rules.thickness_low
    high = rules.gap_high + rules.thickness_high
    remaining, later = rules.length - distance, pairs_left - 1
    return remaining - later * high, remaining - later * low


@always_inline
def thickness_bounds(rules, pairs_left, distance):
    """Return the bounds of the next thickness within which some gap gives a possible pitch."""
    low, high = rules.thickness_low, rules.thickness_high
    if rules.length > 0.0:
        least, most = pitch_bounds(rules, pairs_left, distance)
        return narrow_bounds(low, high, least - rules.gap_high, most - rules.gap_low)
    return low, high


@always_inline
def gap_bounds(rules, spacing, n, distance, thickness):
    """Return the bounds of gap n for a given thickness of the domino ahead of it."""
    low, high = rules.gap_low, rules.gap_high
    if rules.length > 0.0:
        least, most = pitch_bounds(rules, len(spacing) - n, distance)
        low, high = narrow_bounds(low, high, least - thickness, most - thickness)
    if rules.largest_change > 0.0 and n > 0:
        before, change = spacing[n - 1], rules.largest_change
        low, high = max(low, before - change), min(high, before + change)
    return low, high


@internal
def nearest_kind(kinds, pieces, thickness):
    """Return the index of the nearest thickness of which there are pieces."""
    best, least = 0, np.inf
    for k in range(len(kinds)):
        if pieces[k] > 0.0 and abs(kinds[k] - thickness) < least:
            best, least = k, abs(kinds[k] - thickness)
    return best


@always_inline
def pieces_of(rules, batch, b):
    """Return the numbers of pieces that can be placed, by kind: in the hand if there is one."""
    return batch.hand[b] if rules.hand > 0 else batch.box[b]


@internal
def restock(batch, b):
    """Put all pieces back into the box."""
    for k in range(batch.kinds.shape[1]):
        batch.box[b, k], batch.hand[b, k] = batch.kinds[1, k], 0.0


@internal
def draw(batch, b, first, last):
    """Move pieces first … last - 1 of the random order, if there is one, into the hand."""
    for j in range(first, min(last, batch.order.shape[1])):
        k = batch.order[b, j]
        batch.box[b, k] -= 1.0
        batch.hand[b, k] += 1.0


@internal
def nearest_within(values, low, high, gap):
    """Return the value of a list in [low, high] that is nearest to a gap; the gap if none is."""
    best, least = gap, np.inf
    for value in values:  # the bounds are exact to rounding only
        if low - 1e-12 <= value <= high + 1e-12 and abs(value - gap) < least:
            best, least = value, abs(value - gap)
    return best


@always_inline
def decode(action, rules, batch, b, n, distance, layout):
    """Write gap n and the thickness and height of domino n+1 from an action into layout b.

    The batch has the lists of allowed gaps and thicknesses, if any, and the rest of a stock.
    """
    spacing, height = layout.spacing, layout.height
    column = len(action) - 1
    behind = height[n]  # and ahead: heights
    if rules.grows:
        growth = rules.growth_low
        if rules.growth_low < rules.growth_high:
            growth = scale_entry(action[column], rules.growth_low, rules.growth_high)
            column -= 1
        height[n + 1] = behind * growth
    ahead = height[n + 1]
    thickness = rules.thickness_low
    if rules.thickness_low < rules.thickness_high:
        low, high = thickness_bounds(rules, len(spacing) - n, distance)
        thickness = scale_entry(action[column], low, high)
        if batch.kinds.shape[1] > 0:
            pieces = pieces_of(rules, batch, b)
            k = nearest_kind(batch.kinds[0], pieces, thickness)
            pieces[k] -= 1.0
            draw(batch, b, n + rules.hand, n + rules.hand + 1)
            thickness = batch.kinds[0, k]
    gap = rules.gap_low
    if rules.gap_low < rules.gap_high:
        low, high = gap_bounds(rules, spacing, n, distance, thickness)
        gap = scale_entry(action[0], low, high)
        if len(batch.gap_values) > 0:
            gap = nearest_within(batch.gap_values, low, high, gap)
    if rules.in_heights:
        thickness *= ahead
        gap *= min(behind, ahead)
    spacing[n], layout.thickness[n + 1] = gap, thickness


@always_inline
def add_placement_error(rules, errors, b, n, spacing):
    """Add the placement error to gap n, if there are errors; at least `least_placed` remains."""
    if len(errors) > 0:
        spacing[n] = max(spacing[n] + errors[b, n], rules.least_placed)


@always_inline
def encode(rules, spacing, n, distance, target, action):
    """Write the action that comes nearest to a given gap n and domino n+1.

    target: gap, thickness, and heights of dominoes n and n+1 [m].
    """
    gap, thickness, behind, ahead = target[0], target[1], target[2], target[3]
    if rules.in_heights:
        gap, thickness = gap / min(behind, ahead), thickness / ahead
    column = len(action) - 1
    if rules.growth_low < rules.growth_high:
        action[column] = entry_for(ahead / behind, rules.growth_low, rules.growth_high)
        column -= 1
    low, high = thickness_bounds(rules, len(spacing) - n, distance)
    if rules.thickness_low < rules.thickness_high:
        action[column] = entry_for(thickness, low, high)
    if rules.gap_low < rules.gap_high:
        low, high = gap_bounds(rules, spacing, n, distance, min(max(thickness, low), high))
        action[0] = entry_for(gap, low, high)


@always_inline
def scale_entry_back(entry, low, high, bar):
    """Return derivatives of `scale_entry` by entry, low and high, times the bar of its value."""
    fraction = 0.5 * (min(max(entry, -1.0), 1.0) + 1.0)
    return 0.5 * (high - low) * bar, (1.0 - fraction) * bar, fraction * bar


@always_inline
def narrow_bounds_back(low, high, least, most, low_bar, high_bar):
    """Return the derivative of `narrow_bounds` by a shift of least and most, times its bars."""
    if max(low, least) > min(high, most):
        return low_bar + high_bar if low < 0.5 * (least + most) < high else 0.0
    return (low_bar if least > low else 0.0) + (high_bar if most < high else 0.0)


@internal
def decode_back(action, rules, n, distance, layout, bars, later_bars, action_bar):
    """Write the derivatives by an action from those by gap n and domino n+1.

    distance: from pivot 0 to pivot n. bars: direct derivatives by gap, thickness and height.
    later_bars: derivatives through later dominoes by the distance to pivot n+1, gap n and the
    height of n+1; replaced by those by the distance to pivot n, gap n-1 and the height of n.
    Beyond [-1, 1] the derivatives are those at the nearer end. Lists and stocks are not supported.
    """
    spacing, column = layout.spacing, len(action) - 1
    behind, ahead = layout.height[n], layout.height[n + 1]
    gap, thickness = spacing[n], layout.thickness[n + 1]
    distance_bar, height_bar = later_bars[0], bars[2] + later_bars[2]
    gap_bar, thickness_bar = bars[0] + distance_bar + later_bars[1], bars[1] + distance_bar
    before_bar, behind_bar = 0.0, 0.0
    if rules.in_heights:
        least = min(behind, ahead)
        gap, thickness = gap / least, thickness / ahead
        if behind <= ahead:
            behind_bar += gap * gap_bar
        else:
            height_bar += gap * gap_bar
        height_bar += thickness * thickness_bar
        gap_bar, thickness_bar = least * gap_bar, ahead * thickness_bar
    pitch_low, pitch_high = pitch_bounds(rules, len(spacing) - n, distance)
    free_growth = int(rules.growth_low < rules.growth_high)
    if rules.gap_low < rules.gap_high:
        low, high = gap_bounds(rules, spacing, n, distance, thickness)
        action_bar[0], low_bar, high_bar = scale_entry_back(action[0], low, high, gap_bar)
        if rules.length > 0.0:
            shift_bar = narrow_bounds_back(
                rules.gap_low, rules.gap_high, pitch_low - thickness, pitch_high - thickness,
                low_bar, high_bar,
            )  # fmt: skip
            distance_bar -= shift_bar
            thickness_bar -= shift_bar
        if rules.largest_change > 0.0 and n > 0:
            before_bar += low_bar if low > rules.gap_low else 0.0
            before_bar += high_bar if high < rules.gap_high else 0.0
    if rules.thickness_low < rules.thickness_high:
        low, high = thickness_bounds(rules, len(spacing) - n, distance)
        k = column - free_growth
        action_bar[k], low_bar, high_bar = scale_entry_back(action[k], low, high, thickness_bar)
        if rules.length > 0.0:
            distance_bar -= narrow_bounds_back(
                rules.thickness_low, rules.thickness_high,
                pitch_low - rules.gap_high, pitch_high - rules.gap_low, low_bar, high_bar,
            )  # fmt: skip
    if rules.grows:
        behind_bar += ahead / behind * height_bar
        if free_growth:
            action_bar[column], _, _ = scale_entry_back(
                action[column], rules.growth_low, rules.growth_high, behind * height_bar
            )
    later_bars[0], later_bars[1], later_bars[2] = distance_bar, before_bar, behind_bar
