"""Objective that scores how close the hits are to a schedule."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.checks import numbers
from domino_env.core.models import Size, Value, about
from domino_env.core.types import Floats
from domino_env.physics.wave import WaveBatch
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.objectives.base import Objective, ScoreGradient

LEAST_SCORE = 1e-4  # smaller scores count as this in gains
LEAST_ERROR = 1e-6  # [ms] smaller errors are rounding


class Tempo(Value, frozen=True, rename={"first": "from", "last": "to"}):  # type: ignore[misc]
    """Schedule of the hits.

    It is given either by `first` and `last`, between which the frequency of the hits changes
    linearly from interval to interval, or by `times`.

    Parameters
    ----------
    first
        Frequency of the hits between dominoes 0 and 1 [1/s]; "from" in scene files.
    last
        Frequency of the hits between the last two dominoes [1/s]; "to" in scene files.
    times
        (N-1,) increasing arrival times of dominoes 1 … N-1 [s].
    tolerance
        Root-mean-square error that halves the score [s].

    Raises
    ------
    ValueError
        For both or neither of the two forms, and for times that do not increase.
    """

    first: Annotated[Size | None, about("frequency between dominoes 0 and 1 [hits/s]")] = None
    last: Annotated[Size | None, about("frequency between the last two [hits/s]")] = None
    times: Annotated[
        tuple[Size, ...] | None,
        about("arrival times of dominoes 1, 2, …, in place of from and to [s]"),
    ] = None
    tolerance: Annotated[Size, about("root-mean-square error that halves the score [s]")] = 1e-3

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
                raise ValueError(f"times[{i}] = {b} s: give more than times[{i - 1}] = {a} s")

    def schedule(self, count: int) -> Floats:
        """Return the scheduled arrival times.

        Parameters
        ----------
        count
            Number N of dominoes.

        Returns
        -------
        NDArray
            (N-1,) arrival times of dominoes 1 … N-1 [s].

        Raises
        ------
        ValueError
            If `times` are those of another number of dominoes.
        """
        if self.times is not None:
            if len(self.times) != count - 1:
                raise ValueError(
                    f"times has {len(self.times)} entries: {count} dominoes need one for each but "
                    f"the first, {count - 1}"
                )
            return np.array(self.times)
        assert self.first is not None
        assert self.last is not None
        return np.cumsum(1.0 / np.linspace(self.first, self.last, count - 1))

    def _errors(self, arrivals: Floats) -> Floats:
        """Return the errors (B, N-1) of arrival times (B, N) [s]."""
        times = numbers("arrivals", arrivals, None, ("B", "N"), "times of B layouts")
        return times[:, 1:] - self.schedule(times.shape[1])

    def error(self, arrivals: Floats) -> Floats:
        """Return root-mean-square errors of arrival times.

        Parameters
        ----------
        arrivals
            (B, N) arrival times [s].

        Returns
        -------
        NDArray
            (B,) root-mean-square errors at dominoes 1 … N-1 [s].
        """
        return np.asarray(np.sqrt(np.mean(self._errors(arrivals) ** 2, axis=1)))

    def score(self, arrivals: Floats) -> Floats:
        """Return scores of arrival times.

        Parameters
        ----------
        arrivals
            (B, N) arrival times [s].

        Returns
        -------
        NDArray
            (B,) scores, 1/(1 + e/tolerance) for a root-mean-square error e.
        """
        return 1.0 / (1.0 + self.error(arrivals) / self.tolerance)

    def gradient(self, arrivals: Floats) -> Floats:
        """Return the derivatives of the scores with respect to the arrival times.

        Parameters
        ----------
        arrivals
            (B, N) arrival times [s].

        Returns
        -------
        NDArray
            (B, N) derivatives [1/s]; 0 where all errors are 0.
        """
        errors = self._errors(arrivals)
        rms = np.maximum(self.error(arrivals)[:, None], 1e-300)  # no division by 0
        score = 1.0 / (1.0 + rms / self.tolerance)
        by_time = -(score**2) / self.tolerance * errors / (errors.shape[1] * rms)
        return np.concatenate([np.zeros((len(errors), 1)), by_time], axis=1)


@dataclass(frozen=True)
class InTempo(Objective):
    """Closeness of the arrival times to a schedule, see `Tempo`."""

    settings: Tempo

    name: ClassVar[str] = "tempo"
    table: ClassVar[type[Value] | None] = Tempo
    rewards_steps: ClassVar[bool] = True
    needs_arrivals: ClassVar[bool] = True
    shows_errors: ClassVar[bool] = True

    def success(self, waves: WaveBatch) -> Floats:
        """Return the scores (B,) of the arrival times."""
        return self.settings.score(self._times(waves))

    def derivatives(self, waves: WaveBatch, layouts: LayoutBatch) -> ScoreGradient:
        """Return the derivatives of the scores of the arrival times."""
        by_time = waves.propagated[:, None] * self.settings.gradient(self._times(waves))
        return ScoreGradient.from_gradient(layouts.along_ground(waves.pullback(by_time)))

    def _times(self, waves: WaveBatch) -> Floats:
        """Return arrival times (B, N), and 0 for waves that stop, whose scores are not used."""
        return np.where(waves.propagated[:, None], waves.arrival_times, 0.0)

    def gain(self, score: Floats, reference: Floats) -> Floats:
        """Return log₁₀(score / reference) / 10, which is not constant far from the schedule."""
        scores = (np.maximum(value, LEAST_SCORE) for value in (score, reference))
        return np.asarray(0.1 * np.log10(np.divide(*scores)))

    def displayed(self, score: ArrayLike) -> Any:
        """Return the root-mean-square errors of scores [ms], infinite for scores of 0 or less."""
        with np.errstate(divide="ignore"):
            error = 1e3 * self.settings.tolerance * (1.0 / np.maximum(score, 0.0) - 1.0)
        return np.maximum(error, LEAST_ERROR)

    def quantity(self) -> str:
        """Return the name of the errors, with their unit."""
        return "RMS error [ms]"

    def label(self, score: float, digits: int = 6) -> str:
        """Format the error of a score as "RMS error 18.7318 ms"."""
        if score <= 0.0:
            return super().label(score, digits)
        error = self.displayed(score)
        return f"RMS error {'below 1 ns' if error <= LEAST_ERROR else f'{error:.{digits}g} ms'}"

    def compare(
        self, score: float, reference: float, name: str, digits: int = 2, detailed: bool = False
    ) -> str:
        """Return the error of the reference, such as "18.73 ms with uniform"."""
        return f"{self.label(reference, 4).removeprefix('RMS error ')} with {name}"

    @classmethod
    def violations(cls, scene: Any) -> Iterator[str]:
        """Yield a sentence if the number of times does not match that of the dominoes."""
        try:
            scene.settings.schedule(scene.count)
        except ValueError as error:
            yield f"tempo.{error}"
