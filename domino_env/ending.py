"""How an episode ended: its layout and its wave, worked out when somebody looks at them.

A batch ends thousands of episodes a second, and few of them are ever looked at.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env.layout import Layout
from domino_env.scene import Scene
from domino_env.wave import Wave, simulate

Floats = NDArray[np.float64]


class LateLayout(Layout):
    """A Layout that is checked and copied when it is first looked at."""

    @classmethod
    def of(cls, scene: Scene, spacing: Floats, thickness: Floats) -> LateLayout:
        """scene: height, width and density; spacing: (M,); thickness: (M+1,), both left alone."""
        self = object.__new__(cls)
        self.__dict__["_late"] = (scene, spacing, thickness)
        return self

    def __getattr__(self, name: str) -> Any:
        late = None if name.startswith("__") else self.__dict__.pop("_late", None)
        if late is None:
            raise AttributeError(f"'Layout' object has no attribute '{name}'")
        scene, spacing, thickness = late
        layout = Layout(spacing, thickness, scene.height, scene.width, scene.density)
        self.__dict__.update(vars(layout))
        return getattr(self, name)


class LateWave(Wave):
    """A Wave that is simulated when it is first looked at.

    Its reach counts against the scene's number of dominoes, also where fewer were placed.
    Two are equal if they are waves of equal layouts under the same physics and tolerance.
    """

    @classmethod
    def of(cls, layout: Layout, scene: Scene, rtol: float, reach: float) -> LateWave:
        """layout: what was placed; reach: as the environment found it."""
        self = object.__new__(cls)
        self.__dict__["_late"] = (layout, scene, rtol, reach)
        return self

    @classmethod
    def known(cls, wave: Wave) -> LateWave:
        """One that has been simulated already."""
        self = object.__new__(cls)
        self.__dict__.update(vars(wave))
        return self

    def __getattr__(self, name: str) -> Any:
        late = None if name.startswith("__") else self.__dict__.pop("_late", None)
        if late is None:
            raise AttributeError(f"'Wave' object has no attribute '{name}'")
        layout, scene, rtol, reach = late
        wave = simulate(layout, scene.physics, rtol=rtol)
        self.__dict__.update(vars(wave) | {"reach": reach})
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
