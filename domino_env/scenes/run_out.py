"""Run-out: dominoes with fixed gaps after those that are designed."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from msgspec import Meta

from domino_env.core.models import Size, Value, about
from domino_env.core.types import Floats
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.rules import MAX_DOMINOES


class RunOut(Value, frozen=True):  # type: ignore[misc]
    """Dominoes with equal, fixed gaps through which the wave runs after the designed dominoes.

    They have the thickness of domino 0, and the height of all dominoes. The wave completes if it
    reaches the end of the whole row, and its mean speed is that over the whole row.

    Parameters
    ----------
    count
        Number of dominoes.
    spacing
        Gap before each of them [m].

    Raises
    ------
    ValueError
        For a value out of its range; the message has the value and the range.
    """

    count: Annotated[int, Meta(ge=1, le=MAX_DOMINOES, description="number of fixed dominoes")]
    spacing: Annotated[Size, about("free gap before each of them [m]")]

    def append_to(self, layouts: LayoutBatch) -> LayoutBatch:
        """Return B layouts with the dominoes of the run-out at their ends."""

        def extend(array: Floats, values: Floats) -> Floats:
            return np.concatenate([array, np.repeat(values, self.count, axis=1)], axis=1)

        density = layouts.density
        if np.ndim(density):
            density = extend(np.atleast_2d(density), np.atleast_2d(density)[:, :1])[0]
        return replace(
            layouts,
            spacing=extend(layouts.spacing, np.full((len(layouts), 1), self.spacing)),
            thickness=extend(layouts.thickness, layouts.thickness[:, :1]),
            height=extend(layouts.height, layouts.height[:, -1:]),
            density=density,
        )
