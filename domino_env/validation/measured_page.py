"""Tables, plot and document of measured chains compared with the model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from domino_env.core.colours import AMBER, BLUE, INK, PALE, RED
from domino_env.core.plot_style import LEGEND, escape_dollars, new_panels, own_style, write_png
from domino_env.core.tables import csv_table, markdown_table, text_table
from domino_env.core.types import Floats
from domino_env.validation.measured import Comparison, Validation, model_value
from domino_env.validation.source import UNITS

PLOT, PAGE = "measured.png", "measured-sources.md"
CHAINS, READINGS = "measured-chains.csv", "measured-readings.csv"
CHAIN_HEAD = "gap or pitch", "measured", "model", "model/measured", "deviation", "predicted"
READING_HEAD = "reading or effect", "on speeds", "friction", "largest deviation", "χ²", "explained"
POINTS = 60  # of a curve
WIDEST = 0.97  # [heights] largest gap of a curve


def text(validation: Validation) -> list[str]:
    """Return the lines about a source for a terminal."""
    source, main = validation.source, validation.main
    sigma = main.setting.x_uncertainty
    spacings = f"known to {main.setting.format_x(sigma)}" if sigma else "taken as exact"
    verdict = "explained" if validation.explained else "not explained"
    if validation.reasons:
        verdict += f": {', '.join(validation.reasons)}"
    return [
        f"{source.name}: {source.title} [{source.unit}]",
        *text_table(CHAIN_HEAD, _chain_lines(main), right=CHAIN_HEAD[1:]),
        f"friction {_format_friction(main)}, spacings {spacings}, {verdict}",
    ]


def markdown(validations: Sequence[Validation]) -> list[str]:
    """Return the lines of the page: all sources in a table, then a paragraph for each."""
    explained = [f"`{v.source.name}`" for v in validations if v.explained]
    columns = ("source", "chains", "friction", "largest deviation", "explained", "reasons")
    counts = f"{len(explained)} of {len(validations)} sources are explained."
    lines = [
        f"**{counts}** {', '.join(explained)}".rstrip(),
        "",
        *markdown_table(columns, [
            (
                f"[{v.source.title}](#{v.source.name})", len(v.main.chains),
                _format_friction(v.main), f"{v.main.worst:.1f}", "yes" if v.explained else "no",
                ", ".join(v.reasons),
            )
            for v in validations
        ]),
    ]  # fmt: skip
    for v in validations:
        source = v.source
        lines += [
            "", f"## {source.name}", "",
            f"**{source.title}.** {source.reference}. Read: {source.read}.", "",
            f"How: {source.method}. Uncertainties: {source.errors}.", "",
            f"Not known: {'; '.join(source.unknown)}.",
        ]  # fmt: skip
    return lines


def chain_table(validations: Sequence[Validation]) -> str:
    """Return all chains as CSV: what was measured, and the model at the fitted friction."""
    lines = [(v.source.name, *cells) for v in validations for cells in _chain_lines(v.main)]
    return csv_table(("source", *CHAIN_HEAD), lines)


def reading_table(validations: Sequence[Validation]) -> str:
    """Return all readings of the sources, and effects that the model neglects, as CSV."""
    readings = [(v, one) for v in validations for one in (v.main, *v.readings, *v.effects)]
    lines = [(v.source.name, *_reading_line(reading)) for v, reading in readings]
    return csv_table(("source", *READING_HEAD), lines)


def _chain_lines(comparison: Comparison) -> list[tuple[str, ...]]:
    """Return the cells of `CHAIN_HEAD`, one line per chain."""
    lines: list[tuple[str, ...]] = []
    numbers = comparison.model, comparison.sigmas, comparison.deviations, comparison.predicted
    for chain, model, sigma, deviation, predicted in zip(comparison.chains, *numbers, strict=True):
        completes, error = 0.0 < model < math.inf, predicted / chain.value - 1.0
        lines.append((
            comparison.setting.format_x(chain.x) + (f", {chain.floor}" if chain.floor else ""),
            f"{chain.value:.4g} ± {sigma:.2g}",
            f"{model:.4g}" if completes else "no wave",
            f"{model / chain.value - 1.0:+.1%}" if completes else "",
            f"{deviation:+.1f}" if completes else "",
            "" if math.isnan(error) else f"{error:+.1%}" if abs(error) < 10.0 else "no wave",
        ))  # fmt: skip
    return lines


def _reading_line(reading: Comparison) -> tuple[str, ...]:
    """Return the cells of `READING_HEAD` of a reading or effect."""
    low, high = min(reading.factors) - 1.0, max(reading.factors) - 1.0
    finite = math.isfinite(reading.worst)
    return (
        reading.label or "as above", f"{low:+.1%} to {high:+.1%}" if low or high else "",
        _format_friction(reading), f"{reading.worst:.1f}" if finite else "no wave",
        f"{reading.chi_square:.1f}" if finite else "", "yes" if reading.holds else "no",
    )  # fmt: skip


def _format_friction(comparison: Comparison) -> str:
    """Return the fitted friction, with its uncertainty if that is finite."""
    finite = math.isfinite(comparison.uncertainty)
    return f"{comparison.friction:.3f}" + f" ± {comparison.uncertainty:.3f}" * finite


@own_style()
def draw(validations: Sequence[Validation], path: Path) -> None:
    """Draw speeds with two standard uncertainties, and the model, into a PNG file.

    Frequencies and times are converted to speeds. There is one panel for each source.
    """
    figure, panels = new_panels(
        len(validations), 2, (4.6, 3.0), (0.0, 0.7),
        headline="Measured speeds with two standard uncertainties",
        subtitle="and the model with the fitted friction and without friction",
    )  # fmt: skip
    for axes, validation in zip(panels, validations, strict=True):
        _draw_panel(axes, validation)
    write_png(figure, path)


def _draw_panel(axes: Axes, validation: Validation) -> None:
    """Draw the chains of one source, with the model at the fitted friction and without friction."""
    source, main = validation.source, validation.main
    setting, friction = main.setting, main.friction
    scale = 1e3 if setting.x_unit == "m" else 1.0  # metres are shown in millimetres
    x = np.array([chain.x for chain in main.chains])
    touching = setting.thickness / setting.x_length if setting.x_is == "pitch" else 0.0
    gap, widest = x - touching, WIDEST * setting.height / setting.x_length
    # slightly beyond the measured gaps on both sides
    dense = touching + np.linspace(0.8 * gap.min(), min(1.1 * gap.max(), widest), POINTS)
    band = main.uncertainty if math.isfinite(main.uncertainty) else 0.0

    def speeds(friction: float) -> Floats:
        values = np.array([model_value("speed", setting, x, friction) for x in dense.tolist()])
        return np.where(values > 0.0, values, np.nan)

    axes.fill_between(
        scale * dense, speeds(max(friction - band, 0.0)), speeds(friction + band), color=BLUE,
        alpha=0.15, linewidth=0,
    )  # fmt: skip
    label = f"model, friction {_format_friction(main)}"
    axes.plot(scale * dense, speeds(friction), color=BLUE, label=label)
    axes.plot(scale * dense, speeds(0.0), color=PALE, linestyle="--", label="model, no friction")
    floors = dict.fromkeys(chain.floor for chain in main.chains)
    for floor, colour in zip(floors, cycle((RED, AMBER, INK)), strict=False):
        places, speed, uncertainty = np.array([
            (scale * c.x, setting.speed(source.quantity, c.x, c.value), sigma / c.value)
            for c, sigma in zip(main.chains, main.sigmas, strict=True)
            if c.floor == floor
        ]).T  # fmt: skip
        axes.errorbar(
            places, speed, yerr=2.0 * speed * uncertainty, fmt="o", markersize=4, capsize=3,
            color=colour, label=floor or "measured",
        )  # fmt: skip
    axes.set_title(escape_dollars(source.title.partition(":")[0]), loc="left", color=INK, size=10)
    axes.set(
        xlabel=f"{setting.x_is} [{UNITS[setting.x_unit]}]",
        ylabel=f"speed [{source.unit if source.quantity == 'speed' else 'm/s'}]",
        ylim=(0.0, None),
    )
    axes.legend(**LEGEND)
