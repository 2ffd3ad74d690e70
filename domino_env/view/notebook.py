"""Figures of results in notebooks and scripts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.scenes.scene import Scene


@dataclass(frozen=True, eq=False, repr=False)
class SceneResult:
    """Base of results that are layouts of a scene: their text, and figures in notebooks.

    Attributes
    ----------
    scene
        The scene.
    layout
        The layout.
    wave
        Wave of the layout.
    score
        Score of the layout in the scene.
    """

    scene: Scene
    layout: Layout
    wave: Wave
    score: float

    @property
    def score_text(self) -> str:
        """The score, and its comparison with the uniform baseline."""
        return self.scene.format_with_gain(self.score, self.wave)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.scene.name}: {self.score_text})"

    def _repr_png_(self) -> bytes:
        return bytes(self.figure()._repr_png_())

    def plot(self, ax: Any = None) -> Any:
        """Draw the layout and the uniform baseline, their sizes and speeds, and a search, if any.

        Parameters
        ----------
        ax
            Matplotlib axes for the gaps of both layouts and nothing else; None for a new figure.

        Returns
        -------
        matplotlib.figure.Figure
            The figure. Notebooks show it; so does `pyplot.show` if pyplot is imported.

        Raises
        ------
        TypeError
            For `ax` that are not Matplotlib axes.
        """
        return self.figure(ax, register=True)

    def figure(self, ax: Any = None, *, register: bool = False) -> Any:
        """Return the figure of `plot`; `pyplot.show` shows it only if `register` is true."""
        from domino_env.view.figures import draw_with_uniform

        return draw_with_uniform(self, "this layout", ax=ax, register=register)
