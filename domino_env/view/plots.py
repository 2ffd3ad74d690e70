"""What `layout.plot()` and `wave.plot()` draw."""

from __future__ import annotations

from matplotlib.figure import Figure

from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.view.rows import Shown, rows_picture


def plot_layout(layout: Layout) -> Figure:
    """Draw a row to scale, and its gaps along it."""
    number, _, sizes = repr(layout)[len("Layout(") : -1].partition(": ")
    return rows_picture([Shown(layout, None, "as it stands")], number, sizes)


def plot_wave(wave: Wave) -> Figure:
    """Draw the row of a wave to scale, and gaps and speed along it."""
    physics, ended = wave.physics, wave.outcome.name.lower().replace("_", " ")
    headline = f"{wave.mean_speed:.4f} m/s" if wave.mean_speed > 0.0 else ended
    subtitle = (
        f"{wave.layout.count} dominoes, friction {physics.friction:g}, "
        f"push {physics.push:g} rad/s, gravity {physics.gravity:g} m/s²"
    )
    return rows_picture([Shown(wave.layout, wave, "the row")], headline, subtitle)
