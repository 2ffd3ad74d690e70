"""Perturbations: changes of a good layout into another that may be better.

A design is given as columns (the gaps; the thicknesses where they are free too), each running along
the layout. Good layouts share their shape: a falling start, a plateau, a rise, a few tight gaps at
the end and thick dominoes there. Local searches get wrong how many of the last gaps are tight,
where the plateau ends, and the ripples that face contacts have left. These perturbations change
just that. They do not depend on the score.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from domino_env.core.types import Floats

Perturbation = Callable[[Floats, Floats, np.random.Generator], Floats]
"""(design, another good design, rng) -> a changed design; both as columns, (parts, pairs)."""

TIGHT_AT_MOST = 8
NEAR = 1e-3  # of a face of the box, counts as on it


def tight_end(design: Floats, count: int) -> Floats:
    """Give a design exactly `count` tight gaps at its end; what stood before moves along."""
    now = ends_tight(design)
    moved = shifted(design, count - now) if now else design.copy()
    if count:
        moved[0, -count:] = 0.0
    if count < moved.shape[1] and moved[0, -count - 1] <= NEAR:
        moved[0, -count - 1] = _last_wide(design)
    return moved


def ends_tight(design: Floats) -> int:
    """Count the gaps at the end that are at their lower bound."""
    wide = np.flatnonzero(design[0] > NEAR)
    return int(design.shape[1] - 1 - wide[-1]) if len(wide) else int(design.shape[1])


def shifted(design: Floats, by: int) -> Floats:
    """Move the second half `by` places towards the start; the plateau in the middle gives way."""
    pairs = design.shape[1]
    middle = pairs // 2
    at = np.arange(pairs)
    source = np.where(at >= middle - max(by, 0), at + by, at)
    return np.asarray(design[:, np.clip(source, 0, pairs - 1)])


def _last_wide(design: Floats) -> float:
    wide = np.flatnonzero(design[0] > NEAR)
    return float(design[0, wide[-1]]) if len(wide) else 0.5


# perturbations ----------------------------------------------------------------------------------


def another_tight_gap(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Add a tight gap at the end, or take one away."""
    now = ends_tight(design)
    change = 1 if now == 0 or rng.random() < 0.5 else -1
    return tight_end(design, min(now + change, design.shape[1] - 1, TIGHT_AT_MOST))


def shift_the_end(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Move what stands before the tight end one or two places on or back; the end stays."""
    tight = ends_tight(design)
    by = int(rng.choice([-2, -1, 1, 2]))
    moved = shifted(design, by)
    if tight:
        moved[:, -tight:] = design[:, -tight:]
    return moved


def smooth(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Take ripples out of a stretch, or of all but the tight end."""
    pairs = design.shape[1]
    free = pairs - ends_tight(design)
    if free < 4:
        return kick(design, other, rng)
    a, b = _stretch(free, rng) if rng.random() < 0.7 else (1, free - 1)
    moved = design.copy()
    for _ in range(int(rng.integers(1, 6))):
        inner = moved[:, a:b]
        padded = np.concatenate([inner[:, :1], inner, inner[:, -1:]], axis=1)
        moved[:, a:b] = 0.25 * padded[:, :-2] + 0.5 * inner + 0.25 * padded[:, 2:]
    return moved


def kick(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Take a random step on everything that is not held at a face of the box."""
    size = 10.0 ** rng.uniform(-2.5, -0.8)
    inside = (design > NEAR) & (design < 1.0 - NEAR)
    step = size * rng.standard_normal(design.shape)
    return np.asarray(np.where(inside, design + step, design))


def kick_a_stretch(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Take a random step on a few neighbours."""
    a, b = _stretch(design.shape[1], rng)
    moved = design.copy()
    moved[:, a:b] += 10.0 ** rng.uniform(-2.0, -0.5) * rng.standard_normal((len(design), b - a))
    return moved


def bend(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Add a smooth hill or hollow somewhere, the same sign throughout."""
    pairs = design.shape[1]
    at = np.arange(pairs)
    width = rng.uniform(1.0, max(0.25 * pairs, 2.0))
    hill = np.exp(-0.5 * ((at - rng.uniform(0, pairs)) / width) ** 2)
    size = rng.choice([-1.0, 1.0], len(design)) * 10.0 ** rng.uniform(-2.0, -0.7)
    inside = (design > NEAR) & (design < 1.0 - NEAR)
    return np.asarray(np.where(inside, design + size[:, None] * hill, design))


def join(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Join the start of one good row to the end of another."""
    at = int(rng.integers(1, max(design.shape[1], 2)))
    first, last = (design, other) if rng.random() < 0.5 else (other, design)
    return np.concatenate([first[:, :at], last[:, at:]], axis=1)


def exchange(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Take a stretch from another good row."""
    a, b = _stretch(design.shape[1], rng)
    moved = design.copy()
    moved[:, a:b] = other[:, a:b]
    return moved


def put_in(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Double one place and leave out another; what stands between moves along."""
    pairs = design.shape[1]
    i, j = (int(place) for place in rng.integers(pairs, size=2))
    longer = np.insert(design, i, design[:, i], axis=1)
    return np.asarray(np.delete(longer, j + (j > i), axis=1))


def free_the_end(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Set a value at the end anew: to a face of the box or anywhere."""
    moved = design.copy()
    part = int(rng.integers(len(design)))
    place = int(rng.integers(1, min(6, design.shape[1]) + 1))
    moved[part, -place] = rng.choice([0.0, 1.0, rng.random()])
    return moved


def swap(design: Floats, other: Floats, rng: np.random.Generator) -> Floats:
    """Exchange two places near each other."""
    pairs = design.shape[1]
    moved = design.copy()
    i = int(rng.integers(pairs))
    j = int(np.clip(i + rng.integers(-4, 5), 0, pairs - 1))
    parts = slice(None) if rng.random() < 0.5 else slice(p := int(rng.integers(len(design))), p + 1)
    moved[parts, i], moved[parts, j] = design[parts, j], design[parts, i]
    return moved


def _stretch(pairs: int, rng: np.random.Generator) -> tuple[int, int]:
    length = int(rng.integers(1, max(2, min(pairs, 2 + pairs // 3))))
    a = int(rng.integers(0, max(1, pairs - length + 1)))
    return a, min(a + length, pairs)


PERTURBATIONS: tuple[Perturbation, ...] = (
    another_tight_gap,
    shift_the_end,
    smooth,
    kick,
    kick_a_stretch,
    bend,
    join,
    exchange,
    put_in,
    free_the_end,
    swap,
)
