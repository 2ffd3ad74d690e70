"""Verification picture: how far a judge's arrival times are from the model's, along the row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domino_env.core.colours import COLOURS, INK, SHADE
from domino_env.core.plot_style import LEGEND, new_figure, style, write_png
from domino_env.rigid.comparison import AGREES, Verification
from domino_env.rigid.judges import in_words


def write_picture(
    checked: Verification, path: Path, title: str, second: Verification | None = None
) -> None:
    """Draw differences of every arrival time in per cent: hinged above, on floors below.

    A second judge's are dashed.
    """
    figure = new_figure(8.0, 5.6)
    above, below = figure.subplots(2, 1, sharex=True)
    style(above, f"{title}: {checked.verdict.partition(':')[0].lower()}")
    style(below, "")
    above.axhspan(-100.0 * AGREES, 100.0 * AGREES, color=SHADE, zorder=0)
    for one, line in ((checked, "-"), (second, "--")):
        if one is None:
            continue
        said = "" if one is checked else f", {one.judge}"
        for k, fall in enumerate(one.falls):
            axes = above if fall.floor is None else below
            axes.plot(
                np.arange(1, one.wave.layout.count), _shares(one, fall.arrivals),
                color=COLOURS[k], linestyle=line, label=in_words(fall.floor) + said,
            )  # fmt: skip
    for axes in (above, below):
        axes.axhline(0.0, color=INK, linewidth=0.8)
        axes.set_ylabel("arrival over model [%]")
        if axes.get_legend_handles_labels()[0]:
            axes.legend(ncols=2, **LEGEND)
    below.set_xlabel("domino")
    write_png(figure, path)


def _shares(checked: Verification, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much each arrival differs [%]; nan where there is none."""
    ours = checked.wave.arrival_times[1:]
    both = np.isfinite(ours) & np.isfinite(times[1:])
    return np.where(both, times[1:] / np.where(both, ours, 1.0) - 1.0, np.nan) * 100.0
