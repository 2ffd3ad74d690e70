"""Gradient: derivatives of what a wave does with respect to everything it is made of."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env import kernels
from domino_env.core.checks import require
from domino_env.core.results import brief
from domino_env.physics import footing
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivatives of one number, in its unit over the unit of what is changed; all else fixed.

    Of B layouts, every field has a leading B.

    Attributes
    ----------
    spacing
        (N-1,) [1/m]; a free gap changes and all later dominoes move with it.
    thickness
        (N,) [1/m]; a thickness changes and the gaps stay.
    height
        (N,) [1/m]
    density
        (N,) [m³/kg]
    friction
        [1]
    gravity
        [s²/m]
    push
        [s/rad]
    rise
        (N-1,) [1/m]; the next pivot rises with all after it, and the gaps stay. None on flat
        ground.
    tilt
        (N,) [1/rad]; the ground under one domino turns about its pivot, and the gaps stay. None on
        flat ground.

    Notes
    -----
    The derivative exists almost everywhere. Where a switch of contact coincides with a hit, where
    links flush together, and at the onset of a flush, it jumps: then it is that of the sequence of
    events that the simulation went through, one side of the kink.
    """

    spacing: Floats
    thickness: Floats
    height: Floats
    density: Floats
    friction: float | Floats
    gravity: float | Floats
    push: float | Floats
    rise: Floats | None = None
    tilt: Floats | None = None
    __repr__ = brief

    def scaled(self, factor: float) -> Gradient:
        """Return the gradient of `factor` times the number."""
        parts = {part.name: getattr(self, part.name) for part in fields(self)}
        return replace(self, **{k: x * factor for k, x in parts.items() if x is not None})


def arrays_of(layout: Layout) -> kernels.Arrays:
    """Return the arrays of a layout."""
    ground = () if layout.is_flat else (layout.rise, layout.tilt)
    return kernels.Arrays(layout.spacing, layout.thickness, layout.height, layout.density, *ground)


def batch_arrays_of(layout: Layout) -> kernels.Arrays:
    """Return the arrays of a layout as a batch of one."""
    ground = () if layout.is_flat else (layout.rise[None], layout.tilt[None])
    row = layout.spacing[None], layout.thickness[None], layout.height[None], layout.density[None]
    return kernels.Arrays(*row, *ground)


def adjoint_arrays(row: kernels.Arrays) -> kernels.Arrays:
    """Return room for the derivatives by all that a row, or each of a batch, is made of."""
    pairs, dominoes = row.spacing.shape, row.thickness.shape
    flat = np.empty(pairs), np.empty(dominoes), np.empty(dominoes), np.empty(dominoes)
    return kernels.Arrays(
        *flat, *(() if row.rise is None else (np.empty(pairs), np.empty(dominoes)))
    )


def gradient_of(bars: kernels.Arrays, friction: Any, gravity: Any, push: Any) -> Gradient:
    """Return the gradient that the kernels wrote, of one row or of many."""
    return Gradient(*bars[:4], friction, gravity, push, *bars[4:])


Tape = NDArray[np.record]


def pull(
    layout: Layout, physics: Physics, tape: Tape, arrival_bar: ArrayLike, hit: int
) -> Gradient:
    """Return Σ_k arrival_bar[k] ∂t_k, as `Wave.pullback` gives it.

    Parameters
    ----------
    layout
        What stood.
    physics
        What made it fall.
    tape
        What the chain wrote while it ran.
    arrival_bar
        (N,) as of `Wave.pullback`.
    hit
        Dominoes that were struck.
    """
    bar = np.array(arrival_bar, dtype=np.float64)
    if bar.shape != (layout.count,):
        raise ValueError(
            f"arrival_bar has shape {bar.shape}: give one number for each of the {layout.count} "
            "dominoes"
        )
    if not np.isfinite(bar).all():
        require("arrival_bar", bar)
    if hit < len(bar) and bar[hit:].any():
        k = hit + int(np.flatnonzero(bar[hit:])[0])
        raise ValueError(
            f"arrival_bar[{k}] = {bar[k]}, but the wave never came to domino {k}: leave it at 0"
        )
    whole = np.zeros(1, kernels.PHYSICS_BAR)[0]
    row = arrays_of(layout)
    slopes = adjoint_arrays(row)
    kernels.vjp(row, physics.friction, physics.gravity, physics.push, tape, bar, slopes, whole)
    return gradient_of(slopes, float(whole.friction), float(whole.gravity), float(whole.push))


class Laid(Protocol):
    """A row over hills, or B of them with one more axis in front: a `Layout` is one."""

    @property
    def spacing(self) -> Floats:
        """(…, N-1) [m]."""

    @property
    def thickness(self) -> Floats:
        """(…, N) [m]."""

    @property
    def rise(self) -> Floats:
        """(…, N-1) [m]."""

    @property
    def tilt(self) -> Floats:
        """(…, N) [rad]."""


def with_length_gradient(found: Gradient, row: Laid, weight: float | Floats) -> Gradient:
    """Return a gradient plus `weight` times that of the length.

    Parameters
    ----------
    found
        The gradient, of a row or of many.
    row
        The row, or these.
    weight
        Of the length; of many rows (B, 1).
    """
    thickness = found.thickness.copy()
    if found.rise is None or found.tilt is None:
        thickness[..., 1:] += weight
        return replace(found, spacing=found.spacing + weight, thickness=thickness)
    told = row.spacing, row.thickness, row.rise, row.tilt
    ahead, pitch = row.tilt[..., 1:], row.spacing + row.thickness[..., 1:]
    step, whole = footing.steps(*told), footing.pitches(*told)
    share, up = weight * pitch / whole, weight * step / whole
    tan, sec = np.tan(ahead), 1.0 / np.cos(ahead)
    tilt = found.tilt.copy()
    thickness[..., 1:] += share + up * tan
    tilt[..., 1:] += up * (pitch * sec + row.rise * tan) * sec
    return replace(
        found,
        spacing=found.spacing + share + up * tan,
        thickness=thickness,
        rise=found.rise + up * sec,
        tilt=tilt,
    )
