"""The picture of what was measured beside the model, a panel a source."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from domino_env.core.colours import AMBER, BLUE, INK, PALE, RED
from domino_env.core.plot_style import LEGEND, escaped, new_panels, write_png
from domino_env.validation.measured.model import row_model, speed_of
from domino_env.validation.measured.source import UNITS
from domino_env.validation.measured.validation import Validation, friction_words

POINTS = 60  # of a line
WIDEST = 0.97  # [heights] gap that is drawn
FLOORS = (RED, AMBER)  # colours of rows by the floor they stand on


def draw(validations: Sequence[Validation], path: Path) -> None:
    """Draw speeds with two standard uncertainties, and the model at the friction found.

    What was measured as a frequency or a time is drawn as the speed that it means.
    """
    figure, panels = new_panels(len(validations), 3, (4.2, 3.3), (0.0, 0.7))
    for axes, validation in zip(panels, validations, strict=True):
        _draw_panel(axes, validation)
    figure.suptitle(
        "What was measured, with two standard uncertainties, beside the model at the friction "
        "found and without any",
        color=INK,
        fontsize=11.5,
    )
    write_png(figure, path)


def _draw_panel(axes: Axes, validation: Validation) -> None:
    source, main = validation.source, validation.main
    setting = main.setting
    scale = 1e3 if setting.x_unit == "m" else 1.0
    places = [r.x for r in main.rows]
    low, high = min(places), max(places)
    room = 0.12 * (high - low) or 0.2 * low
    foot = setting.thickness / setting.x_length if setting.x_is == "pitch" else 0.0
    most = foot + WIDEST * setting.height / setting.x_length
    dense = np.linspace(max(low - room, foot + 0.3 * (low - foot)), min(high + room, most), POINTS)
    band = main.uncertainty if math.isfinite(main.uncertainty) else 0.0
    models = [row_model(setting, "speed", float(x)) for x in dense]

    def line(friction: float) -> NDArray[np.float64]:
        values = np.array([m(friction) for m in models])
        return np.where(values > 0.0, values, np.nan)

    axes.fill_between(
        scale * dense, line(max(main.friction - band, 0.0)), line(main.friction + band),
        color=BLUE, alpha=0.15, linewidth=0,
    )  # fmt: skip
    axes.plot(scale * dense, line(main.friction), color=BLUE, label=f"μ {friction_words(main)}")
    axes.plot(scale * dense, line(0.0), color=PALE, linestyle="--", label="no friction")
    floors = list(dict.fromkeys(row.floor for row in main.rows))
    for floor, colour in zip(floors, FLOORS, strict=False):
        rows = [
            (scale * row.x, speed_of(source.quantity, setting, row.x, row.value), sigma / row.value)
            for row, sigma in zip(main.rows, main.sigmas, strict=True)
            if row.floor == floor
        ]
        axes.errorbar(
            [x for x, _, _ in rows], [v for _, v, _ in rows],
            yerr=[2.0 * v * part for _, v, part in rows], fmt="o", markersize=4, capsize=3,
            color=colour, label=floor or "measured",
        )  # fmt: skip
    axes.set_title(escaped(source.title.partition(":")[0]), loc="left", color=INK, size=10)
    axes.set(
        xlabel=f"{setting.x_is} [{UNITS[setting.x_unit]}]",
        ylabel=f"speed [{source.unit if source.quantity == 'speed' else 'm/s'}]",
        ylim=(0.0, None),
    )
    axes.legend(**LEGEND)
