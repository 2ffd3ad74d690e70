"""Report: one page that plays rows against each other, and shows why one wins.

The page needs no network and no server: data, scripts and styles are inside it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

from domino_env.core.files import write_text
from domino_env.view.report.race import Racer, race_data
from domino_env.view.report.reading import read_racers

__all__ = ["read_racers", "write_report"]


def write_report(racers: Sequence[Racer], title: str, path: Path) -> int:
    """Write the page whole, and return its size [bytes]."""
    assets = files("domino_env.view.report") / "assets"

    def read(name: str) -> str:
        return (assets / name).read_text("utf-8")

    data = json.dumps(race_data(racers), allow_nan=False, separators=(",", ":"))
    parts = {
        "title": escape(title),
        "styles": read("uPlot.min.css") + read("report.css"),
        "licence": escape(read("uPlot.LICENSE")),
        # "</script" would end the script early, "<!--" could keep it from ending
        "data": data.replace("<", "\\u003c"),
        "charts": read("uPlot.iife.min.js"),
        "race": read("race.js"),
    }
    # in one go: a row may be called {{race}}
    page = re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], read("report.html"))
    write_text(path, page)
    return len(page.encode())
