"""Random waves at pushes little above the smallest, and after tight gaps: none may end wrongly.

python tests/near_stalls.py --layouts 20836     the first takes 125 016 waves without friction

A wave is wrong if it converged and its outcome, its number of hits or, beyond the tolerance, a time
differs from those of the run at the tightest tolerance. Errors above their estimate but within the
tolerance are counted too; one or two waves in a thousand have one.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

# the packages of this tree come first, if this is run as a script
if __name__ == "__main__":
    sys.path[:] = [str(Path(__file__).parents[1]), *sys.path[1:]]

import domino_env as de
from domino_env.physics.wave import MIN_RTOL
from domino_env.rigid.simulation import largest_difference

EXCESSES = 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3  # of a push over the smallest, relative
TOLERANCES = 1e-3, 1e-6, 1e-8
OPTIMISTIC = "error above its estimate"
Case = tuple[str, de.Layout, de.Physics]


def powers(
    rng: np.random.Generator, low: float, high: float, size: int | None = None
) -> np.ndarray:
    """Return random numbers between two limits, uniform in their logarithm."""
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


def layouts(rng: np.random.Generator, kind: str) -> Iterator[de.Layout]:
    """Yield layouts of three to eight dominoes without end; tight gaps are of 10 nm to 0.1 mm."""
    while True:
        count = 3 if kind == "tight gap" else int(rng.integers(3, 9))
        gaps = powers(rng, 5e-5, 0.046, count - 1)
        if kind == "tight gap" or rng.random() < 0.3:
            gaps[rng.integers(count - 1)] = powers(rng, 1e-8, 1e-4)
        if kind == "tight gaps":
            gaps = powers(rng, 1e-8, 0.04, count - 1)
        yield de.Layout(gaps, powers(rng, 0.0012, 0.025, count))


def cases(number: int, seed: int = 7) -> Iterator[Case]:
    """Yield waves of `number` layouts of each kind, without friction and with."""
    rng = np.random.default_rng(seed)
    for kind in ("any gaps", "tight gap", "tight gaps"):
        for _, layout in zip(range(number), layouts(rng, kind), strict=False):
            excesses = EXCESSES if kind == "any gaps" else powers(rng, 1e-5, 3.0, 2)
            for mu in (0.0, 0.25):
                least = de.smallest_push(layout, de.Physics(mu))
                if not 0.0 < least < np.inf:
                    continue
                for excess in excesses:
                    for sign in (1, -1) if kind == "tight gaps" and excess < 1.0 else (1,):
                        push = float(least * (1.0 + sign * excess))
                        yield f"{kind}, friction {mu:g}", layout, de.Physics(mu, push=push)


def fault(wave: de.Wave, exact: de.Wave) -> str:
    """Return what is wrong with a wave, or ""; exact: the same at the tightest tolerance."""
    if (wave.outcome, wave.hit, wave.toppled) != (exact.outcome, exact.hit, exact.toppled):
        return "ends otherwise" if wave.converged and exact.converged else ""
    error, slack = largest_difference(wave.arrival_times, exact.arrival_times), exact.error_estimate
    if slack > 0.1 * wave.rtol:  # rounding limits both
        return ""
    if wave.converged and error > wave.rtol + slack:
        return "breaks its tolerance"
    return OPTIMISTIC if error > wave.error_estimate + slack else ""


def faults(number: int, seed: int = 7) -> tuple[Counter[str], list[tuple[str, Case]]]:
    """Return the numbers of waves by kind, and the faults with their cases."""
    waves, found = Counter[str](), list[tuple[str, Case]]()
    for case in cases(number, seed):
        kind, layout, physics = case
        exact = de.simulate(layout, physics, rtol=MIN_RTOL)
        for rtol in TOLERANCES:
            waves[f"{kind}, {rtol:g}"] += 1
            if what := fault(de.simulate(layout, physics, rtol=rtol), exact):
                found.append((f"{kind}, {rtol:g}: {what}", case))
    return waves, found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--layouts", type=int, default=1000, metavar="N", help="of each kind")
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()
    waves, found = faults(arguments.layouts, arguments.seed)
    for kind, number in waves.items():
        print(f"{kind}: {number} waves")
    for what, number in sorted(Counter(what for what, _ in found).items()):
        case = next(case for name, case in found if name == what)
        print(f"{what}: {number}, as {case[1]!r}, {case[2]!r}")
    wrong = sum(OPTIMISTIC not in what for what, _ in found)
    print(f"{sum(waves.values())} waves, {wrong or 'none'} wrong")
    sys.exit(bool(wrong))
