"""Scene distributions: files of scenes with ranges, from which scenes are sampled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from domino_env.core import checks
from domino_env.core.files import errors_with_path
from domino_env.core.types import Floats
from domino_env.physics.physics import Physics
from domino_env.physics.standard import HEIGHT
from domino_env.scenes.io.ranges import (
    COUNT,
    PUSH,
    Place,
    entries,
    fill_in,
    has_ranges,
    read_ranges,
)
from domino_env.scenes.io.reading import read_named, scene_from_document
from domino_env.scenes.scene import Scene
from domino_env.scenes.tables import format_toml
from domino_env.scenes.uniform import grid
from domino_env.scenes.uniform_layouts import UniformLayouts

# numbers of gaps and thicknesses of the uniform layouts that are tried in a sampled scene
COARSE_GRID, COARSE_GRID_WITH_THICKNESS = (48, 1), (24, 6)
MAX_SAMPLES = 1_000  # rejected scenes after which sampling fails


class SceneDistribution:
    """Distribution of scenes: the file of a scene with ranges in place of some numbers.

    Numbers are sampled in the order of the file, but all lower bounds `min` first. A scene is
    sampled again if its tables contradict each other, such as by a length that its dominoes cannot
    cover, and if none of a few uniform layouts scores more than 0, as no gain is defined then.

    Parameters
    ----------
    document
        Tables of the file, as `tomllib` reads them.
    name
        Name of the distribution if the document has none.
    file
        Name of the file in error messages; by default `name`.

    Attributes
    ----------
    name, title
        As in `Scene`.
    document
        Tables of the file, without the name.
    ranges
        Ranges of the V sampled numbers, by table and key of the file.
    features
        Names of the sampled numbers, such as "friction" and "spacing min".
    first
        Scene sampled with seed 0.
    file
        Name of the file in error messages.

    Raises
    ------
    ValueError
        For invalid ranges, for a file without ranges, and if no scene could be sampled.

    Examples
    --------
    >>> import numpy as np
    >>> import domino_env as de
    >>> scene = de.load_distribution("varied").sample(np.random.default_rng(0))
    """

    def __init__(self, document: dict[str, Any], name: str, file: str | None = None) -> None:
        checks.require_type("document", document, dict, "tables, as load_distribution reads them")
        self.file = file or name
        with errors_with_path(self.file):
            self.ranges = read_ranges(document)
            if not self.ranges:
                raise ValueError("it is one scene, without a range: load it by load_scene")
        self.name = str(document.get("name", name))
        self.title = str(document.get("title", self.name))
        self.document = {key: value for key, value in document.items() if key != "name"}
        self.features = tuple(
            key if table in ("row", "physics") else f"{table} {key}" for table, key in self.ranges
        )
        self.first = self.sample(0)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, SceneDistribution):
            return NotImplemented
        return (self.name, self.document) == (other.name, other.document)

    def __hash__(self) -> int:
        return hash((self.name, tuple(self.ranges.items())))

    def __repr__(self) -> str:
        return f"SceneDistribution('{self.name}': {', '.join(self.features)})"

    def to_toml(self) -> str:
        """Return the text of the distribution's file.

        Returns
        -------
        str
            TOML that `load_distribution` reads as the same distribution.
        """
        return format_toml(self.document | {"name": self.name})

    def sample(self, rng: np.random.Generator | int, name: str = "sampled") -> Scene:
        """Sample a scene.

        Parameters
        ----------
        rng
            Source of randomness, or its seed.
        name
            Name of the scene.

        Returns
        -------
        Scene
            A scene in which some uniform layout scores more than 0.

        Raises
        ------
        ValueError
            For an invalid seed, and if none of 1000 sampled scenes can be used.
        """
        return self.scene(self.sample_numbers(rng), name)

    def sample_numbers(self, rng: np.random.Generator | int, digits: int | None = None) -> Floats:
        """Sample the numbers (V,) of a scene in which some uniform layout scores more than 0.

        Parameters
        ----------
        rng
            Source of randomness, or its seed.
        digits
            Number of significant digits to which the numbers are rounded; None for no rounding.

        Returns
        -------
        NDArray
            (V,) numbers, in the units of their ranges.

        Raises
        ------
        ValueError
            For an invalid seed, and if none of 1000 sampled scenes can be used.
        """
        if not isinstance(rng, np.random.Generator):
            checks.require("rng", rng, 0, whole=True, hint="a seed; or a numpy.random.Generator")
        rng, reason = np.random.default_rng(rng), "no uniform layout scores more than 0"
        for _ in range(MAX_SAMPLES):
            numbers = self._sample_once(rng)
            if digits is not None:
                ends = np.array([(r.min, r.max) for r in self.ranges.values()]).T
                numbers = np.clip([float(f"{x:.{digits}g}") for x in numbers], *ends)
            try:
                scene = self.scene(numbers)
            except ValueError as error:
                reason = str(error)
                continue
            if _some_uniform_succeeds(scene):
                return numbers
        raise ValueError(
            f"{self.file}: none of {MAX_SAMPLES:,} scenes can be used ({reason}): change the ranges"
        )

    def _sample_once(self, rng: np.random.Generator) -> Floats:
        """Sample numbers (V,) of a scene that may be invalid."""
        numbers: dict[Place, float] = {}
        # lower bounds come first, as `min_ratio` of an upper bound refers to them
        for place in sorted(self.ranges, key=lambda place: place[1] != "min"):
            sampled = self.ranges[place]
            low, high = sampled.min, sampled.max
            if sampled.min_ratio is not None:
                least = numbers.get((place[0], "min"), self.document[place[0]]["min"])
                low = max(low, sampled.min_ratio * least)
            # a count is rounded down, so that the largest is as likely as the others
            end = high + 1 if place == COUNT else high
            if sampled.spread == "log":
                value = float(np.exp(rng.uniform(*np.log((low, end)))))
            else:
                value = float(rng.uniform(low, end))
            numbers[place] = float(min(np.floor(value), high)) if place == COUNT else value
        return np.array([numbers[place] for place in self.ranges])

    def scene(self, numbers: Floats, name: str = "sampled") -> Scene:
        """Return the scene with given numbers in place of the ranges.

        Parameters
        ----------
        numbers
            (V,) numbers, in the units of their ranges.
        name
            Name of the scene.

        Returns
        -------
        Scene
            The scene.

        Raises
        ------
        ValueError
            For an array of another shape, numbers that are not finite, and if the scene with these
            numbers is not valid.
        """
        numbers = checks.numbers("numbers", numbers, None, (len(self.ranges),), repr(self), True)
        sampled = dict(zip(self.ranges, numbers.tolist(), strict=True))
        row, physics = (self.document.get(table, {}) for table in ("row", "physics"))
        units = self._units(
            sampled.get(("row", "height"), row.get("height", HEIGHT)),
            sampled.get(("physics", "gravity"), physics.get("gravity", Physics().gravity)),
        )
        values = {place: value * units.get(place, 1.0) for place, value in sampled.items()}
        document = fill_in(self.document, values) | {"name": name, "title": self.title}
        return scene_from_document(document, name, self.file)

    def _units(self, height: float, gravity: float) -> dict[Place, float]:
        """Return the units of the numbers that are given in heights [m], [rad/s] for the push."""
        return {
            place: float(np.sqrt(gravity / height)) if place == PUSH else height
            for place, sampled in self.ranges.items()
            if sampled.of is not None
        }

    def numbers(self, scene: Scene) -> Floats:
        """Return the sampled numbers of a scene of this distribution.

        Parameters
        ----------
        scene
            The scene.

        Returns
        -------
        NDArray
            (V,) numbers, in the units of their ranges.

        Raises
        ------
        TypeError
            For anything but a scene.
        ValueError
            For a scene that differs from the sampled ones in more than the sampled numbers.
        """
        checks.require_type("scene", scene, Scene, "a Scene of this distribution")
        tables = _with_entries(scene.document())
        units = self._units(scene.height, scene.physics.gravity)
        missing = any(key not in tables.get(table, ()) for table, key in self.ranges)
        if missing or self._fixed_part(tables) != self._fixed_part(
            _with_entries(self.first.document())
        ):
            raise ValueError(
                f"scene '{scene.name}' differs from those of '{self.name}' in more than "
                f"{', '.join(self.features)}: give one that differs in these alone"
            )
        return np.array([tables[t][k] / units.get((t, k), 1.0) for t, k in self.ranges], np.float64)

    def _fixed_part(self, tables: dict[str, Any]) -> dict[str, Any]:
        """Return the tables without sampled numbers, name and title."""
        kept = {
            name: {k: v for k, v in table.items() if (name, k) not in self.ranges}
            for name, table in tables.items()
            if isinstance(table, dict)
        }
        if "first_thickness" not in self.document.get("row", {}):
            kept["row"].pop("first_thickness")  # it follows from the other thicknesses
        return kept | {"objective": tables["objective"]}

    def scale(self, numbers: Floats) -> Floats:
        """Scale numbers so that each range becomes -1 to 1.

        Parameters
        ----------
        numbers
            (…, V) numbers, in the units of their ranges.

        Returns
        -------
        NDArray
            (…, V) scaled numbers, linear in the logarithm of the number if the spread is "log"; 0
            for a range of one value.

        Raises
        ------
        ValueError
            For an array of another shape.
        """
        shape = (*np.shape(numbers)[:-1], len(self.ranges))
        values = checks.numbers("numbers", numbers, None, shape, repr(self))
        scaled = np.zeros(values.shape)
        for v, sampled in enumerate(self.ranges.values()):
            low, high, x = sampled.min, sampled.max, values[..., v]
            if sampled.spread == "log":
                # 1e-300: the logarithm of 0 is not finite
                low, high, x = np.log(low), np.log(high), np.log(np.maximum(x, 1e-300))
            if low < high:
                scaled[..., v] = 2.0 * (x - low) / (high - low) - 1.0
        return scaled


def _with_entries(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document with the values of lists in tables as keys of their own."""
    return {name: entries(x) if isinstance(x, dict) else x for name, x in document.items()}


def _some_uniform_succeeds(scene: Scene) -> bool:
    """Return True if one of a few uniform layouts scores more than 0."""
    layouts = UniformLayouts(scene)
    numbers = COARSE_GRID_WITH_THICKNESS if layouts.low[1] < layouts.high[1] else COARSE_GRID
    # a relative tolerance of 1e-5 suffices for the sign of a score
    return bool(layouts.scores(grid(layouts.axes(numbers, np.geomspace)), 1e-5).max() > 0.0)


def load_distribution(name: str | Path) -> SceneDistribution:
    """Load a scene distribution.

    Parameters
    ----------
    name
        Name of a shipped distribution, or path of a TOML file.

    Returns
    -------
    SceneDistribution
        The distribution.

    Raises
    ------
    TypeError
        For anything but a string or a path.
    ValueError
        For a file that cannot be read, for invalid tables, with key, value and accepted range, and
        for a file without ranges, which `load_scene` reads.
    """
    return SceneDistribution(*read_named(name))


def load_any(name: str | Path) -> Scene | SceneDistribution:
    """Load a scene or a scene distribution, by name or path."""
    document, stem, file = read_named(name)
    read = SceneDistribution if has_ranges(document) else scene_from_document
    return read(document, stem, file)
