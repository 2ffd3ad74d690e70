"""The page, the tables and the document of what was measured beside the model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import msgspec

from domino_env.core.tables import markdown_table, text_table
from domino_env.validation.measured.comparison import MOST, Comparison
from domino_env.validation.measured.fit import HIGHEST
from domino_env.validation.measured.validation import Validation, friction_words

PICTURE, PAGE = "measured.png", "measured.md"
ROWS = ("spacing", "measured", "model", "model/measured", "off", "friction alone", "foretold")
INTRODUCTION = f"""\
`domino validate` makes this page and its picture: all measured rows of which a page with the
numbers could be read, beside the model. One number is fitted a source, the friction between
dominoes, by least squares between 0 and {HIGHEST:g}. A source counts as explained when every row
is then within {MOST:g} standard uncertainties, that of the spacing included, and the friction is
the one measured by itself, where somebody did. *Off* is model less measured in those uncertainties.
*Friction alone* is what the row asks for by itself; *none* where it is faster than the model
without friction. *Foretold* is the error at a spacing when the friction is fitted to all others.

The second table of a source tells how much what is not known matters: other readings of the same
experiment, and effects that the model leaves out, each as large as simulated rows have it at the
friction found. χ² is the sum of squares of *off*; one less than the number of rows is what a right
model has."""
TRIED = """\
*Bounce* does not make narrow rows fast. In the engine of `domino verify`, hinged, with 200 sweeps
and steps of 80 µs, rows at a friction of 0.2 and gaps of 9.4, 16.5 and 24.5 mm change their speed
by at most 0.1 % with a restitution of 0.2, 0.7 to 0.9 % with 0.4, and −0.7 to +3.2 % with 0.6.

*Feet that slip* make narrow rows of smooth dominoes faster, and rows whose gap is nearly the height
much slower: see the floors in the table of `camera`."""
NOT_USED = (
    "R. Larham, DEMONic dominoes (arXiv 1302.3311): the tables of his own measurements could not "
    "be read, only the opening",
    "D. Cantor and K. Wojtacki, Physical Review Applied 17 (2022) 064021: simulated, in LMGC90; "
    "of the paper itself only reports were read",
    "W. J. Stronge (1987), W. J. Stronge and D. Shu (1988), F. Fujii et al., Transactions of the "
    "JSME 78 (2012) 1133, D. E. Shaw (1978): no page with their numbers could be read",
    "C. J. Efthimiou and M. D. Johnson (2007): theory, no measurements",
)


def row_cells(comparison: Comparison) -> list[tuple[str, ...]]:
    """A line of a table for each row, under `ROWS`."""
    foretold = {left.x: left for left in comparison.left_out}
    lines: list[tuple[str, ...]] = []
    for k, row in enumerate(comparison.rows):
        model, left = comparison.explained[k], foretold.get(row.x)
        lives = 0.0 < model < math.inf
        alone = comparison.single[k]
        lines.append(
            (
                comparison.setting.words(row.x) + (f", {row.floor}" if row.floor else ""),
                f"{row.value:.4g} ± {comparison.sigmas[k]:.2g}",
                f"{model:.4g}" if lives else "no wave",
                f"{model / row.value - 1.0:+.1%}" if lives else "",
                f"{comparison.off[k]:+.1f}" if lives else "",
                f"{alone:.3f}" if math.isfinite(alone) else "none",
                f"{left.error:+.1%}"
                if left and abs(left.error) < 10.0
                else "no wave"
                if left
                else "",
            )
        )
    return lines


def reading_cells(validation: Validation) -> list[tuple[str, ...]]:
    """A line for each reading and effect, under `READINGS`."""
    return [
        (
            r.what or "as above",
            _span(r.factors),
            friction_words(r),
            f"{r.worst:.1f}" if math.isfinite(r.worst) else "no wave",
            f"{r.square:.1f}" if math.isfinite(r.square) else "",
            "yes" if r.holds else "no",
        )
        for r in (validation.main, *validation.readings, *validation.effects)
    ]


def _span(factors: Sequence[float]) -> str:
    low, high = min(factors) - 1.0, max(factors) - 1.0
    return f"{low:+.1%} to {high:+.1%}" if low or high else ""


READINGS = ("reading or effect", "on speeds", "friction", "worst row off", "χ²", "explained")


def text(validation: Validation) -> list[str]:
    """What a terminal shows of a source."""
    source = validation.source
    return [
        f"{source.name}: {source.title} [{source.unit}]",
        *text_table(ROWS, row_cells(validation.main), right=ROWS[1:]),
        *validation.verdict,
    ]


def document(validations: Sequence[Validation]) -> dict[str, Any]:
    """Everything as one document for other programs; null where there is no wave."""
    return {"sources": [_source_document(v) for v in validations]}


def _source_document(validation: Validation) -> dict[str, Any]:
    source = validation.source
    return {
        "name": source.name,
        "title": source.title,
        "reference": source.reference,
        "quantity": source.quantity,
        "unit": source.unit,
        "explained": validation.explained,
        "verdict": list(validation.verdict),
        "readings": [_reading_document(r) for r in (validation.main, *validation.readings)],
        "effects": [_reading_document(e) for e in validation.effects],
    }


def _reading_document(reading: Comparison) -> dict[str, Any]:
    rows = [
        {
            "x": row.x,
            "floor": row.floor,
            "measured": row.value,
            "uncertainty": reading.sigmas[k],
            "model": _finite(reading.explained[k]),
            "factor": reading.factors[k],
            "friction_alone": _finite(reading.single[k]),
        }
        for k, row in enumerate(reading.rows)
    ]
    left_out = [
        {"x": left.x, "friction": left.friction, "error": _finite(left.error)}
        for left in reading.left_out
    ]
    return {
        "what": reading.what,
        "setting": msgspec.to_builtins(reading.setting),
        "friction": reading.friction,
        "uncertainty": _finite(reading.uncertainty),
        "worst": _finite(reading.worst),
        "explained": reading.holds,
        "rows": rows,
        "left_out": left_out,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def markdown(validations: Sequence[Validation]) -> str:
    """The page of the documentation."""
    held = [v for v in validations if v.explained]
    lines = [
        "# Beside measured rows",
        "",
        f"![What was measured beside the model]({PICTURE})",
        "",
        *INTRODUCTION.splitlines(),
        "",
        f"**{len(held)} of {len(validations)} sources are explained"
        + (f": {', '.join(v.source.name for v in held)}" if held else "")
        + ".** Where uncertainties are large, that says little.",
        "",
        *markdown_table(
            ("source", "rows", "friction", "worst row off", "explained"),
            [
                (
                    f"[{v.source.title}](#{v.source.name})",
                    len(v.main.rows),
                    friction_words(v.main),
                    f"{v.main.worst:.1f}",
                    _explained(v),
                )
                for v in validations
            ],
        ),
    ]  # fmt: skip
    for validation in validations:
        lines += ["", *section(validation)]
    lines += ["", "## What else was tried", "", *TRIED.splitlines()]
    lines += ["", "## Looked for and not used", ""]
    lines += [f"- {entry}." for entry in NOT_USED]
    lines += ["", "A number is used only where the page that has it was read."]
    return "\n".join(lines) + "\n"


def _explained(validation: Validation) -> str:
    mending = [e.what for e in validation.effects if e.holds]
    return "yes" if validation.explained else f"with {mending[0]}" if mending else "no"


def section(validation: Validation) -> list[str]:
    """What the page says of a source."""
    source = validation.source
    return [
        f"## {source.name}",
        "",
        f"**{source.title}.** " + source.reference + ". Read: " + source.read + ".",
        "",
        f"How: {source.method}. Uncertainties: {source.errors}.",
        "",
        "Not known: " + "; ".join(source.unknown) + ".",
        "",
        *markdown_table(ROWS, row_cells(validation.main)),
        "",
        " ".join(validation.verdict),
        "",
        *markdown_table(READINGS, reading_cells(validation)),
    ]
