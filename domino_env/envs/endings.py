"""How episodes ended: their layouts and waves, worked out when somebody looks at them.

A batch ends tens of thousands of episodes a second, and few of them are ever looked at.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from domino_env.chain.layout import Layout
from domino_env.chain.wave import Wave, simulate
from domino_env.scenes.scene import Scene

Floats = NDArray[np.float64]
Objects = NDArray[np.object_]


@dataclass(frozen=True, eq=False)
class Endings:
    """What is kept of E episodes that ended together.

    Attributes
    ----------
    scene
        What was built.
    rtol
        Relative error allowed in the arrival times.
    spacing
        (E, N-1) [m]; what lies beyond the dominoes placed is not used.
    thickness
        (E, N) [m]
    height
        (E, N) [m]
    placed
        (E,) dominoes placed after the first.
    reach
        (E,) how far each wave came, of the scene's N dominoes.
    """

    scene: Scene
    rtol: float
    spacing: Floats
    thickness: Floats
    height: Floats
    placed: list[int]
    reach: list[float]

    def layout(self, i: int) -> Layout:
        """Return what was placed in episode i."""
        scene, placed = self.scene, self.placed[i]
        return Layout(
            self.spacing[i, :placed],
            self.thickness[i, : placed + 1],
            self.height[i, : placed + 1],
            scene.width,
            scene.density,
        )

    def wave(self, i: int) -> dict[str, Any]:
        """Return the fields of the wave of episode i; its reach counts against all N dominoes."""
        wave = simulate(self.layout(i), self.scene.physics, rtol=self.rtol)
        return vars(wave) | {"reach": self.reach[i]}

    def layouts(self) -> Objects:
        """(E,) layouts, to be looked at later."""
        return self._late(LateLayout)

    def waves(self) -> Objects:
        """(E,) waves, to be looked at later."""
        return self._late(LateWave)

    def _late(self, kind: type[LateLayout] | type[LateWave]) -> Objects:
        new = object.__new__
        late = np.empty(len(self.placed), object)
        for i in range(len(late)):
            item = new(kind)
            item.__dict__["_late"] = (self, i)
            late[i] = item
        return late


class LateLayout(Layout):
    """A Layout whose arrays are made when they are first looked at."""

    def __getattr__(self, name: str) -> Any:
        late = None if name.startswith("__") else self.__dict__.pop("_late", None)
        if late is None:
            raise AttributeError(f"'Layout' object has no attribute '{name}'")
        endings, i = late
        self.__dict__.update(vars(endings.layout(i)))
        return getattr(self, name)


class LateWave(Wave):
    """A Wave that is simulated when it is first looked at.

    Two are equal if they are waves of equal layouts under the same physics and tolerance.
    """

    @classmethod
    def known(cls, wave: Wave) -> Self:
        """Take one that has been simulated already."""
        self = object.__new__(cls)
        self.__dict__.update(vars(wave))
        return self

    def __getattr__(self, name: str) -> Any:
        late = None if name.startswith("__") else self.__dict__.pop("_late", None)
        if late is None:
            raise AttributeError(f"'Wave' object has no attribute '{name}'")
        endings, i = late
        self.__dict__.update(endings.wave(i))
        return getattr(self, name)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Wave):
            return NotImplemented
        return (self.layout, self.physics, self.rtol, self.reach) == (
            other.layout,
            other.physics,
            other.rtol,
            other.reach,
        )

    def __hash__(self) -> int:
        return hash((self.layout, self.physics, self.rtol))
