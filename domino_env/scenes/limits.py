"""Limits on the waves of layouts, which lower scores.

A wave that completes but violates a limit scores between -1/2 and 0, higher the smaller the
violation, and waves that stop score between -1 and -1/2.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta

from domino_env.core.models import Value
from domino_env.core.types import Floats
from domino_env.physics.wave import WaveBatch

# Rounding decides whether a layout at a limit satisfies it. Therefore scores with at most this rtol
# allow some excess. Searches have a larger rtol and allow none, so their results are accepted.
FINAL_RTOL = 1e-9
ALLOWED_EXCESS = 1e-6  # by which a stall margin may violate its limit


class Limits(Value, frozen=True):  # type: ignore[misc]
    """Limits on the wave of a layout.

    Parameters
    ----------
    stall_margin
        Smallest allowed `Wave.stall_margin`, 0 or more and less than 1.

    Raises
    ------
    ValueError
        For a value out of its range.
    """

    stall_margin: Annotated[float, Meta(ge=0, lt=1, description="smallest allowed stall margin")]

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
        excess = np.maximum(self.stall_margin - waves.lowest_stall_margin, 0.0)
        allowed = ALLOWED_EXCESS if waves.rtol <= FINAL_RTOL else 0.0
        failures = -0.5 * excess / (1.0 + excess)
        others = np.where(scores < 0.0, 0.5 * scores - 0.5, scores)
        return np.where((scores > 0.0) & (excess > allowed), failures, others)
