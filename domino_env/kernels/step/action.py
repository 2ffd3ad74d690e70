"""Actions: numbers in [-1, 1] for the gap, thickness and growth of the next domino.

An action has one entry for each of these that is free, in this order; with a stock, one entry for
each kind of pieces in place of the thickness. `decode` scales the entries to the bounds that the
rules still leave; `encode` is its inverse, `decode_back` its reverse mode.

An entry of 0 is the value of the uniform baseline, and entries of -1 and 1 are the bounds. Between
0 and 1 the logarithm of the ratio to the baseline is a cubic in the entry e,

    ln(value / uniform) = e (SLOPE + max(l - SLOPE, 0) e²) <= l,    l = ln(high / uniform),

and likewise between 0 and -1; a bound that is near is reached earlier. So equal changes of entries
near 0 are equal ratios in both directions, small enough for the noise of algorithms that explore.
"""

import math

import numpy as np

from domino_env.kernels.jit import always_inline, entry_point, internal
from domino_env.kernels.step.batch import kinds_of, rules_of, uniform_of

SLOPE = 1.0  # derivative of the logarithm of a value with respect to its entry, at 0


@always_inline
def bend(entry, span):
    """Return the logarithm of a ratio for an entry from 0 to 1; `span` is its largest value."""
    return min(entry * (SLOPE + max(span - SLOPE, 0.0) * entry * entry), span)


@always_inline
def unbend(logarithm, span):
    """Return the entry from 0 to 1 for the logarithm of a ratio, by the root of the cubic."""
    excess = span - SLOPE
    if excess <= 1e-6:  # the cubic term is no larger than rounding, or there is none
        return min(logarithm, span) / SLOPE
    p = SLOPE / excess
    root = math.asinh(1.5 * min(logarithm, span) / SLOPE * math.sqrt(3.0 / p)) / 3.0
    return min(2.0 * math.sqrt(p / 3.0) * math.sinh(root), 1.0)


@always_inline
def scale_entry(entry, low, high, uniform):
    """Return the value of an entry: `uniform` for 0, low for -1, high for 1."""
    centre = min(max(uniform, low), high)
    if entry >= 0.0:
        value = centre * math.exp(bend(min(entry, 1.0), math.log(high / centre)))
    else:
        value = centre * math.exp(-bend(min(-entry, 1.0), math.log(centre / low)))
    return min(max(value, low), high)


@always_inline
def entry_for(value, low, high, uniform):
    """Return the entry for a value, or for the nearer bound; 0 for equal bounds."""
    centre = min(max(uniform, low), high)
    if value >= centre:
        return unbend(math.log(value / centre), math.log(high / centre))
    return -unbend(math.log(centre / max(value, low)), math.log(centre / low))


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
def gap_bounds(rules, pairs_left, distance, thickness):
    """Return the bounds of the next gap for a given thickness of the domino ahead of it."""
    low, high = rules.gap_low, rules.gap_high
    if rules.length > 0.0:
        least, most = pitch_bounds(rules, pairs_left, distance)
        return narrow_bounds(low, high, least - thickness, most - thickness)
    return low, high


@internal
def nearest_kind(kinds, thickness):
    """Return the index of the nearest of some thicknesses."""
    best, least = 0, np.inf
    for k in range(len(kinds)):
        if abs(kinds[k] - thickness) < least:
            best, least = k, abs(kinds[k] - thickness)
    return best


@internal
def restock(batch, b, given):
    """Put all pieces back into the box, and draw the hand after `given` dominoes."""
    if batch.box.shape[1] == 0:
        return
    kinds = kinds_of(batch, b)
    for k in range(batch.box.shape[1]):  # an assignment of arrays compiles messages of shapes
        batch.box[b, k] = kinds[1, k]
    for n in range(given):
        batch.box[b, nearest_kind(kinds[0], batch.thickness[b, n + 1])] -= 1.0
    for j in range(given, min(given + rules_of(batch, b).hand, batch.order.shape[1])):
        batch.box[b, batch.order[b, j]] -= 1.0


@always_inline
def pieces_left(rules, batch, b):
    """Return the number of pieces in box and hand of environment b, and their thickness [m]."""
    kinds, placed = kinds_of(batch, b)[0], batch.episodes[b].placed
    number, total = 0.0, 0.0
    for k in range(len(kinds)):
        number, total = number + batch.box[b, k], total + batch.box[b, k] * kinds[k]
    for j in range(placed, min(placed + rules.hand, batch.order.shape[1])):
        number, total = number + 1.0, total + kinds[batch.order[b, j]]
    return number, total


@always_inline
def prefers(preferences, k, other):
    """Return True if the preference for kind k is larger than that for another one, clipped."""
    return min(max(preferences[k], -1.0), 1.0) > min(max(preferences[other], -1.0), 1.0)


@internal
def take_from_hand(preferences, batch, b, n, hand):
    """Return the preferred kind in the hand, which are pieces n … n+hand-1 of the order of drawing.

    Of equally preferred pieces, the one drawn first is taken. It becomes piece n of the order, and
    the next piece is drawn.
    """
    order = batch.order[b]
    best = n
    for j in range(n + 1, min(n + hand, len(order))):
        if prefers(preferences, order[j], order[best]):
            best = j
    kind = order[best]
    for j in range(best, n, -1):
        order[j] = order[j - 1]
    order[n] = kind
    if n + hand < len(order):
        batch.box[b, order[n + hand]] -= 1.0
    return kind


@internal
def take_from_box(preferences, box, usual):
    """Return the preferred kind in the box; of equally preferred ones `usual`, or the first."""
    best = usual
    for k in range(len(box)):
        if box[k] > 0.0 and (not box[best] > 0.0 or prefers(preferences, k, best)):
            best = k
    box[best] -= 1.0
    return best


@always_inline
def decode(action, rules, batch, b, n, distance, layout):
    """Write gap n and the thickness and height of domino n+1 from an action into layout b.

    The batch has the kinds of dominoes of a stock, if any, and what is left of them.
    """
    spacing, height, uniform = layout.spacing, layout.height, uniform_of(batch, b)[n]
    growths = int(rules.growth_low < rules.growth_high)
    behind = height[n]  # and ahead: heights
    if rules.grows:
        growth = rules.growth_low
        if growths:
            low, high = rules.growth_low, rules.growth_high
            growth = scale_entry(action[len(action) - 1], low, high, uniform.growth)
        height[n + 1] = behind * growth
    ahead = height[n + 1]
    thickness, kinds = rules.thickness_low, batch.box.shape[1]
    if kinds > 0:
        preferences = action[len(action) - growths - kinds :]
        if rules.hand > 0:
            k = take_from_hand(preferences, batch, b, n, rules.hand)
        else:
            usual = nearest_kind(kinds_of(batch, b)[0], uniform.thickness)
            k = take_from_box(preferences, batch.box[b], usual)
        thickness = kinds_of(batch, b)[0, k]
    elif rules.thickness_low < rules.thickness_high:
        low, high = thickness_bounds(rules, len(spacing) - n, distance)
        entry = action[len(action) - growths - 1]
        thickness = scale_entry(entry, low, high, uniform.thickness)
    gap = rules.gap_low
    if rules.gap_low < rules.gap_high:
        low, high = gap_bounds(rules, len(spacing) - n, distance, thickness)
        gap = scale_entry(action[0], low, high, uniform.gap)
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
def encode(rules, batch, b, spacing, n, distance, target, action):
    """Write the action that comes nearest to a given gap n and domino n+1.

    target: gap, thickness, and heights of dominoes n and n+1 [m].
    """
    gap, thickness, behind, ahead = target[0], target[1], target[2], target[3]
    uniform, kinds = uniform_of(batch, b)[n], batch.box.shape[1]
    if rules.in_heights:
        gap, thickness = gap / min(behind, ahead), thickness / ahead
    column = len(action) - 1
    if rules.growth_low < rules.growth_high:
        low, high = rules.growth_low, rules.growth_high
        action[column] = entry_for(ahead / behind, low, high, uniform.growth)
        column -= 1
    low, high = thickness_bounds(rules, len(spacing) - n, distance)
    if kinds > 0:
        sizes = kinds_of(batch, b)[0]
        least, largest = sizes[0], sizes[kinds - 1]
        for k in range(kinds):
            difference = abs(sizes[k] - thickness) / (largest - least)
            action[column + 1 - kinds + k] = 1.0 - 2.0 * min(difference, 1.0)
    elif rules.thickness_low < rules.thickness_high:
        action[column] = entry_for(thickness, low, high, uniform.thickness)
    if rules.gap_low < rules.gap_high:
        low, high = gap_bounds(rules, len(spacing) - n, distance, min(max(thickness, low), high))
        action[0] = entry_for(gap, low, high, uniform.gap)


@always_inline
def scale_entry_back(entry, low, high, uniform, own, bar):
    """Return derivatives of `scale_entry` by entry, low and high, times the bar of its value.

    Beyond [-1, 1] the derivative by the entry is that at the nearer end, or 0 if a nearer entry
    reaches the bound. If the baseline is at the scene's `own` bound, it is that at 0 on this side.
    """
    centre, size = min(max(uniform, low), high), min(abs(entry), 1.0)
    span = math.log(high / centre) if entry >= 0.0 else math.log(centre / low)
    excess = max(span - SLOPE, 0.0)
    value_bar = scale_entry(entry, low, high, uniform) * bar
    entry_bar = value_bar * (SLOPE + 3.0 * excess * size * size) if low < high else 0.0
    # derivative of the logarithm by the span
    fraction = size * size * size
    if excess == 0.0:
        fraction = 1.0 if SLOPE * size >= span else 0.0
        entry_bar *= 1.0 if own and span == 0.0 else 1.0 - fraction
    low_bar = value_bar * fraction / low if entry < 0.0 else 0.0
    high_bar = value_bar * fraction / high if entry >= 0.0 else 0.0
    centre_bar = value_bar * (1.0 - fraction) / centre
    if uniform <= low:
        low_bar += centre_bar
    elif uniform >= high:
        high_bar += centre_bar
    return entry_bar, low_bar, high_bar


@always_inline
def narrow_bounds_back(low, high, least, most, low_bar, high_bar):
    """Return the derivative of `narrow_bounds` by a shift of least and most, times its bars."""
    if max(low, least) > min(high, most):
        return low_bar + high_bar if low < 0.5 * (least + most) < high else 0.0
    return (low_bar if least > low else 0.0) + (high_bar if most < high else 0.0)


@internal
def decode_back(action, rules, uniform, kinds, n, distance, layout, bars, later_bars, action_bar):
    """Write the derivatives by an action from those by gap n and domino n+1.

    uniform: UNIFORM of domino n. kinds: number of kinds of a stock. distance: from pivot 0 to pivot
    n. bars: direct derivatives by gap, thickness and height.
    later_bars: derivatives through later dominoes by the distance to pivot n+1 and the height of
    n+1; replaced by those by the distance to pivot n and the height of n.
    Entries for kinds have derivative 0.
    """
    spacing, column = layout.spacing, len(action) - 1
    behind, ahead = layout.height[n], layout.height[n + 1]
    gap, thickness = spacing[n], layout.thickness[n + 1]
    distance_bar, height_bar = later_bars[0], bars[2] + later_bars[1]
    gap_bar, thickness_bar = bars[0] + distance_bar, bars[1] + distance_bar
    behind_bar = 0.0
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
        low, high = gap_bounds(rules, len(spacing) - n, distance, thickness)
        own = low == rules.gap_low if action[0] < 0.0 else high == rules.gap_high
        action_bar[0], low_bar, high_bar = scale_entry_back(
            action[0], low, high, uniform.gap, own, gap_bar
        )
        if rules.length > 0.0:
            shift_bar = narrow_bounds_back(
                rules.gap_low, rules.gap_high, pitch_low - thickness, pitch_high - thickness,
                low_bar, high_bar,
            )  # fmt: skip
            distance_bar -= shift_bar
            thickness_bar -= shift_bar
    if not kinds and rules.thickness_low < rules.thickness_high:
        low, high = thickness_bounds(rules, len(spacing) - n, distance)
        k = column - free_growth
        own = low == rules.thickness_low if action[k] < 0.0 else high == rules.thickness_high
        action_bar[k], low_bar, high_bar = scale_entry_back(
            action[k], low, high, uniform.thickness, own, thickness_bar
        )
        if rules.length > 0.0:
            distance_bar -= narrow_bounds_back(
                rules.thickness_low, rules.thickness_high,
                pitch_low - rules.gap_high, pitch_high - rules.gap_low, low_bar, high_bar,
            )  # fmt: skip
    if rules.grows:
        behind_bar += ahead / behind * height_bar
        if free_growth:
            action_bar[column], _, _ = scale_entry_back(
                action[column], rules.growth_low, rules.growth_high, uniform.growth, True,
                behind * height_bar,
            )  # fmt: skip
    later_bars[0], later_bars[1] = distance_bar, behind_bar


@entry_point
def encode_values(values, low, high, uniform, entries):
    """Write the entries for values between fixed bounds."""
    for i in range(len(values)):
        entries[i] = entry_for(values[i], low, high, uniform)
