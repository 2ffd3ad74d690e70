"""Perturbations: changes of a good layout into another that may be better.

A design is a design vector as an array (parts, pairs). The parts are gaps, thicknesses and growths,
as far as they are free, each with N - 1 places along the layout; if gaps are not free, the first
part is treated like them. Good layouts have a common shape: decreasing gaps at the start, a
plateau, increasing gaps, and at the end a few tight gaps and thick dominoes. Local searches often
end with a wrong number of tight gaps, a wrong length of the plateau, or ripples that are due to
face contacts. Perturbations change these features. They do not depend on the score. Their sizes are
drawn from wide ranges, so that both small and large changes occur.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from domino_env.core.types import Floats

Perturbation = Callable[[Floats, Floats, np.random.Generator], Floats]
"""Function (design, donor, rng) -> changed design, with values that may be outside of the box.
Some perturbations copy values of the donor, another good design; the others ignore it."""

# Values and changes are relative to the box.
MAX_TIGHT = 8  # largest number of tight gaps at the end
FACE_DISTANCE = 1e-3  # largest distance to a face of the box that counts as on it
WIDE_GAP = 0.5  # value of a wide gap if all gaps of a design are tight
LEAST_PASSES, MOST_PASSES = 1, 5  # passes of the filter that removes ripples
LEAST_FREE = 4  # least number of places before the tight end that can have ripples
STRETCH_PROBABILITY = 0.7  # probability that a stretch is smoothed, not all places
# decimal exponents of the smallest and largest change
CHANGES, STRETCH_CHANGES, BENDS = (-2.5, -0.8), (-2.0, -0.5), (-2.0, -0.7)
WIDEST_BEND = 0.25  # largest width (standard deviation) of a bend over the number of places
END_PLACES = 6  # places that `change_end` may change
NEIGHBOURS = 4  # largest distance of places whose values are exchanged


def set_tight_gaps(design: Floats, count: int) -> Floats:
    """Give a design exactly `count` tight gaps at its end; the gaps before them shift."""
    tight = count_tight_gaps(design)
    result = shift_second_half(design, count - tight) if tight else design.copy()
    if count:
        result[0, -count:] = 0.0
    if count < result.shape[1] and result[0, -count - 1] <= FACE_DISTANCE:
        wide_gaps = np.flatnonzero(design[0] > FACE_DISTANCE)
        result[0, -count - 1] = design[0, wide_gaps[-1]] if len(wide_gaps) else WIDE_GAP
    return result


def count_tight_gaps(design: Floats) -> int:
    """Count the gaps at the end that are at their lower bound."""
    wide_gaps = np.flatnonzero(design[0] > FACE_DISTANCE)
    return int(design.shape[1] - 1 - wide_gaps[-1]) if len(wide_gaps) else int(design.shape[1])


def shift_second_half(design: Floats, places: int) -> Floats:
    """Move the second half by some places towards the start (negative: towards the end).

    Places of the middle are left out or repeated.
    """
    pairs = design.shape[1]
    indices = np.arange(pairs)
    source = np.where(indices >= pairs // 2 - max(places, 0), indices + places, indices)
    return np.asarray(design[:, np.clip(source, 0, pairs - 1)])


# perturbations ----------------------------------------------------------------------------------


def change_tight_gaps(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Add a tight gap at the end, or remove one; at most MAX_TIGHT remain."""
    tight = count_tight_gaps(design)
    change = 1 if tight == 0 or rng.random() < 0.5 else -1
    return set_tight_gaps(design, min(tight + change, design.shape[1] - 1, MAX_TIGHT))


def shift_end(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Move the part before the tight gaps by one or two places; the tight gaps stay."""
    tight = count_tight_gaps(design)
    result = shift_second_half(design, int(rng.choice([-2, -1, 1, 2])))
    if tight:
        result[:, -tight:] = design[:, -tight:]
    return result


def smooth(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Remove ripples from a stretch, or from all places before the tight gaps except both ends."""
    free = design.shape[1] - count_tight_gaps(design)
    if free < LEAST_FREE:
        return change_all(design, donor, rng)
    start, end = _random_stretch(free, rng) if rng.random() < STRETCH_PROBABILITY else (1, free - 1)
    result = design.copy()
    for _ in range(int(rng.integers(LEAST_PASSES, MOST_PASSES + 1))):
        inner = result[:, start:end]
        padded = np.concatenate([inner[:, :1], inner, inner[:, -1:]], axis=1)
        result[:, start:end] = 0.25 * padded[:, :-2] + 0.5 * inner + 0.25 * padded[:, 2:]
    return result


def change_all(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Change all values at random, except those at a face of the box."""
    step = 10.0 ** rng.uniform(*CHANGES) * rng.standard_normal(design.shape)
    return _add_inside(design, step)


def change_stretch(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Change the values of a stretch at random."""
    start, end = _random_stretch(design.shape[1], rng)
    result = design.copy()
    size = 10.0 ** rng.uniform(*STRETCH_CHANGES)
    result[:, start:end] += size * rng.standard_normal((len(design), end - start))
    return result


def bend(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Add a smooth bump somewhere, upwards or downwards."""
    pairs = design.shape[1]
    width = rng.uniform(1.0, max(WIDEST_BEND * pairs, 2.0))
    bump = np.exp(-0.5 * ((np.arange(pairs) - rng.uniform(0, pairs)) / width) ** 2)
    size = rng.choice([-1.0, 1.0], len(design)) * 10.0 ** rng.uniform(*BENDS)
    return _add_inside(design, size[:, None] * bump)


def join(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Join the start of one of two good layouts to the end of the other."""
    cut = int(rng.integers(1, max(design.shape[1], 2)))
    first, last = (design, donor) if rng.random() < 0.5 else (donor, design)
    return np.concatenate([first[:, :cut], last[:, cut:]], axis=1)


def copy_stretch(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Copy a stretch of another good layout."""
    start, end = _random_stretch(design.shape[1], rng)
    result = design.copy()
    result[:, start:end] = donor[:, start:end]
    return result


def repeat_place(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Repeat one place and leave out another; the places between them shift by one."""
    repeated, omitted = (int(place) for place in rng.integers(design.shape[1], size=2))
    longer = np.insert(design, repeated, design[:, repeated], axis=1)
    return np.asarray(np.delete(longer, omitted + (omitted > repeated), axis=1))


def change_end(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Replace one of the last values by a bound, 0 or 1, or by a random value."""
    result = design.copy()
    part = int(rng.integers(len(design)))
    place = int(rng.integers(1, min(END_PLACES, design.shape[1]) + 1))
    result[part, -place] = rng.choice([0.0, 1.0, rng.random()])
    return result


def swap(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Exchange the values of two places near each other, in one part or in all."""
    pairs = design.shape[1]
    result = design.copy()
    i = int(rng.integers(pairs))
    j = int(np.clip(i + rng.integers(-NEIGHBOURS, NEIGHBOURS + 1), 0, pairs - 1))
    parts = slice(None) if rng.random() < 0.5 else [int(rng.integers(len(design)))]
    result[parts, i], result[parts, j] = design[parts, j], design[parts, i]
    return result


def _add_inside(design: Floats, step: Floats) -> Floats:
    """Add a step to the values that are not at a face of the box."""
    inside = (design > FACE_DISTANCE) & (design < 1.0 - FACE_DISTANCE)
    return np.asarray(np.where(inside, design + step, design))


def _random_stretch(pairs: int, rng: np.random.Generator) -> tuple[int, int]:
    """Return the start and end of a random stretch of at most about a third of the places."""
    length = int(rng.integers(1, max(2, min(pairs, 2 + pairs // 3))))
    start = int(rng.integers(0, max(1, pairs - length + 1)))
    return start, min(start + length, pairs)


PERTURBATIONS: tuple[Perturbation, ...] = (
    change_tight_gaps, shift_end, smooth, change_all, change_stretch, bend, join, copy_stretch,
    repeat_place, change_end, swap,
)  # fmt: skip
