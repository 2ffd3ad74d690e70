"""Stock: a box with so many dominoes of each thickness."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from domino_env.core.models import Size, Value
from domino_env.scenes.rules import nearest_of

Floats = NDArray[np.float64]

MOST_DOMINOES = 100_000  # the best uniform row takes some 3 ms a domino
MOST_KINDS = 1_000  # of dominoes in a stock
SAME = 1e-9  # [m] two thicknesses this close are the same domino


class Stock(Value, frozen=True):  # type: ignore[misc]
    """The box that all dominoes are taken from, the first among them.

    Parameters
    ----------
    thickness
        The kinds [m], no two alike.
    count
        How many there are of each.

    Raises
    ------
    ValueError
        With the place and what to do, for anything that is no box.
    """

    thickness: Annotated[
        tuple[Size, ...], Meta(min_length=1, max_length=MOST_KINDS, description="the kinds [m]")
    ]
    count: Annotated[
        tuple[Annotated[int, Meta(ge=0, le=MOST_DOMINOES)], ...],
        Meta(max_length=MOST_KINDS, description="how many there are of each"),
    ]

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.thickness) != len(self.count):
            raise ValueError(
                f"thickness has {len(self.thickness)} entries and count {len(self.count)}: give "
                "one count for each thickness"
            )
        for i, d in enumerate(self.thickness):
            if any(abs(d - other) <= SAME for other in self.thickness[:i]):
                raise ValueError(f"thickness[{i}] = {d} m stands there twice: add the counts")

    @property
    def dominoes(self) -> Floats:
        """Thickness of every domino in the box, in the order given [m]."""
        return np.repeat(np.array(self.thickness), self.count)

    def kind(self, thickness: float) -> int | None:
        """Return which of the kinds a thickness [m] is; None if none."""
        near = np.abs(np.array(self.thickness) - thickness)
        return int(np.argmin(near)) if near.min() <= SAME else None

    def without(self, thickness: float) -> Stock:
        """Return the box after one domino of a thickness [m] has been taken out.

        Raises
        ------
        ValueError
            Where there is none left.
        """
        kind = self.kind(thickness)
        if kind is None or self.count[kind] == 0:
            raise ValueError(
                f"no domino of {thickness} m is in the stock: {self.in_words()}; "
                "the first domino is taken from it"
            )
        count = list(self.count)
        count[kind] -= 1
        return Stock(self.thickness, tuple(count))

    def broken_by(self, thickness: Floats) -> list[str]:
        """List what a row of these thicknesses (N,) takes that is not there, a sentence each."""
        kinds = np.array(self.thickness)
        rising = np.argsort(kinds)
        nearest = nearest_of(thickness, kinds[rising])
        near = rising[np.searchsorted(kinds[rising], nearest)]
        strange = np.flatnonzero(np.abs(thickness - kinds[near]) > SAME)
        if len(strange):
            i = int(strange[0])
            return [f"thickness[{i}] = {thickness[i]} m: the stock has {self.in_words()}"]
        used = np.bincount(near, minlength=len(kinds))
        return [
            f"{used[k]} dominoes are {self.thickness[k]} m thick: the stock has {self.count[k]}"
            for k in np.flatnonzero(used > np.array(self.count))
        ]

    def in_words(self) -> str:
        """Say it as in "16 of 0.005 m, 14 of 0.0075 m"."""
        pairs = zip(self.count, self.thickness, strict=True)
        return ", ".join(f"{n} of {d:g} m" for n, d in pairs)
