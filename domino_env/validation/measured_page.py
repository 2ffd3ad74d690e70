"""Tables, plot and document of measured chains beside the model; docs/measured.md has the words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from matplotlib.axes import Axes

from domino_env.core.colours import AMBER, BLUE, INK, PALE, RED
from domino_env.core.plot_style import LEGEND, escaped, new_panels, write_png
from domino_env.core.results import document
from domino_env.core.tables import markdown_table, text_table
from domino_env.core.types import Floats
from domino_env.validation.measured import Comparison, Validation, row_model, speed_of
from domino_env.validation.source import UNITS

PLOT, PAGE = "measured.png", "measured.md"
ROWS = (
    "spacing", "measured", "model", "model/measured", "deviation", "friction alone", "predicted",
)  # fmt: skip
READINGS = (
    "reading or effect", "on speeds", "friction", "largest deviation", "χ²", "explained",
)  # fmt: skip
NUMBERS = "what friction uncertainty sigmas explained single smooth predicted factors worst holds"
POINTS = 60  # of a line
WIDEST = 0.97  # [heights] gap that is drawn


def text(validation: Validation) -> list[str]:
    """Return the lines of a source for a terminal."""
    source, main = validation.source, validation.main
    return [
        f"{source.name}: {source.title} [{source.unit}]",
        *text_table(ROWS, _rows(main), right=ROWS[1:]),
        f"friction {_friction(main)}, {'' if validation.explained else 'not '}explained"
        + (f": {', '.join(validation.reasons)}" if validation.reasons else ""),
    ]


def as_document(validations: Sequence[Validation]) -> dict[str, Any]:
    """Return everything as one document for other programs; null where there is no wave."""

    def reading(one: Comparison) -> dict[str, Any]:
        settings = {"setting": one.setting, "rows": one.rows}
        return document(one, NUMBERS) | dict(msgspec.to_builtins(settings))

    return {
        "sources": [
            document(one.source, "name title reference quantity unit")
            | document(one, "explained reasons")
            | {"readings": [reading(r) for r in (one.main, *one.readings)]}
            | {"effects": [reading(e) for e in one.effects]}
            for one in validations
        ]
    }


def markdown(validations: Sequence[Validation]) -> list[str]:
    """Return the lines of the page: all sources in a table, then each."""
    held = [f"`{v.source.name}`" for v in validations if v.explained]
    summary = ("source", "rows", "friction", "largest deviation", "explained", "reasons")
    lines = [
        f"**{len(held)} of {len(validations)} sources are explained.** {', '.join(held)}".rstrip(),
        "",
        *markdown_table(summary, [
            (
                f"[{v.source.title}](#{v.source.name})", len(v.main.rows), _friction(v.main),
                f"{v.main.worst:.1f}", "yes" if v.explained else "no", ", ".join(v.reasons),
            )
            for v in validations
        ]),
    ]  # fmt: skip
    for v in validations:
        source = v.source
        every = (v.main, *v.readings, *v.effects)
        lines += [
            "", f"## {source.name}", "",
            f"**{source.title}.** {source.reference}. Read: {source.read}.", "",
            f"How: {source.method}. Uncertainties: {source.errors}.", "",
            f"Not known: {'; '.join(source.unknown)}.", "",
            *markdown_table(ROWS, _rows(v.main)), "",
            *markdown_table(READINGS, [_reading(one) for one in every]),
        ]  # fmt: skip
    return lines


def _rows(comparison: Comparison) -> list[tuple[str, ...]]:
    lines: list[tuple[str, ...]] = []
    for k, row in enumerate(comparison.rows):
        model, alone, predicted = (
            many[k] for many in (comparison.explained, comparison.single, comparison.predicted)
        )
        lives, error = 0.0 < model < math.inf, predicted / row.value - 1.0
        lines.append((
            comparison.setting.words(row.x) + (f", {row.floor}" if row.floor else ""),
            f"{row.value:.4g} ± {comparison.sigmas[k]:.2g}",
            f"{model:.4g}" if lives else "no wave",
            f"{model / row.value - 1.0:+.1%}" if lives else "",
            f"{comparison.deviations[k]:+.1f}" if lives else "",
            f"{alone:.3f}" if math.isfinite(alone) else "none",
            "" if math.isnan(error) else f"{error:+.1%}" if abs(error) < 10.0 else "no wave",
        ))  # fmt: skip
    return lines


def _reading(one: Comparison) -> tuple[str, ...]:
    low, high = min(one.factors) - 1.0, max(one.factors) - 1.0
    finite = math.isfinite(one.worst)
    return (
        one.what or "as above", f"{low:+.1%} to {high:+.1%}" if low or high else "",
        _friction(one), f"{one.worst:.1f}" if finite else "no wave",
        f"{one.chi_square:.1f}" if finite else "", "yes" if one.holds else "no",
    )  # fmt: skip


def _friction(one: Comparison) -> str:
    spread = f" ± {one.uncertainty:.3f}" if math.isfinite(one.uncertainty) else ""
    return f"{one.friction:.3f}{spread}"


def draw(validations: Sequence[Validation], path: Path) -> None:
    """Draw speeds with two standard uncertainties, and the model at the friction found.

    What was measured as a frequency or a time is drawn as the speed that it means.
    """
    figure, panels = new_panels(len(validations), 3, (4.2, 3.3), (0.0, 0.7))
    for axes, validation in zip(panels, validations, strict=True):
        _draw_panel(axes, validation)
    figure.suptitle(
        "Measured, with two standard uncertainties, beside the model at the friction found and "
        "without any", color=INK, fontsize=11.5,
    )  # fmt: skip
    write_png(figure, path)


def _draw_panel(axes: Axes, validation: Validation) -> None:
    source, main = validation.source, validation.main
    setting = main.setting
    scale = 1e3 if setting.x_unit == "m" else 1.0
    low, high = min(r.x for r in main.rows), max(r.x for r in main.rows)
    room = 0.12 * (high - low) or 0.2 * low
    foot = setting.thickness / setting.x_length if setting.x_is == "pitch" else 0.0
    most = foot + WIDEST * setting.height / setting.x_length
    dense = np.linspace(max(low - room, foot + 0.3 * (low - foot)), min(high + room, most), POINTS)
    band = main.uncertainty if math.isfinite(main.uncertainty) else 0.0
    models = [row_model(setting, "speed", float(x)) for x in dense]

    def line(friction: float) -> Floats:
        values = np.array([m(friction) for m in models])
        return np.where(values > 0.0, values, np.nan)

    axes.fill_between(
        scale * dense, line(max(main.friction - band, 0.0)), line(main.friction + band),
        color=BLUE, alpha=0.15, linewidth=0,
    )  # fmt: skip
    axes.plot(scale * dense, line(main.friction), color=BLUE, label=f"μ {_friction(main)}")
    axes.plot(scale * dense, line(0.0), color=PALE, linestyle="--", label="no friction")
    floors = dict.fromkeys(row.floor for row in main.rows)
    for floor, colour in zip(floors, (RED, AMBER), strict=False):
        x, speed, part = np.array([
            (scale * r.x, speed_of(source.quantity, setting, r.x, r.value), sigma / r.value)
            for r, sigma in zip(main.rows, main.sigmas, strict=True)
            if r.floor == floor
        ]).T  # fmt: skip
        axes.errorbar(
            x, speed, yerr=2.0 * speed * part, fmt="o", markersize=4, capsize=3, color=colour,
            label=floor or "measured",
        )  # fmt: skip
    axes.set_title(escaped(source.title.partition(":")[0]), loc="left", color=INK, size=10)
    axes.set(
        xlabel=f"{setting.x_is} [{UNITS[setting.x_unit]}]",
        ylabel=f"speed [{source.unit if source.quantity == 'speed' else 'm/s'}]",
        ylim=(0.0, None),
    )
    axes.legend(**LEGEND)
