"""Perturbations: changes of a good layout into another that may be better.

A design is given as columns (the gaps; the thicknesses where they are free too), each running along
the layout. Good layouts share their shape: a falling start, a plateau, a rise, a few tight gaps at
the end and thick dominoes there. Local searches often end with a wrong number of tight gaps, a
wrong end of the plateau, or ripples that face contacts have left. These perturbations change just
that. They do not depend on the score.

Sizes and probabilities give small and large changes a chance each.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from domino_env.core.types import Floats

Perturbation = Callable[[Floats, Floats, np.random.Generator], Floats]
"""(design, donor, rng) -> a changed design; some perturbations copy parts of the donor, which is
another good design. Designs are columns, (parts, pairs)."""

MAX_TIGHT = 8  # tight gaps at the end
FACE_DISTANCE = 1e-3  # distance to a face of the box that counts as on it
WIDE_GAP = 0.5  # value of a wide gap if all gaps of a design are tight
SMALLEST_PASSES, MOST_PASSES = 1, 5  # of the filter that removes ripples
LEAST_FREE = 4  # gaps before the tight end that can have ripples
STRETCH_PART = 0.7  # probability that a stretch is smoothed, and not all
# decimal exponents of the smallest and largest change, as a part of the box
CHANGES, STRETCH_CHANGES, BENDS = (-2.5, -0.8), (-2.0, -0.5), (-2.0, -0.7)
WIDEST_BEND = 0.25  # standard deviation of a bend over the number of places, at most
END_PLACES = 6  # that make the end
NEIGHBOURS = 4  # places within which two values are exchanged


def set_tight_gaps(design: Floats, count: int) -> Floats:
    """Give a design exactly `count` tight gaps at its end; the gaps before them move along."""
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
    """Move the second half towards the start; the middle becomes shorter or longer."""
    pairs = design.shape[1]
    indices = np.arange(pairs)
    source = np.where(indices >= pairs // 2 - max(places, 0), indices + places, indices)
    return np.asarray(design[:, np.clip(source, 0, pairs - 1)])


# perturbations ----------------------------------------------------------------------------------


def change_tight_gaps(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Add a tight gap at the end, or remove one."""
    tight = count_tight_gaps(design)
    change = 1 if tight == 0 or rng.random() < 0.5 else -1
    return set_tight_gaps(design, min(tight + change, design.shape[1] - 1, MAX_TIGHT))


def shift_end(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Move the part before the tight end one or two places on or back; the end stays."""
    tight = count_tight_gaps(design)
    result = shift_second_half(design, int(rng.choice([-2, -1, 1, 2])))
    if tight:
        result[:, -tight:] = design[:, -tight:]
    return result


def smooth(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Remove ripples from a stretch, or from all but the tight end."""
    free = design.shape[1] - count_tight_gaps(design)
    if free < LEAST_FREE:
        return change_all(design, donor, rng)
    start, end = _random_stretch(free, rng) if rng.random() < STRETCH_PART else (1, free - 1)
    result = design.copy()
    for _ in range(int(rng.integers(SMALLEST_PASSES, MOST_PASSES + 1))):
        inner = result[:, start:end]
        padded = np.concatenate([inner[:, :1], inner, inner[:, -1:]], axis=1)
        result[:, start:end] = 0.25 * padded[:, :-2] + 0.5 * inner + 0.25 * padded[:, 2:]
    return result


def change_all(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Change all values that are not at a face of the box at random."""
    step = 10.0 ** rng.uniform(*CHANGES) * rng.standard_normal(design.shape)
    return _add_inside(design, step)


def change_stretch(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Change a few neighbours at random."""
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
    """Join the start of one good layout to the end of another."""
    cut = int(rng.integers(1, max(design.shape[1], 2)))
    first, last = (design, donor) if rng.random() < 0.5 else (donor, design)
    return np.concatenate([first[:, :cut], last[:, cut:]], axis=1)


def exchange(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Take a stretch from another good layout."""
    start, end = _random_stretch(design.shape[1], rng)
    result = design.copy()
    result[:, start:end] = donor[:, start:end]
    return result


def repeat_place(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Double one place and leave out another; the values between them move along."""
    doubled, omitted = (int(place) for place in rng.integers(design.shape[1], size=2))
    longer = np.insert(design, doubled, design[:, doubled], axis=1)
    return np.asarray(np.delete(longer, omitted + (omitted > doubled), axis=1))


def change_end(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Replace a value at the end: by a face of the box or by any value."""
    result = design.copy()
    part = int(rng.integers(len(design)))
    place = int(rng.integers(1, min(END_PLACES, design.shape[1]) + 1))
    result[part, -place] = rng.choice([0.0, 1.0, rng.random()])
    return result


def swap(design: Floats, donor: Floats, rng: np.random.Generator) -> Floats:
    """Exchange two places near each other, in one part or in all."""
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
    """Return the start and end of a random stretch of up to about a third of the places."""
    length = int(rng.integers(1, max(2, min(pairs, 2 + pairs // 3))))
    start = int(rng.integers(0, max(1, pairs - length + 1)))
    return start, min(start + length, pairs)


PERTURBATIONS: tuple[Perturbation, ...] = (
    change_tight_gaps, shift_end, smooth, change_all, change_stretch, bend, join, exchange,
    repeat_place, change_end, swap,
)  # fmt: skip
