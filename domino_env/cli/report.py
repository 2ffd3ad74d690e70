"""Write a page that compares layouts in an animation.

It explains why one is faster. RUN is a folder written by `domino optimize` or `domino train`,
LAYOUT is a .csv or .json file. The page is one HTML file and needs no network.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from domino_env.cli import options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino report`."""
    text = "run folder, or layout file"
    parser.add_argument("paths", metavar="RUN|LAYOUT", type=Path, nargs="+", help=text)
    options.add_physics_options(parser, uniform=True)
    page = "output file (report.html, in RUN if that comes first)"
    options.add_options(parser, ("html", options.output(".html"), "FILE", None, page))


def run(arguments: argparse.Namespace) -> int:
    """Simulate the layouts and write the page."""
    from domino_env.view.comparison import headline
    from domino_env.view.report import read_compared, write_report

    paths = arguments.paths
    chosen = options.chosen_physics(arguments, *paths)
    folder = paths[0] if paths[0].is_dir() else Path()
    target = arguments.html or folder / "report.html"
    options.require_output(target, ".html")
    compared, title = read_compared(paths, chosen.scene, chosen.other_physics)
    size = write_report(compared, title, target)
    result = headline(compared)
    print(f"{chosen.line}\n{result['winner']}: {result['results']}\n{target}: {size / 1e3:.0f} kB")
    return 0
