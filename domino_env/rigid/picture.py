"""Verification picture: how far the engine's arrival times are from the model's, along the row."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from domino_env.rigid.comparison import AGREES, Verification
from domino_env.support.colours import INK, OURS, PALE, RED, SHADE
from domino_env.support.plot_style import LEGEND, new_figure, style, write_png


def write_picture(checked: Verification, path: Path, title: str) -> None:
    """Draw differences of every arrival time in per cent: hinged at each step, limit, free."""
    figure = new_figure(8.0, 4.0)
    axes = figure.add_subplot()
    style(axes, f"{title}: {checked.verdict.split('.', 1)[0].split(':')[0].lower()}")
    ours = checked.wave.arrival_times[1:]
    numbers = np.arange(1, checked.wave.layout.count)

    def share(times: np.ndarray) -> np.ndarray:
        both = np.isfinite(ours) & np.isfinite(times[1:])
        return np.where(both, times[1:] / np.where(both, ours, 1.0) - 1.0, np.nan) * 100.0

    axes.axhspan(-100.0 * AGREES, 100.0 * AGREES, color=SHADE, zorder=0)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    for k, (step, times) in enumerate(zip(checked.steps, checked.hinged, strict=True)):
        # the finer, the bolder
        axes.plot(
            numbers, share(times), color=PALE, linewidth=0.8 + 0.6 * k,
            label=f"hinged, {step * 1e6:g} µs",
        )  # fmt: skip
    axes.plot(numbers, share(checked.limit), color=OURS, label="hinged, extrapolated")
    axes.plot(numbers, share(checked.free_limit), color=RED, linestyle="--", label="free")
    axes.set_xlabel("domino")
    axes.set_ylabel("arrival: engine over model [%]")
    axes.legend(ncols=2, **LEGEND)
    write_png(figure, path)
