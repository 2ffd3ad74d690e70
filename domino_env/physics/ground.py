"""Ground: an even slope, or a smooth curve through points, and layouts along it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from domino_env.core.checks import numbers, require_type
from domino_env.core.models import Number, Value, about
from domino_env.core.progress import advise
from domino_env.core.threads import share_pieces
from domino_env.core.types import Floats
from domino_env.kernels.arrays import Curve
from domino_env.kernels.ground import place_on_ground, place_on_ground_vjp
from domino_env.physics.gradient import Gradient
from domino_env.physics.layout import Layout, full_array
from domino_env.physics.standard import ADVICE, DENSITY, HEIGHT, WIDTH

MAX_DISTANCE = 1e-4  # [m] of the ground under a base, over or under the chord
STEEPEST = 45.0  # [°]
WIDEST = 100.0  # [m] limit of plausible profiles
MOST_POINTS = 10_000

Angle = Annotated[float, Meta(ge=-STEEPEST, le=STEEPEST)]
Point = Annotated[tuple[Number, ...], Meta(min_length=2, max_length=2)]
Points = Annotated[tuple[Point, ...], Meta(min_length=2, max_length=MOST_POINTS)]


class Ground(Value, frozen=True, dict=True):  # type: ignore[misc]
    """Ground under a chain: an even slope, or a smooth curve through points.

    The pivot of the first domino, its front bottom edge, stands at x = 0. Every domino stands on
    the chord under its base, and free gaps are laid along the ground, each from a pivot
    perpendicular to the next back face.

    Parameters
    ----------
    slope
        Angle of an even slope, positive downhill [°].
    profile
        Points [x, y] of a curve, x rising [m]: the natural cubic spline through them, which
        goes on straight beyond its ends.

    Raises
    ------
    ValueError
        For none or both of them, points that do not rise in x, and ground steeper than 45°.

    References
    ----------
    de Boor, C. (1978). A practical guide to splines. Springer: chapter IV, natural splines.

    Examples
    --------
    >>> import domino_env as de
    >>> de.Ground(slope=-4.0).layout([0.014] * 3, [0.0075] * 4).rise.round(6)
    array([0.0015, 0.0015, 0.0015])
    """

    slope: Annotated[Angle | None, about("of an even slope, positive downhill [degrees]")] = None
    profile: Annotated[
        Points | None,
        about(
            "points [x, y] of a smooth curve, x rising from point to point [m]; the first domino's "
            "front stands at x = 0, and beyond its ends the ground goes on straight"
        ),
    ] = None

    SCHEMA: ClassVar = {"oneOf": [{"required": ["slope"]}, {"required": ["profile"]}]}

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.slope is None) == (self.profile is None):
            raise ValueError("give either slope [°] or profile, a list of points [x, y] [m]")
        for i, ((a, _), (b, _)) in enumerate(pairwise(self.profile or ())):
            if not b > a:
                raise ValueError(
                    f"profile[{i + 1}] lies at x = {b:g} m and the point before at {a:g} m: give "
                    "points in the order of x"
                )
        if self.profile is not None and (span := self.profile[-1][0] - self.profile[0][0]) > WIDEST:
            advise(f"profile spans {span:g} m: {ADVICE}")
        place, steepest = self.steepest
        if self.profile is not None and steepest > math.tan(math.radians(STEEPEST)):
            raise ValueError(
                f"profile slopes by {math.degrees(math.atan(steepest)):.3g}° near x = {place:.4g} "
                f"m: at most {STEEPEST:g}°; points that lie further apart are less steep"
            )

    @property
    def is_even(self) -> bool:
        """True for an even slope."""
        return self.slope is not None

    def height(self, x: ArrayLike) -> Floats:
        """Return the height of the ground.

        Parameters
        ----------
        x
            Places (…), in the coordinates of the points [m].

        Returns
        -------
        ndarray
            Heights (…) [m].
        """
        t, c = self._piece(numbers("x", x))
        return np.asarray(((c[0] * t + c[1]) * t + c[2]) * t + c[3])

    @property
    def steepest(self) -> tuple[float, float]:
        """Steepest place [m] and the slope there, |dy/dx|."""
        knots, inner = self.curve.knots, self.curve.pieces[1:-1]
        # the slope is largest at a knot or where a piece has no curvature
        with np.errstate(all="ignore"):
            flat = -inner[:, 1] / (3.0 * inner[:, 0])
        flat = np.where((flat > 0.0) & (flat < np.diff(knots)), flat, 0.0)
        places = np.concatenate([knots, knots[:-1] + flat])
        t, c = self._piece(places)
        steepness = np.abs((3.0 * c[0] * t + 2.0 * c[1]) * t + c[2])
        worst = int(np.argmax(steepness))
        return float(places[worst]), float(steepness[worst])

    def curvature(self, way: float) -> tuple[float, float]:
        """Return the place at which the ground bends most one way, and its curvature there.

        Parameters
        ----------
        way
            1 for hollows, -1 for crests.

        Returns
        -------
        tuple of float
            Place [m] and d²y/dx² [1/m].
        """
        knots = self.curve.knots  # the curvature is linear between them
        t, c = self._piece(knots)
        bends = way * (6.0 * c[0] * t + 2.0 * c[1])
        worst = int(np.argmax(bends))
        return float(knots[worst]), max(float(bends[worst]), 0.0)

    def lay(self, spacing: ArrayLike, thickness: ArrayLike) -> tuple[Floats, Floats]:
        """Return rise and tilt of layouts on the ground.

        Parameters
        ----------
        spacing
            (N-1,) or (B, N-1) free gaps [m].
        thickness
            (N,) or (B, N) [m].

        Returns
        -------
        tuple of ndarray
            `rise` (…, N-1) [m] and `tilt` (…, N) [rad], as of a `Layout`.

        Raises
        ------
        ValueError
            For ground that bulges by more than a tenth of a millimetre under a base.
        """
        gaps, thick = numbers("spacing", spacing), numbers("thickness", thickness)
        if self.slope is not None:
            slope = math.radians(self.slope)
            return -math.sin(slope) * (gaps + thick[..., 1:]), np.full_like(thick, slope)
        if violation := self.violation(float(thick.max(initial=0.0))):
            raise ValueError(violation)
        arrays = _batch(gaps), _batch(thick)
        rise, tilt = (np.empty(array.shape) for array in arrays)
        size = len(tilt), thick.shape[-1]
        share_pieces(place_on_ground, *size, self.curve, *arrays, rise, tilt)
        return rise.reshape(gaps.shape), tilt.reshape(thick.shape)

    def layout(
        self,
        spacing: ArrayLike,
        thickness: ArrayLike,
        height: ArrayLike = HEIGHT,
        width: float = WIDTH,
        density: ArrayLike = DENSITY,
    ) -> Layout:
        """Return a layout on the ground.

        Parameters
        ----------
        spacing, thickness, height, width, density
            As for `Layout`.

        Returns
        -------
        Layout
            With the ground's rise and tilt.

        Raises
        ------
        ValueError
            As for `lay` and `Layout`.
        """
        gaps = np.atleast_1d(numbers("spacing", spacing))
        thick = full_array("thickness", thickness, len(gaps) + 1)
        rise, tilt = self.lay(gaps, thick)
        return Layout(gaps, thick, height, width, density, rise, tilt)

    def violation(self, thickness: float) -> str | None:
        """Return a sentence about where a base does not lie on the ground, or None.

        Parameters
        ----------
        thickness
            Length of the base [m].

        Returns
        -------
        str or None
            Place, distance and next action.
        """
        for way, verb in ((1.0, "is hollow"), (-1.0, "bulges")):
            place, bend = self.curvature(way)
            off = bend * thickness**2 / 8.0
            if off > MAX_DISTANCE:
                return (
                    f"the ground {verb} by {1e3 * off:.3g} mm under a base {1e3 * thickness:.4g} mm"
                    f" thick near x = {place:.4g} m: at most {1e3 * MAX_DISTANCE:g} mm; make it "
                    "bend less there, or the dominoes thinner"
                )
        return None

    def along_ground(self, gradient: Gradient, layout: Any) -> Gradient:
        """Turn a gradient with the ground fixed into one along the ground.

        Where a gap or a thickness changes, all later dominoes move along the ground, and their
        rise and tilt change with it.

        Parameters
        ----------
        gradient
            Gradient of one layout, as from `Wave.gradient`, or of a batch.
        layout
            That layout, or the batch, with `spacing`, `thickness`, `rise` and `tilt`.

        Returns
        -------
        Gradient
            Derivatives along the ground, without rise and tilt.
        """
        require_type("gradient", gradient, Gradient, "a Gradient, such as wave.gradient()")
        if gradient.rise is None or gradient.tilt is None:
            return gradient  # on flat ground nothing changes
        spacing, thickness = gradient.spacing.copy(), gradient.thickness.copy()
        if self.slope is not None:
            moved = -math.sin(math.radians(self.slope)) * gradient.rise
            spacing += moved
            thickness[..., 1:] += moved
        else:
            geometry = layout.spacing, layout.thickness, layout.rise, layout.tilt
            arrays = [_batch(array) for array in (*geometry, gradient.rise, gradient.tilt)]
            written = [np.atleast_2d(array) for array in (spacing, thickness)]
            size = arrays[1].shape
            share_pieces(place_on_ground_vjp, *size, self.curve, *arrays, *written)
        return replace(gradient, spacing=spacing, thickness=thickness, rise=None, tilt=None)

    @cached_property
    def curve(self) -> Curve:
        """Ground as an argument of the kernels."""
        if self.profile is None:
            down = -math.tan(math.radians(self.slope or 0.0))
            x, pieces = np.zeros(1), np.full((2, 4), [0.0, 0.0, down, 0.0])
        else:
            from scipy.interpolate import CubicSpline

            x, y = np.array(self.profile).T
            spline = CubicSpline(x, y, bc_type="natural")
            ends = [[0.0, 0.0, float(spline(x[k], 1)), y[k]] for k in (0, -1)]
            pieces = np.concatenate([ends[:1], spline.c.T, ends[1:]])
        starts = np.concatenate([x[:1], x])
        return Curve(*(_batch(array, 0) for array in (x, starts, pieces)))

    def _piece(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the distance of x (…) from the start of its piece, and its coefficients (4, …)."""
        k = np.searchsorted(self.curve.knots, x)
        return x - self.curve.starts[k], np.moveaxis(self.curve.pieces[k], -1, 0)


def _batch(array: ArrayLike, axes: int = 1) -> Floats:
    """Return a read-only view with a batch axis, as the compiled functions take it."""
    array = np.ascontiguousarray(array, dtype=np.float64)
    view = np.atleast_2d(array).view() if axes else array.view()
    view.flags.writeable = False
    return view
