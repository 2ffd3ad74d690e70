"""Gradient: derivatives of a wave's times and speed with respect to layout and physics."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env import kernels
from domino_env.core.checks import numbers, require
from domino_env.core.results import brief
from domino_env.core.types import Floats
from domino_env.physics import footing
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics


@dataclass(frozen=True, eq=False)
class Gradient:
    """Partial derivatives of one number, in its unit over the unit of the variable.

    For B layouts, every field has a leading B.

    Attributes
    ----------
    spacing
        (N-1,) [1/m]; all later dominoes move with the gap.
    thickness
        (N,) [1/m]; the gaps stay.
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
        (N-1,) [1/m]; all later pivots rise with the next, the gaps stay. None on flat ground.
    tilt
        (N,) [1/rad]; the ground under a domino turns about its pivot, the gaps stay. None on flat
        ground.

    Notes
    -----
    The derivative exists almost everywhere. Where a change of contact coincides with a hit, where
    several face impacts coincide, and at the onset of a face impact, it jumps: then it is that of
    the simulated sequence of events, one side of the kink.
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
        """Return the gradient of the number times a factor.

        Parameters
        ----------
        factor
            The factor, without unit.

        Returns
        -------
        Gradient
            All fields times the factor.
        """
        parts = {part.name: getattr(self, part.name) for part in fields(self)}
        return replace(self, **{k: x * factor for k, x in parts.items() if x is not None})


def arrays_of(layout: Layout) -> kernels.Arrays:
    """Return the arrays of a layout for the kernels."""
    ground = () if layout.is_flat else (layout.rise, layout.tilt)
    return kernels.Arrays(layout.spacing, layout.thickness, layout.height, layout.density, *ground)


def batch_arrays_of(layout: Layout) -> kernels.Arrays:
    """Return the arrays of a layout as a batch of one."""
    ground = () if layout.is_flat else (layout.rise[None], layout.tilt[None])
    flat = layout.spacing[None], layout.thickness[None], layout.height[None], layout.density[None]
    return kernels.Arrays(*flat, *ground)


def adjoint_arrays(arrays: kernels.Arrays) -> kernels.Arrays:
    """Return empty arrays for the derivatives with respect to all of a layout or a batch."""
    empty: list[Any] = [None if array is None else np.empty(array.shape) for array in arrays]
    return kernels.Arrays(*empty)


def gradient_of(adjoints: kernels.Arrays, friction: Any, gravity: Any, push: Any) -> Gradient:
    """Return the gradient that the kernels wrote, of one layout or of a batch."""
    return Gradient(*adjoints[:4], friction, gravity, push, *adjoints[4:])


Tape = NDArray[np.record]


def pullback(
    layout: Layout, physics: Physics, tape: Tape, arrival_bar: ArrayLike, hit: int
) -> Gradient:
    """Return Σ_k arrival_bar[k] ∂t_k, as `Wave.pullback` gives it.

    Parameters
    ----------
    layout, physics
        As simulated.
    tape
        Saved states of the simulation.
    arrival_bar
        (N,) as for `Wave.pullback`.
    hit
        Number of dominoes struck.

    Raises
    ------
    ValueError
        As for `Wave.pullback`.
    """
    bar = numbers("arrival_bar", arrival_bar)
    if bar.shape != (layout.count,):
        raise ValueError(
            f"arrival_bar has shape {bar.shape}: give one number for each of the {layout.count} "
            "dominoes"
        )
    require("arrival_bar", bar)
    if bar[hit:].any():
        k = hit + int(np.flatnonzero(bar[hit:])[0])
        raise ValueError(
            f"arrival_bar[{k}] = {bar[k]}, but the wave did not reach domino {k}: leave it at 0"
        )
    whole = np.zeros(1, kernels.PHYSICS_BAR)[0]
    arrays = arrays_of(layout)
    adjoints, setting = adjoint_arrays(arrays), (physics.friction, physics.gravity, physics.push)
    kernels.vjp(arrays, *setting, tape, bar, adjoints, whole)
    return gradient_of(adjoints, float(whole.friction), float(whole.gravity), float(whole.push))


def with_length_gradient(found: Gradient, layout: Any, weight: float | Floats) -> Gradient:
    """Return a gradient plus `weight` times that of the length.

    Parameters
    ----------
    found
        Gradient for one layout or a batch.
    layout
        The layout, or the batch, with `spacing`, `thickness`, `rise` and `tilt`.
    weight
        Factor of the length's gradient; for a batch (B, 1).

    Returns
    -------
    Gradient
        The sum.
    """
    thickness = found.thickness.copy()
    if found.rise is None or found.tilt is None:
        thickness[..., 1:] += weight
        return replace(found, spacing=found.spacing + weight, thickness=thickness)
    arrays = layout.spacing, layout.thickness, layout.rise, layout.tilt
    ahead, pitch = layout.tilt[..., 1:], layout.spacing + layout.thickness[..., 1:]
    step, whole = footing.steps(*arrays), footing.pitches(*arrays)
    share, up = weight * pitch / whole, weight * step / whole
    tan, sec = np.tan(ahead), 1.0 / np.cos(ahead)
    tilt = found.tilt.copy()
    thickness[..., 1:] += share + up * tan
    tilt[..., 1:] += up * (pitch * sec + layout.rise * tan) * sec
    return replace(
        found,
        spacing=found.spacing + share + up * tan,
        thickness=thickness,
        rise=found.rise + up * sec,
        tilt=tilt,
    )
