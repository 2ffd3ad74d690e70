"""Rules of a scene, each of which returns a sentence if a layout violates it, and the stock."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta

from domino_env.core.models import Size, Value, about
from domino_env.core.types import Bools, Floats
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout

Bounds = tuple[float, float]  # smallest and largest value

GROUND_TOLERANCE = 1e-9  # [m], [rad] largest difference of rise and tilt from those of the ground


def ground_violations(layout: Layout, ground: Ground | None) -> list[str]:
    """Return sentences if rise or tilt of a layout are not those of the ground (None: flat)."""
    if ground is None:
        sentence = "the layout is on uneven ground, the scene on flat: give rise and tilt of 0"
        return [] if layout.is_flat else [sentence]
    rise, tilt = ground.rise_and_tilt(layout.spacing, layout.thickness)
    violations = []
    for name, values, expected, unit in (
        ("rise", layout.rise, rise, "m"),
        ("tilt", layout.tilt, tilt, "rad"),
    ):
        is_allowed = np.abs(values - expected) <= GROUND_TOLERANCE
        value = f"{expected[np.argmin(is_allowed)]:.9g} {unit} on its ground"
        allowed = f"{value}; make the layout with `scene.layout`"
        violations += first_violation(name, values, is_allowed, allowed, 0, unit)
    return violations


def first_violation(
    name: str, values: Floats, is_allowed: Bools, allowed: str, first: int, unit: str
) -> list[str]:
    """Return a sentence about the first value that is not allowed, with the number of others.

    `first` is the index of the first value in the array of the layout.
    """
    if is_allowed.all():
        return []
    violating = np.flatnonzero(~is_allowed)
    i = int(violating[0])
    more = f" (and {len(violating) - 1} more)" if len(violating) > 1 else ""
    given = f"{name}[{i + first}] = {values[i]:.13g} {unit}".strip()
    return [f"{given}{more}: the scene allows {allowed.strip()}"]


MAX_DOMINOES = 100_000  # of a scene; its uniform baseline takes some 3 ms per domino
MAX_KINDS = 1_000  # largest number of thicknesses in a stock
SAME_THICKNESS = 1e-9  # [m] largest difference of thicknesses of one kind


class Stock(Value, frozen=True):  # type: ignore[misc]
    """Stock from which all dominoes are taken, the first one included.

    Parameters
    ----------
    thickness
        (K,) thicknesses of the kinds of dominoes [m], all different.
    count
        (K,) numbers of dominoes of each kind.
    hand
        Number of pieces that are held at a time, drawn from the stock in random order; None for the
        whole stock.

    Raises
    ------
    ValueError
        For lists of different lengths, kinds of equal thickness, and values out of range.
    """

    thickness: Annotated[
        tuple[Size, ...],
        Meta(min_length=1, max_length=MAX_KINDS, description="thickness of each kind [m]"),
    ]
    count: Annotated[
        tuple[Annotated[int, Meta(ge=0, le=MAX_DOMINOES)], ...],
        Meta(max_length=MAX_KINDS, description="number of dominoes of each kind"),
    ]
    hand: Annotated[
        Annotated[int, Meta(ge=1, le=MAX_DOMINOES)] | None,
        about("pieces held at a time, drawn in random order; without it, the whole box"),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.thickness) != len(self.count):
            raise ValueError(
                f"thickness has {len(self.thickness)} entries and count {len(self.count)}: give "
                "one count for each thickness"
            )
        for i, d in enumerate(self.thickness):
            if any(abs(d - other) <= SAME_THICKNESS for other in self.thickness[:i]):
                raise ValueError(f"thickness[{i}] = {d} m is listed twice: add the counts")

    @property
    def dominoes(self) -> Floats:
        """Thicknesses of all dominoes, in the order of the kinds [m]."""
        return np.repeat(np.array(self.thickness), self.count)

    def without(self, *thickness: float) -> Stock:
        """Return the stock without some dominoes.

        Parameters
        ----------
        *thickness
            Thickness of each of these dominoes [m].

        Returns
        -------
        Stock
            The remaining pieces. An environment draws them in the order `permutation(dominoes)` of
            its random generator.

        Raises
        ------
        ValueError
            For a domino that is not in the stock.
        """
        count = list(self.count)
        for size in thickness:
            difference = np.abs(np.array(self.thickness) - size)
            kind = int(np.argmin(difference))
            if not difference[kind] <= SAME_THICKNESS or count[kind] == 0:  # not for NaN either
                raise ValueError(
                    f"no domino of {size} m is in the stock: {self.describe()}; "
                    "choose one of these dominoes"
                )
            count[kind] -= 1
        return self.replace(count=tuple(count))

    def violations(self, thickness: Floats) -> list[str]:
        """Return sentences if the dominoes of a layout are not all in the stock.

        Parameters
        ----------
        thickness
            (N,) thicknesses of all dominoes of the layout [m].

        Returns
        -------
        list of str
            One sentence about the first thickness that the stock does not have, or else one for
            each kind of which the layout has too many; empty if there is no violation.
        """
        sizes = np.array(self.thickness)
        order = np.argsort(sizes)
        middles = 0.5 * (sizes[order[1:]] + sizes[order[:-1]])
        kinds = order[np.searchsorted(middles, thickness)]  # the nearest
        unknown = np.flatnonzero(~(np.abs(thickness - sizes[kinds]) <= SAME_THICKNESS))
        if len(unknown):
            i = int(unknown[0])
            return [f"thickness[{i}] = {thickness[i]} m: the stock has {self.describe()}"]
        used = np.bincount(kinds, minlength=len(sizes))
        return [
            f"{used[k]} dominoes are {self.thickness[k]} m thick: the stock has {self.count[k]}"
            for k in np.flatnonzero(used > np.array(self.count))
        ]

    def describe(self) -> str:
        """Return a description such as "16 of 0.005 m, 14 of 0.0075 m"."""
        pairs = zip(self.count, self.thickness, strict=True)
        return ", ".join(f"{n} of {d:g} m" for n, d in pairs)
