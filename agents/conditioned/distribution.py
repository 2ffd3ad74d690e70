"""The distribution of scenes that a policy is trained on, and the features that it observes.

Lengths count in heights h of a domino and times in √(h/g): a scene and its enlargement have the
same features, as they are the same (lengths × k, push / √k). Density and width cancel where all
dominoes are equal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from domino_env import Physics, Scene

Floats = NDArray[np.float64]
Range = tuple[float, float]

HEIGHT, GRAVITY = 0.048, 9.81  # [m], [m/s²] of the scenes that are drawn
FEATURES = ("friction", "push", "count", "least gap", "largest gap", "thickness")
RANGES = (
    ("friction", 0.0, 10.0), ("push", 1e-3, 1e3), ("count", 4, 10_000), ("least", 1e-4, 0.99),
    ("largest", 1e-4, 0.99), ("thickness", 1e-3, 0.9),
)  # fmt: skip
TRIED = 48  # uniform rows that tell whether any runs through


@dataclass(frozen=True)
class SceneDistribution:
    """Ranges that scenes are drawn from; the defaults are those of the policy that ships.

    Attributes
    ----------
    friction
        Coefficient; drawn evenly.
    push
        Of the first domino, times √(h/g); drawn evenly in the logarithm, as the next three.
    count
        Number of dominoes.
    least, largest
        Gap allowed, over h.
    thickness
        Over h; drawn evenly.
    apart
        The largest gap is at least this times the least.

    Raises
    ------
    ValueError
        For ranges that no scene can be drawn from.
    """

    friction: Range = (0.0, 0.5)
    push: Range = (0.2, 1.4)  # 2.9 to 20 rad/s at 48 mm
    count: tuple[int, int] = (15, 80)
    least: Range = (0.02, 0.2)  # 1 to 9.6 mm at 48 mm
    largest: Range = (0.4, 0.95)  # 19 to 46 mm
    thickness: Range = (0.08, 0.25)  # 4 to 12 mm
    apart: float = 1.5

    def __post_init__(self) -> None:
        for name, low, high in RANGES:
            given = getattr(self, name)
            good = isinstance(given, tuple) and len(given) == 2
            good = good and all(isinstance(x, int | float) for x in given)
            if not (good and low <= given[0] <= given[1] <= high):
                raise ValueError(f"{name} = {given!r}: give two rising numbers, {low} to {high}")
        if not (isinstance(self.apart, int | float) and 1.0 < self.apart < 100.0):
            raise ValueError(f"apart = {self.apart!r}: give a number from 1 to 100")
        if self.apart * self.least[1] > self.largest[1]:
            raise ValueError(
                f"least = {self.least}: {self.apart} times its end is beyond largest {self.largest}"
            )

    def sample(self, rng: np.random.Generator, name: str = "drawn") -> Scene:
        """Draw a scene in which at least one uniform row runs through: others have no baseline."""
        while True:
            scene = scene_with(self._any(rng), name)
            if some_row_runs(scene):
                return scene

    def _any(self, rng: np.random.Generator) -> Floats:
        least = _logarithmic(rng, self.least)
        return np.array([
            rng.uniform(*self.friction),
            _logarithmic(rng, self.push),
            np.floor(_logarithmic(rng, (self.count[0], self.count[1] + 1))),
            least,
            _logarithmic(rng, (max(self.largest[0], self.apart * least), self.largest[1])),
            rng.uniform(*self.thickness),
        ])  # fmt: skip

    def outside(self, scene: Scene) -> tuple[str, ...]:
        """Say in what a scene differs from all that are drawn; empty if in nothing."""
        ranges = (
            self.friction, self.push, self.count, self.least, self.largest, self.thickness,
        )  # fmt: skip
        return tuple(
            f"{name} {value:.4g} is outside {low:.4g} to {high:.4g}"
            for name, value, (low, high) in zip(FEATURES, features_of(scene), ranges, strict=True)
            if not low * (1.0 - 1e-9) <= value <= high * (1.0 + 1e-9)
        )


def _logarithmic(rng: np.random.Generator, bounds: Range) -> float:
    return float(np.exp(rng.uniform(*np.log(bounds))))


def features_of(scene: Scene) -> Floats:
    """Give the `FEATURES` of a scene: all that the speed of a row of its gaps over h depends on."""
    h, gravity = scene.height, scene.physics.gravity
    return np.array([
        scene.physics.friction, scene.physics.push * np.sqrt(h / gravity), scene.count,
        scene.spacing[0] / h, scene.spacing[1] / h, scene.thickness[0] / h,
    ])  # fmt: skip


def scene_with(features: Floats, name: str = "drawn") -> Scene:
    """Make the scene with these `FEATURES`, of standard height."""
    friction, push, count, least, largest, thickness = (float(x) for x in features)
    thick = HEIGHT * thickness
    return Scene(
        name=name,
        title="A scene drawn at random",
        objective="mean_speed",
        physics=Physics(friction, GRAVITY, push * float(np.sqrt(GRAVITY / HEIGHT))),
        count=int(count),
        height=HEIGHT,
        width=0.024,
        density=1040.0,
        first_thickness=thick,
        spacing=(HEIGHT * least, HEIGHT * largest),
        thickness=(thick, thick),
    )


def require_kind(scene: Scene) -> None:
    """Raise ValueError for a scene that does not ask for fast rows of equal dominoes."""
    other = []
    if not scene.criterion.is_ratio:
        other.append(f"its objective is {scene.objective}")
    if not scene.free_spacing:
        other.append("its gaps are not free")
    if scene.free_thickness or scene.stock is not None or scene.growth is not None:
        other.append("its dominoes differ")
    if scene.length is not None:
        other.append("it asks for a length")
    if scene.spacing_values is not None or scene.largest_change is not None:
        other.append("its gaps are listed or tied to each other")
    if scene.ground is not None:
        other.append("its ground is not flat")
    if scene.limits is not None:
        other.append("it limits the wave")
    if scene.count < 4:
        other.append(f"it has {scene.count} dominoes")
    if other:
        raise ValueError(
            f"scene '{scene.name}': {', '.join(other)}; this policy was trained on fast rows of 4 "
            "or more equal dominoes with free gaps: search this one with `domino optimize`"
        )


def uniform_speed(scene: Scene, rows: int = TRIED) -> float:
    """Estimate the score of the best uniform row: the best of a few; -1 to 0 where none runs."""
    gaps = np.geomspace(*scene.spacing, rows)[:, None] * np.ones(scene.count - 1)
    return float(scene.score_batch(gaps, None, rtol=1e-5).max())


def some_row_runs(scene: Scene) -> bool:
    """Tell whether a uniform row runs through, as far as a few of them say."""
    return uniform_speed(scene) > 0.0
