"""Limits on the waves of layouts, which lower scores.

A wave that completes but violates a limit scores between -1/2 and 0, higher the smaller the
violation, and waves that stop score between -1 and -1/2.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta

from domino_env.core.models import Value, about
from domino_env.core.types import Floats
from domino_env.physics.wave import WaveBatch

# Rounding decides whether a layout at a limit satisfies it. Therefore scores with at most this rtol
# allow some excess. Searches have a larger rtol and allow none, so their results are accepted.
FINAL_RTOL = 1e-9
ALLOWED_EXCESS = 1e-6  # by which stall margin and loss together may violate their limits


Margin = Annotated[float, Meta(ge=0, lt=1)]
Loss = Annotated[float, Meta(ge=0, le=1)]


class Limits(Value, frozen=True):  # type: ignore[misc]
    """Limits on the wave of a layout.

    Parameters
    ----------
    stall_margin
        Smallest allowed `Wave.stall_margin`, 0 or more and less than 1; None for any.
    flush_loss
        Largest allowed `Wave.largest_flush_loss`, 0 to 1; None for any.

    Raises
    ------
    ValueError
        For a value out of its range, and if both are None.
    """

    stall_margin: Annotated[Margin | None, about("smallest allowed stall margin")] = None
    flush_loss: Annotated[Loss | None, about("largest loss of speed in a face impact")] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stall_margin is None and self.flush_loss is None:
            raise ValueError("the table is empty: give stall_margin, flush_loss or both")

    def apply(self, scores: Floats, waves: WaveBatch) -> Floats:
        """Return scores that are lower if a wave violates a limit or stops.

        Parameters
        ----------
        scores
            (B,) scores without limits.
        waves
            Results of the B waves.

        Returns
        -------
        NDArray
            (B,) scores.
        """
        excess = np.zeros(len(waves.reach))
        if self.stall_margin is not None:
            excess += np.maximum(self.stall_margin - waves.lowest_stall_margin, 0.0)
        if self.flush_loss is not None:
            excess += np.maximum(waves.largest_flush_loss - self.flush_loss, 0.0)
        allowed = ALLOWED_EXCESS if waves.rtol <= FINAL_RTOL else 0.0
        failures = -0.5 * excess / (1.0 + excess)
        others = np.where(scores < 0.0, 0.5 * scores - 0.5, scores)
        return np.where((scores > 0.0) & (excess > allowed), failures, others)
