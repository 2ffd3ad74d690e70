"""How a notebook shows a row that was made for a scene: beside the best uniform one."""

from __future__ import annotations

from typing import Any

from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.scenes.scene import Scene
from domino_env.view.svg import beside_uniform_html


class MadeForScene:
    """What results with a scene, a layout, its wave and its score have in common."""

    scene: Scene
    layout: Layout
    wave: Wave
    score: float

    def _repr_html_(self) -> str:
        return beside_uniform_html(repr(self), self.scene.uniform().layout, self.wave)

    def plot(self) -> Any:
        """Draw the row and the best uniform one to scale, and what differs along them.

        Returns
        -------
        matplotlib.figure.Figure
            To be saved with `savefig`; notebooks show it.
        """
        from domino_env.view.beside_uniform import beside_uniform

        return beside_uniform(self.scene, self.layout, self.wave, self.score, "the row made")
