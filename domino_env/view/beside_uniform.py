"""A row made for a scene beside the best uniform one: the picture of a search, or of a training."""

from __future__ import annotations

from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from domino_env.core.colours import UNIFORM
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.scenes.baseline import gain
from domino_env.scenes.scene import Scene
from domino_env.view.rows import Shown, rows_picture


def beside_uniform(
    scene: Scene,
    layout: Layout,
    wave: Wave,
    score: float,
    name: str,
    last: Callable[[Axes], None] | None = None,
) -> Figure:
    """Draw a row and the best uniform one of its scene.

    Parameters
    ----------
    scene
        What it was made for.
    layout
        The row.
    wave
        Its wave.
    score
        What the scene gives for it.
    name
        What the row is called, such as by what it was found.
    last
        Draws how it was found, in a panel below.
    """
    mark = scene.uniform()
    rows = [Shown(mark.layout, mark.wave, "best uniform pitch", UNIFORM), Shown(layout, wave, name)]
    physics = scene.physics
    subtitle = (
        f"{scene.title} · {scene.count} dominoes, friction {physics.friction:g}, "
        f"push {physics.push:g} rad/s"
    )
    return rows_picture(rows, _headline(scene, wave, score), subtitle, scene, last)


def _headline(scene: Scene, wave: Wave, score: float) -> str:
    mark = scene.uniform()
    if score <= 0.0:
        return f"{scene.name}: no row found that topples to the end"
    if not scene.criterion.is_mean_speed:
        found = scene.in_words(score, wave)
        return f"{scene.name}: {found} (uniform: {scene.in_words(mark.score, mark.wave)})"
    lead = gain(score, mark.score)
    if lead is None:
        return f"{scene.name}: {score:.4f} m/s, where no uniform pitch topples to the end"
    compared = "faster" if lead >= 0.0 else "slower"
    return f"{scene.name}: {score:.4f} m/s, {abs(lead):.2%} {compared} than the best uniform pitch"
