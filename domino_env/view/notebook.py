"""SVG drawings of layouts for notebooks: small, to scale, and without Matplotlib."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

from domino_env.core.colours import OURS, UNIFORM
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.motion import outlines
from domino_env.physics.wave import Wave
from domino_env.scenes.scene import Scene
from domino_env.view.ground import ground_line

LONGEST = 45.0  # domino heights; of a longer layout the two ends are drawn
WIDEST = 900  # [px] on the screen
PALE = 0.3  # opacity, on white paper and on a dark screen
PIXELS = 1500.0  # [px/m] on the screen, where there is room


class MadeForScene:
    """Mixin of results with a scene, a layout, its wave and its score."""

    scene: Scene
    layout: Layout
    wave: Wave
    score: float

    def _repr_html_(self) -> str:
        uniform, best = self.scene.uniform().layout, (self.layout, self.wave.hit, OURS)
        return layouts_html(repr(self), [(uniform, uniform.count, UNIFORM), best])

    def plot(self, ax: Any = None) -> Any:
        """Draw the layout and the uniform baseline to scale, and their differences.

        Parameters
        ----------
        ax
            Matplotlib axes that get the gaps of both and nothing else; None for a new figure.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, which notebooks show, and `pyplot.show` where pyplot is imported.
        """
        from domino_env.view.figures import beside_uniform

        sizes = self.scene, self.layout, self.wave, self.score
        return beside_uniform(*sizes, "the layout made", ax=ax, register=True)


def layout_html(layout: Layout) -> str:
    """Return a drawing of a layout under its sentence."""
    return layouts_html(repr(layout), [(layout, layout.count, OURS)])


def wave_html(wave: Wave) -> str:
    """Return a drawing of the layout of a wave under its sentence."""
    return layouts_html(repr(wave), [(wave.layout, wave.hit, OURS)])


def layouts_html(sentence: str, layouts: Sequence[tuple[Layout, int, str]]) -> str:
    """Return drawings of layouts below each other, to one scale, under a sentence.

    Parameters
    ----------
    sentence
        Plain text.
    layouts
        Layout, number of its dominoes that were struck (the others are pale), colour.
    """
    tall = max(float(layout.height.max()) for layout, _, _ in layouts)
    longest = max(_span(layout)[1] - _span(layout)[0] for layout, _, _ in layouts)
    drawings = "".join(_drawing(*one, min(longest, LONGEST * tall), tall) for one in layouts)
    return f'<div style="margin:.3em 0"><code>{escape(sentence)}</code>{drawings}</div>'


def _span(layout: Layout) -> tuple[float, float]:
    """Return the ends of a standing layout [m]."""
    x = outlines(layout, layout.tilt)[..., 0]
    return float(x.min()), float(x.max())


def _drawing(layout: Layout, hit: int, colour: str, across: float, tall: float) -> str:
    """Return a drawing of a layout, or of the two ends of one longer than `across` [m]."""
    first, last = _span(layout)
    windows = [(first, first + across)]
    if last - first > across:
        half = 0.5 * (across - tall)
        windows = [(first, first + half), (last - half, last)]
    parts = [_window(layout, hit, colour, *window, across) for window in windows]
    return f'<div style="margin:.4em 0;white-space:nowrap">{" … ".join(parts)}</div>'


def _window(layout: Layout, hit: int, colour: str, low: float, high: float, across: float) -> str:
    """Return a part of a drawing `across` [m] wide, in millimetres from the top down."""
    share = (high - low) / across
    wide = share * min(WIDEST, across * PIXELS)
    corners = outlines(layout, layout.tilt)
    x = corners[..., 0]
    inside = ((x.max(axis=1) > low) & (x.min(axis=1) < high)).nonzero()[0]
    shapes = "".join(
        f'<polygon points="{_points(corners[i])}" fill="{colour}" '
        f'opacity="{1 if i < hit else PALE}"/>'
        for i in map(int, inside)
    )
    z = corners[inside, :, 1] if len(inside) else corners[..., 1]
    top, depth = float(z.max()), float(z.max() - z.min())
    box = f"{1e3 * low:.2f} {-1e3 * top:.2f} {1e3 * (high - low):.2f} {1e3 * depth + 1.0:.2f}"
    line = ground_line(layout, high - low, high - low) - (0.0, 5e-4)
    near = layout.is_flat | (abs(line[:, 0] - 0.5 * (low + high)) < high - low)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" role="img" '
        f'style="width:{wide:.0f}px;max-width:{100.0 * share:.0f}%">{shapes}'
        f'<polyline points="{_points(line[near])}" fill="none" stroke="currentColor"/></svg>'
    )


def _points(places: Iterable[Floats]) -> str:
    return " ".join(f"{1e3 * x:.3f},{-1e3 * z:.3f}" for x, z in places)
