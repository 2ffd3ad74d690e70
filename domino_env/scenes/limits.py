"""Limits: what a design must not lean on."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from domino_env.core.models import Value
from domino_env.scenes.waves import Waves

Floats = NDArray[np.float64]

# Of a row at its limit it depends on rounding whether it keeps it.  A close look lets that pass; a
# search, which looks less closely, does not, and so proposes rows that the close look passes.
CLOSE_LOOK = 1e-9
HAIR = 1e-6


class Limits(Value, frozen=True):  # type: ignore[misc]
    """What a design must not lean on.

    Parameters
    ----------
    stall_margin
        Least allowed `Wave.stall_margin` of all falls, 0 to below 1; None for any.
    flush_loss
        Largest allowed `Wave.largest_flush_loss`, 0 or more; None for any.

    Raises
    ------
    ValueError
        With the value and what is allowed.
    """

    stall_margin: Annotated[
        Annotated[float, Meta(ge=0, lt=1)] | None, Meta(description="of all falls, at least")
    ] = None
    flush_loss: Annotated[
        Annotated[float, Meta(ge=0, le=1)] | None, Meta(description="of all flushes, at most")
    ] = None

    SCHEMA: ClassVar = {"minProperties": 1}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stall_margin is None and self.flush_loss is None:
            raise ValueError("the table is empty; it holds stall_margin, flush_loss")

    def excess(self, waves: Waves) -> Floats:
        """Return (B,) by how much the limits are broken, both parts added; 0 where kept."""
        over = np.zeros(len(waves.reach))
        if self.stall_margin is not None:
            over += np.maximum(self.stall_margin - waves.lowest_stall_margin, 0.0)
        if self.flush_loss is not None:
            over += np.maximum(waves.largest_flush_loss - self.flush_loss, 0.0)
        hair = HAIR if waves.rtol <= CLOSE_LOOK else 0.0
        return np.where(over <= hair, 0.0, over)

    def lower(self, scores: Floats, waves: Waves) -> Floats:
        """Return scores (B,), lowered where a wave breaks a limit; deaths make room for those."""
        excess = self.excess(waves)
        broken = -0.5 * excess / (1.0 + excess)
        lowered = np.where(scores < 0.0, 0.5 * scores - 0.5, scores)
        return np.where((scores > 0.0) & (excess > 0.0), broken, lowered)
