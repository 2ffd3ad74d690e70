"""How closely the hits follow a schedule."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta

from domino_env.core.models import Size, Value
from domino_env.core.types import Floats
from domino_env.physics.wave import Outcome, Wave, simulate
from domino_env.scenes.objectives.base import Evaluation, Objective, ScoreGradient
from domino_env.scenes.waves import LayoutBatch, Waves

TOLERANCE = 1e-3  # [s]


class Tempo(Value, frozen=True, rename={"first": "from", "last": "to"}):  # type: ignore[misc]
    """When each domino is to be hit.

    Give either `first` and `last`, between which the frequency rises (or falls) evenly from
    interval to interval, or `times`.

    Parameters
    ----------
    first
        Hits a second between dominoes 0 and 1.
    last
        Hits a second between the last two.
    times
        When dominoes 1 … N-1 are to be hit [s].
    tolerance
        The root-mean-square error that halves the score [s].

    Raises
    ------
    ValueError
        For anything that is no schedule; says what to give.
    """

    first: Annotated[
        Size | None, Meta(description="frequency between dominoes 0 and 1 [hits/s]")
    ] = None
    last: Annotated[Size | None, Meta(description="frequency between the last two [hits/s]")] = None
    times: Annotated[
        tuple[Size, ...] | None,
        Meta(description="instead: when dominoes 1, 2, … are to be hit [s]"),
    ] = None
    tolerance: Annotated[
        Size, Meta(description="root-mean-square error that halves the score [s]")
    ] = TOLERANCE

    SCHEMA: ClassVar = {"oneOf": [{"required": ["from", "to"]}, {"required": ["times"]}]}

    def __post_init__(self) -> None:
        super().__post_init__()
        rates = self.first, self.last
        if (self.times is None) == (rates == (None, None)) or (self.times and any(rates)):
            raise ValueError("give either from and to [hits/s], or times [s]")
        if self.times is None and None in rates:
            name = "from" if self.first is None else "to"
            raise ValueError(f"{name} is missing: give a frequency of more than 0 [hits/s]")
        for i, (a, b) in enumerate(pairwise(self.times or ()), 1):
            if not b > a:
                raise ValueError(f"times[{i}] = {b} s: times rise from domino to domino")

    def schedule(self, count: int) -> Floats:
        """Return (N-1,) when dominoes 1 … N-1 of a row of `count` are to be hit [s].

        Raises
        ------
        ValueError
            Where the times given are of a row of another length.
        """
        if self.times is not None:
            if len(self.times) != count - 1:
                raise ValueError(
                    f"times has {len(self.times)} entries: a row of {count} dominoes needs one "
                    f"for each but the first, {count - 1}"
                )
            return np.array(self.times)
        assert self.first is not None
        assert self.last is not None
        return np.cumsum(1.0 / np.linspace(self.first, self.last, count - 1))

    def error(self, arrivals: Floats) -> Floats:
        """Return (B,) root-mean-square error of arrival times (B, N) at dominoes 1 … N-1 [s]."""
        late = arrivals[:, 1:] - self.schedule(arrivals.shape[1])
        return np.asarray(np.sqrt(np.mean(late**2, axis=1)))

    def score(self, arrivals: Floats) -> Floats:
        """Return (B,) 1 / (1 + RMS error / tolerance): 1 on the dot, a half at the tolerance."""
        return 1.0 / (1.0 + self.error(arrivals) / self.tolerance)

    def slope(self, arrivals: Floats) -> Floats:
        """Return (B, N) derivative of the score by the arrival times [1/s]; 0 at its peak."""
        late = arrivals[:, 1:] - self.schedule(arrivals.shape[1])
        error, score = self.error(arrivals)[:, None], self.score(arrivals)[:, None]
        by_time = -(score**2) / self.tolerance * late / (late.shape[1] * np.maximum(error, 1e-300))
        return np.concatenate([np.zeros((len(late), 1)), by_time], axis=1)


@dataclass(frozen=True)
class InTempo(Objective):
    """How closely the arrival times follow a schedule, see `Tempo` [1]."""

    settings: Tempo

    name: ClassVar[str] = "tempo"
    table: ClassVar[type[Value] | None] = Tempo
    needs_arrivals: ClassVar[bool] = True

    def success(self, waves: Waves) -> Floats:
        """Score waves (B,) by their arrival times."""
        # a wave that died has no score of this kind, and inf no place in a mean
        times = np.where(waves.propagated[:, None], waves.arrival_times, 0.0)
        return self.settings.score(times)

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate layouts and score them, one by one where the gradient is asked for."""
        if not gradient or len(batch) == 0:
            return super().evaluate(batch, gradient)
        ones = [batch[b : b + 1] for b in range(len(batch))]
        return Evaluation.joined([self._with_gradient(one) for one in ones])

    def _with_gradient(self, one: LayoutBatch) -> Evaluation:
        """Evaluate a batch of one layout."""
        wave = simulate(one.layout(0), one.physics, rtol=one.rtol, gradient=True)
        found = self.score(Waves.of_waves([wave], one.count))
        if wave.outcome != Outcome.PROPAGATED:
            return found.with_gradient(ScoreGradient.zero(one))
        by = wave.pullback(self.settings.slope(wave.arrival_times[None])[0])
        if self.ground is not None:
            by = self.ground.along_ground(by, wave.layout)
        rows = (array[None] for array in (by.spacing, by.thickness[1:], by.height[1:]))
        return found.with_gradient(ScoreGradient(*rows))

    def in_words(self, score: float, wave: Wave) -> str:
        """Say how far off the schedule the hits are."""
        return f"RMS error {1e3 * self.settings.error(wave.arrival_times[None])[0]:.6g} ms"

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Ask for as many times as there are hits."""
        try:
            tables.tempo.schedule(tables.row.count)
        except ValueError as error:
            yield f"tempo.{error}"
