"""Gradient: derivatives of a wave's times and speed with respect to layout and physics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from domino_env.core.results import dataclass_repr
from domino_env.core.types import Floats, ReadOnlyArrays, protect
from domino_env.kernels.arrays import Arrays
from domino_env.physics import footing
from domino_env.physics.layout import Layout


@dataclass(frozen=True, eq=False)
class Gradient(ReadOnlyArrays):
    """Partial derivatives of one number, in its unit over the unit of the variable.

    For B layouts, every field has a leading B.

    Attributes
    ----------
    spacing
        (N-1,) [1/m]; all later dominoes move with the gap.
    thickness
        (N,) [1/m]; the gaps do not change.
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
        (N-1,) [1/m]; all later pivots rise with the next, the gaps do not change. None on flat
        ground.
    tilt
        (N,) [1/rad]; the ground under a domino turns about its pivot, the gaps do not change. None
        on flat ground.

    Notes
    -----
    The derivative exists almost everywhere. It jumps where a change of contact coincides with a
    hit, where several face impacts coincide, and at the onset of a face impact; the result is then
    the one-sided derivative for the simulated sequence of events.
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
    __repr__ = dataclass_repr

    def __post_init__(self) -> None:
        protect(tuple(vars(self).values()))


def arrays_from(layout: Layout) -> Arrays:
    """Return the arrays of a layout for the kernels."""
    sizes = layout.spacing, layout.thickness, layout.height, layout.density
    return Arrays(*sizes, *layout.rise_and_tilt)


def with_length_gradient(gradient: Gradient, layout: Any, weight: float | Floats) -> Gradient:
    """Return a gradient plus `weight` times the gradient of the length.

    Parameters
    ----------
    gradient
        Gradient for one layout or a batch.
    layout
        The layout or batch, with `spacing`, `thickness`, `rise` and `tilt`.
    weight
        Factor of the length's gradient; for a batch (B, 1).

    Returns
    -------
    Gradient
        The sum.
    """
    thickness = gradient.thickness.copy()
    if gradient.rise is None or gradient.tilt is None:
        thickness[..., 1:] += weight
        return replace(gradient, spacing=gradient.spacing + weight, thickness=thickness)
    arrays = layout.spacing, layout.thickness, layout.rise, layout.tilt
    # components from pivot to pivot: along the ground under the next domino, and normal to it
    ahead, tangential = layout.tilt[..., 1:], layout.spacing + layout.thickness[..., 1:]
    normal, distance = footing.normal_rises(*arrays), footing.pitches(*arrays)
    along, up = weight * tangential / distance, weight * normal / distance
    tan, sec = np.tan(ahead), 1.0 / np.cos(ahead)
    tilt = gradient.tilt.copy()
    thickness[..., 1:] += along + up * tan
    tilt[..., 1:] += up * (tangential * sec + layout.rise * tan) * sec
    return replace(
        gradient,
        spacing=gradient.spacing + along + up * tan,
        thickness=thickness,
        rise=gradient.rise + up * sec,
        tilt=tilt,
    )
