"""Ground: an even slope or a smooth curve through points, and layouts on it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from domino_env.core.checks import numbers, require, require_type
from domino_env.core.models import Number, Value, about
from domino_env.core.progress import advise
from domino_env.core.threads import share_pieces
from domino_env.core.types import Floats, read_only
from domino_env.kernels.arrays import Curve
from domino_env.kernels.ground import place_on_ground, place_on_ground_vjp
from domino_env.physics.gradient import Gradient
from domino_env.physics.layout import Layout, full_array
from domino_env.physics.standard import ADVICE, DENSITY, HEIGHT, WIDTH

MAX_DEVIATION = 1e-4  # of the ground under a base from its chord [m]
MAX_SLOPE = 45.0  # [°]
MAX_SPAN = 100.0  # of a profile that is probably given in metres [m]
MAX_POINTS = 10_000
MAX_SIZE = 1e6  # of a gap or a thickness [m]; powers of larger ones overflow

Angle = Annotated[float, Meta(ge=-MAX_SLOPE, le=MAX_SLOPE)]
Point = Annotated[tuple[Number, ...], Meta(min_length=2, max_length=2)]
Points = Annotated[tuple[Point, ...], Meta(min_length=2, max_length=MAX_POINTS)]


class Ground(Value, frozen=True, dict=True):  # type: ignore[misc]
    """Ground under a chain: an even slope, or a smooth curve through points.

    The pivot of the first domino, its front bottom edge, is at x = 0. Every domino stands on the
    chord under its base. A gap is measured from a pivot, perpendicular to the next back face.

    Parameters
    ----------
    slope
        Angle of an even slope, positive downhill [°].
    profile
        2 to 10 000 points [x, y] of a curve, x rising [m]: the natural cubic spline through them,
        which continues straight beyond its ends.

    Raises
    ------
    ValueError
        For neither or both of slope and profile, points whose x does not rise, and ground steeper
        than 45°.

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
            "front stands at x = 0, and beyond its ends the ground continues straight"
        ),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.slope is None) == (self.profile is None):
            raise ValueError("give either slope [°] or profile, a list of points [x, y] [m]")
        for i, ((a, _), (b, _)) in enumerate(pairwise(self.profile or ())):
            if not b > a:
                raise ValueError(
                    f"profile[{i + 1}] lies at x = {b:g} m and profile[{i}] at {a:g} m: give "
                    "points of rising x"
                )
        span = self.profile[-1][0] - self.profile[0][0] if self.profile else 0.0
        if span > MAX_SPAN:
            advise(f"profile spans {span:g} m, more than {MAX_SPAN:g} m: {ADVICE}")
        place, steepest = self.steepest
        if self.profile is not None and steepest > math.tan(math.radians(MAX_SLOPE)):
            raise ValueError(
                f"profile slopes by {math.degrees(math.atan(steepest)):.3g}° near x = {place:.4g} "
                f"m: at most {MAX_SLOPE:g}°; place the points further apart in x"
            )

    @property
    def is_even(self) -> bool:
        """True for an even slope, False for a profile."""
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

        Raises
        ------
        ValueError
            For anything but finite numbers.
        """
        t, c = self._piece(numbers("x", x, finite=True))
        return np.asarray(((c[0] * t + c[1]) * t + c[2]) * t + c[3])

    @property
    def steepest(self) -> tuple[float, float]:
        """Steepest place x [m], and |dy/dx| there."""
        knots, inner = self.curve.knots, self.curve.pieces[1:-1]
        # the slope is largest at a knot or where a piece has no curvature
        with np.errstate(all="ignore"):  # division by zero: a piece of constant curvature
            inflection = -inner[:, 1] / (3.0 * inner[:, 0])
        is_inside = (inflection > 0.0) & (inflection < np.diff(knots))
        places = np.concatenate([knots, knots[:-1] + np.where(is_inside, inflection, 0.0)])
        t, c = self._piece(places)
        steepness = np.abs((3.0 * c[0] * t + 2.0 * c[1]) * t + c[2])
        largest = int(np.argmax(steepness))
        return float(places[largest]), float(steepness[largest])

    def curvature(self, sign: float) -> tuple[float, float]:
        """Return the place of the largest curvature of one sign, and the curvature there.

        Parameters
        ----------
        sign
            1 for hollows, -1 for crests.

        Returns
        -------
        tuple of float
            Place x [m], and |d²y/dx²| there [1/m]; 0 if there is no curvature of this sign.
        """
        knots = self.curve.knots  # the curvature is linear between them
        t, c = self._piece(knots)
        curvatures = sign * (6.0 * c[0] * t + 2.0 * c[1])
        largest = int(np.argmax(curvatures))
        return float(knots[largest]), max(float(curvatures[largest]), 0.0)

    def rise_and_tilt(self, spacing: ArrayLike, thickness: ArrayLike) -> tuple[Floats, Floats]:
        """Return rise and tilt of layouts on the ground.

        Parameters
        ----------
        spacing
            (N-1,) or (B, N-1) free gaps [m].
        thickness
            (N,) or (B, N) thicknesses [m].

        Returns
        -------
        tuple of ndarray
            `rise` (…, N-1) [m] and `tilt` (…, N) [rad], as of a `Layout`.

        Raises
        ------
        ValueError
            For sizes of other shapes or out of range, and for ground that deviates by more than
            0.1 mm from the chord under a base.
        """
        gaps = np.atleast_1d(numbers("spacing", spacing))
        if gaps.ndim > 2:
            raise ValueError(f"spacing has shape {gaps.shape}: give (N-1,) or (B, N-1)")
        shape = (*gaps.shape[:-1], gaps.shape[-1] + 1)
        thicknesses = numbers("thickness", thickness, True, shape, "one more than gaps")
        for name, sizes in (("spacing", gaps), ("thickness", thicknesses)):
            # these comparisons take less time than `require`, which makes the message
            if sizes.size and not 0.0 < sizes.min() <= sizes.max() <= MAX_SIZE:
                require(name, sizes, above=0.0, high=MAX_SIZE, unit="m", array=True)
        if self.slope is not None:
            slope = math.radians(self.slope)
            rise = -math.sin(slope) * (gaps + thicknesses[..., 1:])
            return rise, np.full_like(thicknesses, slope)
        if violation := self.violation(float(thicknesses.max(initial=0.0))):
            raise ValueError(violation)
        arrays = _batch(gaps), _batch(thicknesses)
        rise, tilt = (np.empty(array.shape) for array in arrays)
        size = len(tilt), thicknesses.shape[-1]
        share_pieces(place_on_ground, *size, self.curve, *arrays, rise, tilt)
        return rise.reshape(gaps.shape), tilt.reshape(thicknesses.shape)

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
            Layout with the ground's rise and tilt.

        Raises
        ------
        ValueError
            As for `rise_and_tilt` and `Layout`.
        """
        gaps = np.atleast_1d(numbers("spacing", spacing))
        thicknesses = full_array("thickness", thickness, len(gaps) + 1)
        rise, tilt = self.rise_and_tilt(gaps, thicknesses)
        return Layout(gaps, thicknesses, height, width, density, rise, tilt)

    def violation(self, thickness: float) -> str | None:
        """Return a sentence if the ground is too curved for a base somewhere, else None.

        Parameters
        ----------
        thickness
            Length of the base [m].

        Returns
        -------
        str or None
            Sentence with place, deviation, accepted range and next action.
        """
        for sign, verb in ((1.0, "is hollow"), (-1.0, "bulges")):
            place, curvature = self.curvature(sign)
            # height of an arc over its chord on level ground; on a slope it is smaller
            deviation = curvature * thickness**2 / 8.0
            if deviation > MAX_DEVIATION:
                return (
                    f"the ground {verb} by {1e3 * deviation:.3g} mm under a base "
                    f"{1e3 * thickness:.4g} mm thick near x = {place:.4g} m: at most "
                    f"{1e3 * MAX_DEVIATION:g} mm; make it more even there or the dominoes thinner"
                )
        return None

    def along_ground(self, gradient: Gradient, layout: Any) -> Gradient:
        """Convert a gradient at fixed rise and tilt to one for dominoes that move along the ground.

        If a gap or a thickness changes, all later dominoes move along the ground, and their rise
        and tilt change with them.

        Parameters
        ----------
        gradient
            Gradient of one layout, as from `Wave.gradient`, or of a batch.
        layout
            That layout or batch, with `spacing`, `thickness`, `rise` and `tilt`.

        Returns
        -------
        Gradient
            Derivatives along the ground, without rise and tilt.

        Raises
        ------
        TypeError
            For anything but a Gradient.
        ValueError
            For a layout with another number of dominoes than the gradient.
        """
        require_type("gradient", gradient, Gradient, "a Gradient, such as wave.gradient()")
        if gradient.rise is None or gradient.tilt is None:
            return gradient  # on flat ground nothing changes
        pairs = np.shape(gradient.spacing)
        shapes = pairs, (*pairs[:-1], pairs[-1] + 1)
        for name, shape in zip(("spacing", "thickness", "rise", "tilt"), 2 * shapes, strict=True):
            numbers(f"gradient.{name}", getattr(gradient, name), None, shape, "as of a layout")
            # nan: a number, whose shape () is rejected
            value = getattr(layout, name, np.nan)
            numbers(f"layout.{name}", value, None, shape, "that of the gradient")
        spacing, thickness = gradient.spacing.copy(), gradient.thickness.copy()
        if self.slope is not None:
            through_rise = -math.sin(math.radians(self.slope)) * gradient.rise
            spacing += through_rise
            thickness[..., 1:] += through_rise
        else:
            geometry = layout.spacing, layout.thickness, layout.rise, layout.tilt
            arrays = [_batch(array) for array in (*geometry, gradient.rise, gradient.tilt)]
            # views, to which the kernel adds the derivatives through rise and tilt
            written = [np.atleast_2d(array) for array in (spacing, thickness)]
            share_pieces(place_on_ground_vjp, *arrays[1].shape, self.curve, *arrays, *written)
        return replace(gradient, spacing=spacing, thickness=thickness, rise=None, tilt=None)

    @cached_property
    def curve(self) -> Curve:
        """Piecewise cubic of the ground, for the kernels."""
        if self.profile is None:
            rate = -math.tan(math.radians(self.slope or 0.0))  # dy/dx
            x, pieces = np.zeros(1), np.full((2, 4), [0.0, 0.0, rate, 0.0])
        else:
            from scipy.interpolate import CubicSpline

            x, y = np.array(self.profile).T
            spline = CubicSpline(x, y, bc_type="natural")
            ends = [[0.0, 0.0, float(spline(x[k], 1)), y[k]] for k in (0, -1)]
            pieces = np.concatenate([ends[:1], spline.c.T, ends[1:]])
        starts = np.concatenate([x[:1], x])
        return Curve(*(read_only(array) for array in (x, starts, pieces)))

    def _piece(self, x: Floats) -> tuple[Floats, Floats]:
        """Return distances (…) of x from the starts of its pieces, and coefficients (4, …)."""
        k = np.searchsorted(self.curve.knots, x)
        return x - self.curve.starts[k], np.moveaxis(self.curve.pieces[k], -1, 0)


def _batch(array: ArrayLike) -> Floats:
    """Return a read-only view with a batch axis, for which the kernels are compiled."""
    return read_only(np.atleast_2d(array))
