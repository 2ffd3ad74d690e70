"""SceneDistribution: a scene's file with ranges, from which scenes are drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from domino_env.core.files import naming, refuse
from domino_env.core.types import Floats
from domino_env.physics.physics import Physics
from domino_env.physics.standard import HEIGHT
from domino_env.scenes.io.ranges import (
    COUNT,
    PUSH,
    Place,
    filled,
    has_ranges,
    ranges_of,
)
from domino_env.scenes.io.reading import (
    distribution_names,
    read_named,
    scene_names,
    scene_of_document,
)
from domino_env.scenes.scene import Scene
from domino_env.scenes.specification import Specification
from domino_env.scenes.tables import text_of
from domino_env.scenes.uniform import grid
from domino_env.scenes.uniform_layouts import UniformLayouts

IS_SCENE = "it is one scene, none of its numbers is a range: load it by load_scene"
NAMES: dict[Place, str] = {
    PUSH: "push",
    COUNT: "count",
    ("physics", "friction"): "friction",
    ("physics", "gravity"): "gravity",
    ("row", "height"): "height",
    ("row", "length"): "length",
    ("row", "first_thickness"): "first thickness",
    ("spacing", "min"): "least gap",
    ("spacing", "max"): "largest gap",
    ("spacing", "fixed"): "gap",
    ("thickness", "min"): "least thickness",
    ("thickness", "max"): "largest thickness",
    ("thickness", "fixed"): "thickness",
}
TRIED, TRIED_THICK = (48, 1), (24, 6)  # uniform rows that tell whether any runs through
MOST_DRAWN = 1_000  # scenes without a running row in a sequence: then there are none


class SceneDistribution:
    """Scenes drawn at random: a scene's file with ranges where it has numbers.

    Numbers are drawn in the order of the file, the bounds called min before all others. A scene
    that breaks what the tables of a file owe each other, such as a length that its dominoes cannot
    cover, is drawn anew, and so is one in which no uniform row runs through: it has nothing to be
    measured against.

    Parameters
    ----------
    document
        The tables of the file, as `tomllib` reads them.
    name
        What it is called unless the document says it.
    file
        What errors call it.

    Attributes
    ----------
    name, title
        As of a scene.
    ranges
        What is drawn, by table and key of the file.
    features
        Names of what is drawn, such as "least gap".

    Raises
    ------
    ValueError
        For ranges that are none, and where no scene could be drawn.
    """

    def __init__(self, document: dict[str, Any], name: str, file: str | None = None) -> None:
        self.file = file or name
        with naming(self.file):
            self.ranges = ranges_of(document)
            if not self.ranges:
                raise ValueError(IS_SCENE)
        self.name = str(document.get("name", name))
        self.title = str(document.get("title", self.name))
        self.document = {key: value for key, value in document.items() if key != "name"}
        self.features = tuple(NAMES.get(place, ".".join(place)) for place in self.ranges)
        self.first = self.sample(np.random.default_rng(0))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, SceneDistribution):
            return NotImplemented
        return (self.name, self.document) == (other.name, other.document)

    def __hash__(self) -> int:
        return hash((self.name, tuple(self.ranges.items())))

    def __repr__(self) -> str:
        return f"SceneDistribution('{self.name}': {', '.join(self.features)})"

    def to_toml(self) -> str:
        """Write the text of a file that reads back as the same distribution."""
        return text_of(self.document | {"name": self.name})

    # drawing --------------------------------------------------------------------------------------

    def sample(self, rng: np.random.Generator, name: str = "drawn") -> Scene:
        """Draw a scene.

        Parameters
        ----------
        rng
            What it is drawn with.
        name
            What it is called.
        """
        return self.scene(self.draw(rng), name)

    def draw(self, rng: np.random.Generator, digits: int | None = None) -> Floats:
        """Draw the numbers (V,) of a scene in which some uniform row runs through.

        Parameters
        ----------
        rng
            What they are drawn with.
        digits
            To how many significant digits they are rounded; None for not.
        """
        refused = "no uniform row runs through any of them"
        for _ in range(MOST_DRAWN):
            numbers = self._any(rng)
            if digits is not None:
                ends = np.array([(drawn.min, drawn.max) for drawn in self.ranges.values()]).T
                numbers = np.clip([float(f"{x:.{digits}g}") for x in numbers], *ends)
            try:
                scene = self.scene(numbers)
            except ValueError as error:
                refused = str(error)
                continue
            if some_row_runs(scene):
                return numbers
        raise ValueError(
            f"{self.file}: of {MOST_DRAWN:,} scenes drawn none can be used; of the last: {refused}"
        )

    def _any(self, rng: np.random.Generator) -> Floats:
        numbers: dict[Place, float] = {}
        # what others may have to lie apart from comes first
        for place in sorted(self.ranges, key=lambda place: place[1] != "min"):
            drawn = self.ranges[place]
            low, high = drawn.min, drawn.max
            if drawn.apart is not None:
                table = place[0]
                least = numbers.get((table, "min"), self.document[table]["min"])
                low = max(low, drawn.apart * least)
            end = high + 1 if place == COUNT else high
            if drawn.spread == "log":
                value = float(np.exp(rng.uniform(*np.log((low, end)))))
            else:
                value = float(rng.uniform(low, end))
            if place == COUNT:
                value = float(min(np.floor(value), high))
            numbers[place] = value
        return np.array([numbers[place] for place in self.ranges])

    def scene(self, numbers: Floats, name: str = "drawn") -> Scene:
        """Make the scene of these numbers (V,), in the units of their ranges.

        Raises
        ------
        ValueError
            For numbers that no scene has.
        """
        drawn = dict(zip(self.ranges, map(float, numbers), strict=True))
        held = filled(self.document, drawn)
        units = self._units(
            held.get("row", {}).get("height", HEIGHT),
            held.get("physics", {}).get("gravity", Physics().gravity),
        )
        values = {place: value * units.get(place, 1.0) for place, value in drawn.items()}
        document = filled(held, values) | {"name": name, "title": self.title}
        return scene_of_document(document, name, self.file)

    def _units(self, height: float, gravity: float) -> dict[Place, float]:
        """Return what numbers in heights are multiplied by, to be in SI units."""
        return {
            place: float(np.sqrt(gravity / height)) if place == PUSH else height
            for place, drawn in self.ranges.items()
            if drawn.of is not None
        }

    # what was drawn -------------------------------------------------------------------------------

    def numbers(self, scene: Specification) -> Floats:
        """Read the numbers (V,) off a scene of this kind, in the units of their ranges.

        Raises
        ------
        ValueError
            For a scene that differs from those that are drawn in more than these numbers.
        """
        tables = scene.document()
        units = self._units(scene.height, scene.physics.gravity)
        try:
            found = np.array(
                [tables[t][k] / units.get((t, k), 1.0) for t, k in self.ranges], dtype=np.float64
            )
        except KeyError:
            self._refuse(scene)
        mine, theirs = self._fixed_part(self.first.document()), self._fixed_part(tables)
        if mine != theirs:
            self._refuse(scene)
        return found

    def _fixed_part(self, tables: dict[str, Any]) -> dict[str, Any]:
        kept = {
            name: {k: v for k, v in table.items() if (name, k) not in self.ranges}
            for name, table in tables.items()
            if isinstance(table, dict)
        }
        if "first_thickness" not in self.document.get("row", {}):
            kept["row"].pop("first_thickness")  # it is the thickness of all
        return kept | {"objective": tables["objective"]}

    def _refuse(self, scene: Specification) -> None:
        raise ValueError(
            f"scene '{scene.name}' differs from those of '{self.name}' in more than "
            f"{', '.join(self.features)}: give one that differs in these alone"
        )

    def scaled(self, numbers: Floats) -> Floats:
        """Scale numbers (…, V): -1 at the least, 1 at the largest value of each range.

        In the logarithm where they are spread so; 0 where nothing varies.
        """
        values = np.asarray(numbers, dtype=np.float64)
        found = np.zeros(values.shape)
        for v, drawn in enumerate(self.ranges.values()):
            low, high, x = drawn.min, drawn.max, values[..., v]
            if drawn.spread == "log":
                low, high, x = np.log(low), np.log(high), np.log(np.maximum(x, 1e-300))
            if low < high:
                found[..., v] = 2.0 * (x - low) / (high - low) - 1.0
        return found

    def outside(self, scene: Specification) -> tuple[str, ...]:
        """Say in what a scene differs from all that are drawn; empty if in nothing."""
        return tuple(
            f"{name} {value:.4g} is outside {drawn.min:.4g} to {drawn.max:.4g}"
            for name, value, drawn in zip(
                self.features, self.numbers(scene), self.ranges.values(), strict=True
            )
            if not drawn.min * (1.0 - 1e-9) <= value <= drawn.max * (1.0 + 1e-9)
        )


def some_row_runs(scene: Scene) -> bool:
    """Tell whether a uniform row runs through, as far as a few of them say."""
    try:
        rows = UniformLayouts(scene)
    except ValueError:
        return False
    few = TRIED_THICK if rows.low[1] < rows.high[1] else TRIED
    axes = [
        np.array(some) if some is not None else np.geomspace(low, high, number if low < high else 1)
        for low, high, some, number in zip(rows.low, rows.high, rows.allowed, few, strict=True)
    ]
    spacing, thickness, height = rows.at(grid(axes))
    batch = scene.batch(spacing, thickness, height, rtol=1e-5)
    return bool(scene.evaluate(batch).score.max() > 0.0)


def load_distribution(name: str | Path) -> SceneDistribution:
    """Load a distribution of scenes that ships, by name, or your own, by the path of its TOML file.

    Raises
    ------
    ValueError
        With file, key, value and what is allowed; for a file without ranges, which `load_scene`
        reads.
    """
    if str(name) in scene_names():
        refuse(str(name), IS_SCENE)
    return SceneDistribution(*read_named(name, "distribution"))


def load_any(name: str | Path) -> Scene | SceneDistribution:
    """Load a scene or a distribution of scenes, whichever the name or the file is."""
    if str(name) in distribution_names():
        return load_distribution(name)
    found = read_named(name, "scene")
    return SceneDistribution(*found) if has_ranges(found[0]) else scene_of_document(*found)
