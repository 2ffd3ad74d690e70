"""The rigid engine as a judge: looked at ever more closely until its arrival times stand still."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.rigid.engine import Fallen, engine_version, topple
from domino_env.rigid.judges import Fall, largest_move
from domino_env.standing.simulation import window_of

Floats = NDArray[np.float64]

SHARE = 5e-4  # of an arrival time
STEPS = (8e-5, 4e-5, 2e-5)  # [s]
SWEEPS, MOST_SWEEPS = 60, 1920


@dataclass(frozen=True)
class Engine:
    """Chipmunk (pymunk, extra 'verify'), which shares no code with us.

    At the coarsest step its sweeps are doubled until no arrival time moves by more than half the
    share; then it goes on to finer steps until the limit, a straight line through the two finest
    steps to a step of none, does not move either.  What the last doubling and the last step have
    moved is its doubt; after two steps only, what the limit is from the finer.

    Parameters
    ----------
    share
        Of an arrival time that may be left in doubt.
    steps
        Of time, falling, two at least [s].
    most_sweeps
        Where doubling ends.
    progress
        Called with a line for every run of the engine; None for no lines.

    Raises
    ------
    ValueError
        For fewer than two different steps, for a share or sweeps that are no positive numbers.
    """

    share: float = SHARE
    steps: tuple[float, ...] = STEPS
    most_sweeps: int = MOST_SWEEPS
    progress: Callable[[str], None] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", tuple(sorted(set(self.steps), reverse=True)))
        if len(self.steps) < 2:
            raise ValueError(
                f"steps = {list(self.steps)}: give at least two different ones to extrapolate"
            )
        if not 0.0 < self.share < 1.0:
            raise ValueError(f"share = {self.share}: give a part of an arrival time, above 0")
        if self.most_sweeps < 1:
            raise ValueError(f"sweeps = {self.most_sweeps}: at least one is needed")

    @property
    def name(self) -> str:
        """Name and version."""
        return f"pymunk {engine_version()}"

    def fall(self, layout: Layout, physics: Physics, floor: float | None) -> Fall:
        """Topple a row on a floor of this friction, or hinged (None), until it is sure enough.

        Raises
        ------
        ImportError
            Without pymunk; says what to install.
        """
        window = window_of(layout)

        def run(step: float, sweeps: int) -> Fallen:
            if self.progress is not None:
                self.progress(f"steps of {step * 1e6:g} µs, {sweeps} sweeps")
            return topple(layout, physics, step, sweeps=sweeps, floor=floor, window=window)

        sweeps = min(SWEEPS, self.most_sweeps)
        runs = [run(self.steps[0], sweeps)]
        moved = float("inf")
        while moved > 0.5 * self.share and 2 * sweeps <= self.most_sweeps:
            sweeps *= 2
            again = run(self.steps[0], sweeps)
            moved = largest_move(runs[0].arrivals, again.arrivals)
            runs = [again]
        limits: list[Floats] = []
        doubt = float("inf")
        for k, step in enumerate(self.steps[1:], start=1):
            runs.append(run(step, sweeps))
            pair = np.array([one.arrivals for one in runs[-2:]])
            limits.append(extrapolated(np.array(self.steps[k - 1 : k + 1]), pair))
            before = limits[-2] if len(limits) > 1 else runs[-1].arrivals
            doubt = moved + largest_move(limits[-1], before)
            if doubt <= self.share:
                break
        finest = self.steps[len(runs) - 1]
        return Fall(
            floor=floor,
            arrivals=limits[-1],
            toppled=runs[-1].toppled,
            doubt=doubt,
            converged=doubt <= self.share,
            how=f"{sweeps} sweeps, steps down to {finest * 1e6:g} µs",
        )


def extrapolated(steps: Floats, times: Floats) -> Floats:
    """Extrapolate arrival times (S, N) to steps of zero, (N,); inf where a run did not come.

    A straight line through all steps, as the engine's error is of first order.
    """
    came = np.isfinite(times).all(axis=0)
    limit = np.full(times.shape[1], np.inf)
    shifted = steps - steps.mean()
    slope = shifted @ times[:, came] / (shifted @ shifted)
    limit[came] = times[:, came].mean(axis=0) - slope * steps.mean()
    limit[0] = 0.0
    return limit
