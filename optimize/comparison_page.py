"""What a comparison leaves in its folder: a page of Markdown, tables in CSV, pictures."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from domino_env.files import write_text
from optimize.comparison import TARGETS, Comparison
from optimize.result import SearchResult

FILES = ("comparison.md", "runs.csv", "traces.csv", "gaps.png", "targets.png")


def write(comparison: Comparison, folder: Path) -> None:
    """Write all FILES; what else lies in the folder stays."""
    from optimize.comparison_picture import draw_gaps, draw_targets

    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "comparison.md", page(comparison))
    write_text(folder / "runs.csv", _csv(_RUN_NAMES, map(comparison_row(comparison), _all(comparison))))
    write_text(folder / "traces.csv", _csv(_TRACE_NAMES, _trace_rows(comparison)))
    draw_gaps(comparison, folder / "gaps.png")
    draw_targets(comparison, folder / "targets.png")
