"""Rules of a scene, each with a sentence for a layout that violates it, and the stock."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from domino_env.core.models import Size, Value, about
from domino_env.core.types import Floats
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout

Bounds = tuple[float, float]
Values = tuple[float, ...]

GROUND_TOLERANCE = 1e-9  # [m], [rad] largest difference of rise and tilt from those of the ground
LIST_TOLERANCE = 1e-9  # [m] largest difference of values that count as equal


def bounds_violations(
    name: str, values: Floats, bounds: Bounds, first: int, unit: str = "m", slack: float = 1e-12
) -> list[str]:
    """Return a sentence for values beyond their bounds by more than `slack` of the upper one.

    `first` is the index of the first value in the array of the layout.
    """
    low, high = bounds
    excess = slack * high
    allowed = f"{low} to {high} {unit}" if low < high else f"{low} {unit}"
    is_allowed = (values >= low - excess) & (values <= high + excess)
    return _violations(f"{name}[{{0}}]", values, is_allowed, allowed, first, unit)


def list_violations(name: str, values: Floats, allowed: Values | None, first: int) -> list[str]:
    """Return a sentence for values that are not on the list; None allows any."""
    if allowed is None:
        return []
    shown = ", ".join(f"{v:g}" for v in allowed[:4]) + (", …" if len(allowed) > 4 else "")
    mask = is_listed(values, allowed)
    return _violations(f"{name}[{{0}}]", values, mask, f"only {shown} m", first)


def is_listed(values: Floats, allowed: Values) -> NDArray[np.bool_]:
    """Return True for each value (…) that is one of the rising values `allowed`."""
    return np.abs(values - find_nearest(values, np.array(allowed))) <= LIST_TOLERANCE


def change_violations(spacing: Floats, largest_change: float | None) -> list[str]:
    """Return a sentence for neighbouring gaps that differ by too much; None allows any change."""
    if largest_change is None:
        return []
    change = np.diff(spacing)
    allowed = f"a change of at most {largest_change} m"
    is_allowed = np.abs(change) <= largest_change + 1e-12
    return _violations("spacing[{1}] - spacing[{0}]", change, is_allowed, allowed)


def ground_violations(layout: Layout, ground: Ground | None) -> list[str]:
    """Return a sentence if rise or tilt of a layout are not those of the ground; None is flat."""
    if ground is None:
        flat = "the layout has uneven ground, and the scene flat ground: give rise and tilt of 0"
        return [] if layout.is_flat else [flat]
    rise, tilt = ground.rise_and_tilt(layout.spacing, layout.thickness)
    violations = []
    for name, values, expected, unit in (
        ("rise", layout.rise, rise, "m"),
        ("tilt", layout.tilt, tilt, "rad"),
    ):
        is_allowed = np.abs(values - expected) <= GROUND_TOLERANCE
        value = f"{expected[np.argmin(is_allowed)]:.9g} {unit} on its ground"
        allowed = f"{value}; use the scene's `layout`"
        violations += _violations(f"{name}[{{0}}]", values, is_allowed, allowed, unit=unit)
    return violations


def find_nearest(values: Floats, allowed: Floats) -> Floats:
    """Return the nearest of the rising values `allowed` for each entry of an array of any shape."""
    place = np.clip(np.searchsorted(allowed, values), 1, max(len(allowed) - 1, 1))
    if len(allowed) == 1:
        return np.full_like(values, allowed[0])
    below, above = allowed[place - 1], allowed[place]
    return np.where(values - below <= above - values, below, above)


def _violations(
    place: str,
    values: Floats,
    is_allowed: NDArray[np.bool_],
    allowed: str,
    first: int = 0,
    unit: str = "m",
) -> list[str]:
    """Return a sentence for the first value that is not allowed, and the number of others."""
    if is_allowed.all():
        return []
    bad = np.flatnonzero(~is_allowed)
    i = int(bad[0])
    more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
    given = f"{place.format(i + first, i + first + 1)} = {values[i]:.13g} {unit}".strip()
    return [f"{given}{more}: the scene allows {allowed.strip()}"]


MAX_DOMINOES = 100_000  # the uniform baseline takes some 3 ms per domino
MAX_KINDS = 1_000  # of dominoes in a stock
SAME_THICKNESS = 1e-9  # [m] largest difference of thicknesses of one kind


class Stock(Value, frozen=True):  # type: ignore[misc]
    """Stock from which all dominoes are taken, the first one included.

    Parameters
    ----------
    thickness
        (K,) thicknesses of the kinds [m], no two alike.
    count
        (K,) number of dominoes of each kind.
    hand
        Number of pieces that an environment offers at a time, drawn from the stock in random
        order; None if the whole stock is offered.

    Raises
    ------
    ValueError
        For lists of different lengths, equal kinds, and values out of range.
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
        """Thicknesses of all dominoes, in the order given [m]."""
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
            The pieces that remain; `generator.permutation` of its `dominoes` is the order in which
            an environment draws them.

        Raises
        ------
        ValueError
            For a domino that the stock does not have.
        """
        count = list(self.count)
        for size in thickness:
            difference = np.abs(np.array(self.thickness) - size)
            kind = int(np.argmin(difference))
            if difference[kind] > SAME_THICKNESS or count[kind] == 0:
                raise ValueError(
                    f"no domino of {size} m is in the stock: {self.describe()}; "
                    "the first domino is taken from it"
                )
            count[kind] -= 1
        return self.replace(count=tuple(count))

    def violations(self, thickness: Floats) -> list[str]:
        """Return the violations of the stock by a layout.

        Parameters
        ----------
        thickness
            (N,) thicknesses of all its dominoes [m].

        Returns
        -------
        list of str
            A sentence for each kind of which the layout has too many; empty if there is none.
        """
        kinds = np.array(self.thickness)
        rising = np.argsort(kinds)
        nearest = find_nearest(thickness, kinds[rising])
        near = rising[np.searchsorted(kinds[rising], nearest)]
        unknown = np.flatnonzero(np.abs(thickness - kinds[near]) > SAME_THICKNESS)
        if len(unknown):
            i = int(unknown[0])
            return [f"thickness[{i}] = {thickness[i]} m: the stock has {self.describe()}"]
        used = np.bincount(near, minlength=len(kinds))
        return [
            f"{used[k]} dominoes are {self.thickness[k]} m thick: the stock has {self.count[k]}"
            for k in np.flatnonzero(used > np.array(self.count))
        ]

    def describe(self) -> str:
        """Describe the stock.

        Returns
        -------
        str
            Such as "16 of 0.005 m, 14 of 0.0075 m".
        """
        pairs = zip(self.count, self.thickness, strict=True)
        return ", ".join(f"{n} of {d:g} m" for n, d in pairs)
