"""Layout of a chain: geometry in SI units, checked when it is made."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.checks import as_path, numbers, require
from domino_env.core.files import errors_with_path
from domino_env.core.lazy import Lazy
from domino_env.core.results import draw
from domino_env.core.types import Floats, read_only
from domino_env.physics import files, footing, standard
from domino_env.physics.standard import DENSITY, HEIGHT, THICKNESS, WIDTH

MAX_DOMINOES = 1_000_000  # of a uniform layout


@dataclass(frozen=True, eq=False)
class Layout(Lazy):
    """Geometry of a chain of N dominoes that topples towards +x.

    Parameters
    ----------
    spacing
        (N-1,) free gaps between the front of each domino and the back of the next [m].
    thickness
        Scalar or (N,) size along the chain [m].
    height
        Scalar or (N,) [m]; by default 0.048, that of the standard domino.
    width
        Size across the chain [m]; times do not depend on it. By default 0.024.
    density
        Scalar or (N,) [kg/m³]; by default 1040.
    rise
        Scalar or (N-1,) height of the next pivot above this one [m]; by default 0.
    tilt
        Scalar or (N,) slope of the ground under each domino, positive downhill [rad]; by default 0.

    Attributes
    ----------
    is_flat
        True if rise and tilt are 0.

    Raises
    ------
    ValueError
        For shapes that do not match, values out of range, a tip that would strike above the next
        domino's top, and ground that is too steep or too uneven. The message has the index, the
        value and the next action.

    Notes
    -----
    Every array is kept as a read-only float64 copy of full length. On uneven ground a gap is
    measured from a pivot, perpendicular to the back face of the next domino, which is along the
    ground on an even slope.

    Examples
    --------
    >>> from domino_env import Layout
    >>> layout = Layout([0.012, 0.014], [0.0075, 0.0075, 0.010])
    >>> layout.pitch.round(4), round(layout.length, 4)
    (array([0.0195, 0.024 ]), 0.0435)
    """

    spacing: Floats
    thickness: Floats
    height: Floats
    width: float
    density: Floats
    rise: Floats
    tilt: Floats
    is_flat: bool = field(init=False)

    def __init__(
        self,
        spacing: ArrayLike,
        thickness: ArrayLike,
        height: ArrayLike = HEIGHT,
        width: float = WIDTH,
        density: ArrayLike = DENSITY,
        rise: ArrayLike = 0.0,
        tilt: ArrayLike = 0.0,
    ) -> None:
        gaps = numbers("spacing", spacing, shape=("N-1",), meaning="one gap per pair")
        count = len(gaps) + 1
        arrays = {
            "spacing": gaps,
            "thickness": full_array("thickness", thickness, count),
            "height": full_array("height", height, count),
            "density": full_array("density", density, count),
        }
        require_sizes(arrays)
        require("width", width, above=0.0, unit="m")
        arrays["rise"] = full_array("rise", rise, count - 1)
        arrays["tilt"] = full_array("tilt", tilt, count)
        for array in arrays.values():
            array.flags.writeable = False
        is_flat = not (np.count_nonzero(arrays["rise"]) or np.count_nonzero(arrays["tilt"]))
        self.__dict__.update(arrays, width=float(width), is_flat=is_flat)
        violation = footing.find_violation(gaps, self.thickness, self.height, *self.rise_and_tilt)
        if violation is not None:
            raise ValueError("; ".join(filter(None, (self.unit_hint, violation[1]))))

    @property
    def rise_and_tilt(self) -> tuple[Floats, ...]:
        """Rise (N-1,) [m] and tilt (N,) [rad]; an empty tuple on flat ground."""
        return () if self.is_flat else (self.rise, self.tilt)

    def __reduce__(self) -> tuple[object, ...]:
        # `__init__` makes the arrays of a copy read-only, for which the kernels are compiled
        sizes = self.spacing, self.thickness, self.height, self.width, self.density
        return Layout, (*sizes, *self.rise_and_tilt)

    def __eq__(self, other: object) -> bool:
        """Return True if all numbers of both layouts are equal."""
        if not isinstance(other, Layout):
            return NotImplemented
        return self.width == other.width and all(
            np.array_equal(getattr(self, name), getattr(other, name))
            for name in ("spacing", "thickness", "height", "density", "rise", "tilt")
        )

    def __hash__(self) -> int:
        return hash((self.spacing.tobytes(), self.thickness.tobytes(), self.height.tobytes()))

    def __repr__(self) -> str:
        chain = f"{self.count} domino" + ("es" if self.count != 1 else "")
        sizes = [f"{_span(self.thickness)} mm thick", f"{_span(self.height)} mm high"]
        if self.count > 1:
            chain += f" over {round(self.length, 4):g} m"
            sizes.insert(0, f"gaps {_span(self.spacing)} mm")
        if not self.is_flat:
            sizes.append(f"ground sloping {_span(np.degrees(self.tilt), 1.0)}°")
        return f"Layout({chain}: {', '.join(sizes)})"

    def _repr_png_(self) -> Any:
        # False: not a figure of pyplot
        return draw("layout", self, None, False)._repr_png_()

    @classmethod
    def uniform(
        cls,
        count: int,
        *,
        pitch: float | None = None,
        spacing: float | None = None,
        thickness: float = THICKNESS,
        height: float = HEIGHT,
        width: float = WIDTH,
        density: float = DENSITY,
        slope: float = 0.0,
    ) -> Layout:
        """Return a layout of equal dominoes with equal gaps.

        Parameters
        ----------
        count
            Number of dominoes N, 1 to 1 000 000.
        pitch
            Distance from pivot to pivot [m]; give either this or `spacing`.
        spacing
            Free gap [m].
        thickness
            Thickness of every domino [m]; by default 0.0075.
        height
            Height of every domino [m]; by default 0.048.
        width
            Size across the chain [m]; by default 0.024.
        density
            Density of every domino [kg/m³]; by default 1040.
        slope
            Even slope of the ground, positive downhill [rad].

        Returns
        -------
        Layout
            Layout of `count` dominoes.

        Raises
        ------
        ValueError
            For neither or both of pitch and spacing, dominoes that overlap, and as for the class.
        """
        require("count", count, 1, MAX_DOMINOES, whole=True)
        if (pitch is None) == (spacing is None):
            raise ValueError(f"{pitch=}, {spacing=}: give either pitch or spacing (the gap) in m")
        require("thickness", thickness, above=0.0, unit="m")
        require("slope", slope, -0.5 * math.pi, 0.5 * math.pi, "rad")
        if pitch is not None:
            require("pitch", pitch, above=thickness, unit="m", hint="the thickness")
            spacing = pitch - thickness
        require("spacing", spacing, above=0.0, unit="m")
        gap = float(spacing)  # type: ignore[arg-type]
        gaps, rise = np.full(count - 1, gap), -(gap + thickness) * np.sin(slope)
        return cls(gaps, np.full(count, thickness), height, width, density, rise, slope)

    @property
    def count(self) -> int:
        """Number of dominoes N."""
        return len(self.thickness)

    @cached_property
    def pitch(self) -> Floats:
        """Distances from pivot to pivot (N-1,) [m]."""
        return read_only(footing.pitches(self.spacing, self.thickness, *self.rise_and_tilt))

    @cached_property
    def positions(self) -> Floats:
        """Positions of the pivots along the line through them (N,), the first at 0 [m]."""
        return read_only(np.concatenate(([0.0], np.cumsum(self.pitch))))

    @property
    def pivots(self) -> Floats:
        """Coordinates of the pivots (N, 2), x forward and z up, the first at 0 [m]."""
        if self.is_flat:
            return np.stack([self.positions, np.zeros(self.count)], axis=-1)
        return footing.pivots(self.spacing, self.thickness, self.rise, self.tilt)

    @property
    def length(self) -> float:
        """Distance from the first to the last pivot [m]."""
        return float(self.positions[-1])

    def plot(self, ax: Any = None) -> Any:
        """Draw the layout to scale, and its gaps along it.

        Parameters
        ----------
        ax
            Matplotlib axes in which only the gaps are drawn; None for a new figure.

        Returns
        -------
        matplotlib.figure.Figure
            The figure; notebooks show it, and `pyplot.show` does if pyplot is imported.
        """
        return draw("layout", self, ax)

    def to_csv(self, path: str | Path) -> None:
        """Write one line per domino in SI units; the last spacing is empty.

        On uneven ground there are two more columns: rise [m] and tilt [rad].

        Parameters
        ----------
        path
            The file, which is replaced atomically.

        Raises
        ------
        TypeError, ValueError
            For anything but a path, and a name that no file can have.
        OSError
            If the file cannot be written.
        """
        files.write_csv(as_path("path", path), self._columns())

    def to_json(self, path: str | Path) -> None:
        """Write every array in full, in SI units.

        Parameters
        ----------
        path
            The file, which is replaced atomically.

        Raises
        ------
        TypeError, ValueError, OSError
            As for `to_csv`.
        """
        files.write_json(as_path("path", path), self._columns())

    def _columns(self) -> dict[str, Any]:
        names = ["spacing", "thickness", "height", "width", "density"]
        names += [] if self.is_flat else ["rise", "tilt"]
        return {name: getattr(self, name) for name in names}

    @classmethod
    def read(cls, path: str | Path, width: float = WIDTH) -> Layout:
        """Read a layout from a `.csv` or `.json` file.

        Lengths that were probably given in another unit cause a warning.

        Parameters
        ----------
        path
            The file, in a format that `domino_env.physics.files.read_arguments` explains.
        width
            Size across the chain if the file does not give it [m]; by default 0.024.

        Returns
        -------
        Layout
            The layout of the file.

        Raises
        ------
        TypeError
            For anything but a path.
        ValueError
            For a missing file, another suffix, errors in the file (with line and column, or key),
            and as for `Layout`.
        OSError
            If the file cannot be read.
        """
        file = as_path("path", path)
        with errors_with_path(file):
            layout = cls(**{"width": width} | files.read_arguments(file))
        if layout.count > 1:
            standard.advise_on_units(path, *layout._sizes)
        return layout

    @property
    def unit_hint(self) -> str | None:
        """Sentence about lengths that were probably given in another unit, or None."""
        return None if self.count == 1 else standard.unit_hint(*self._sizes)

    @property
    def _sizes(self) -> tuple[float, tuple[float, float], tuple[float, float]]:
        """Largest height, smallest and largest gap, smallest and largest thickness [m]."""
        gaps, sizes = ((float(a.min()), float(a.max())) for a in (self.spacing, self.thickness))
        return float(self.height.max()), gaps, sizes


def _span(values: Floats, factor: float = 1e3) -> str:
    """Format values times a factor, by default from m to mm: one number, or the range."""
    low, high = (f"{factor * value:.4g}" for value in (values.min(), values.max()))
    return low if low == high else f"{low} to {high}"


def require_sizes(sizes: dict[str, Floats]) -> None:
    """Raise a ValueError for sizes [m] or densities [kg/m³] that are not finite and positive."""
    for name, values in sizes.items():
        # these comparisons take less time than `require`, which makes the message
        if values.size and not 0.0 < values.min() <= values.max() < np.inf:
            unit = "kg/m³" if name == "density" else "m"
            require(name, values, above=0.0, unit=unit, array=True)


def full_array(name: str, values: ArrayLike, count: int) -> Floats:
    """Return an array (count,) from one number or `count`; raise a ValueError for other shapes."""
    array = numbers(name, values)
    if array.ndim == 0:
        full = np.empty(count)  # takes half the time of np.full
        full.fill(array)
        return full
    return numbers(name, array, None, (count,), "or one number for all")
