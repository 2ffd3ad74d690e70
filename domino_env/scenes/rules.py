"""What a layout may break, each rule with its sentence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout

Floats = NDArray[np.float64]
Bounds = tuple[float, float]

ON_GROUND = 1e-9  # [m], [rad] how far from the ground still is on it
ON_LIST = 1e-9  # [m] how far from a value of the list still is that value


def outside(name: str, values: Floats, bounds: Bounds, first: int, unit: str = "m") -> list[str]:
    """Values beyond their bounds; `first` is the index of the first of them in its array."""
    low, high = bounds
    slack = 1e-12 * high
    allowed = f"{low} to {high} {unit}" if low < high else f"{low} {unit}"
    return _told(name, values, (values >= low - slack) & (values <= high + slack), first, unit,
                 allowed)  # fmt: skip


def off_list(name: str, values: Floats, allowed: tuple[float, ...], first: int) -> list[str]:
    """Values that are not on the list."""
    near = nearest_of(values, np.array(allowed))
    few = ", ".join(f"{v:g}" for v in allowed[:4]) + (", …" if len(allowed) > 4 else "")
    return _told(name, values, np.abs(values - near) <= ON_LIST, first, "m", f"only {few} m")


def too_steep(spacing: Floats, largest_change: float) -> list[str]:
    """List neighbouring gaps that differ by more than is allowed."""
    change = np.diff(spacing)
    bad = np.flatnonzero(~(np.abs(change) <= largest_change + 1e-12))
    if len(bad) == 0:
        return []
    i = int(bad[0])
    more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
    return [
        f"spacing[{i + 1}] - spacing[{i}] = {change[i]:.9g} m{more}: the scene allows a change of "
        f"at most {largest_change} m"
    ]


def on_other_ground(layout: Layout, ground: Ground | None) -> list[str]:
    """List where rise or tilt of a layout are not those of its gaps on a ground; None is flat."""
    if ground is None:
        flat = "its ground is not flat, as the scene's is: rise and tilt must be 0"
        return [] if layout.is_flat else [flat]
    for name, unit, wanted in zip(
        ("rise", "tilt"), ("m", "rad"), ground.lay(layout.spacing, layout.thickness), strict=True
    ):
        values = getattr(layout, name)
        bad = np.flatnonzero(~(np.abs(values - wanted) <= ON_GROUND))
        if len(bad):
            i = int(bad[0])
            more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
            return [
                f"{name}[{i}] = {values[i]:.9g} {unit}{more}: on the scene's ground it is "
                f"{wanted[i]:.9g} {unit}; `layout` of the scene lays rows on it"
            ]
    return []


def nearest_of(values: Floats, allowed: Floats) -> Floats:
    """Return the nearest of the rising values `allowed` for each entry of an array of any shape."""
    place = np.clip(np.searchsorted(allowed, values), 1, max(len(allowed) - 1, 1))
    if len(allowed) == 1:
        return np.full_like(values, allowed[0])
    below, above = allowed[place - 1], allowed[place]
    return np.where(values - below <= above - values, below, above)


def _told(
    name: str, values: Floats, good: NDArray[np.bool_], first: int, unit: str, allowed: str
) -> list[str]:
    bad = np.flatnonzero(~good)
    if len(bad) == 0:
        return []
    i = int(bad[0])
    more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
    given = f"{values[i]} {unit}".strip()
    return [f"{name}[{i + first}] = {given}{more}: the scene allows {allowed.strip()}"]
