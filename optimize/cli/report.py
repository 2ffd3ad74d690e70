"""Write the page with the rows of runs.

It compares them and explains why one is faster: races, curves of energy, of search and of training,
and verifications. RUN is a folder written by `domino optimize` or `domino train`, LAYOUT is a .csv
or .json file, or a link of the page.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from domino_env.cli import options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino report`."""
    text = "run folder, layout file, or link of the page"
    parser.add_argument("paths", metavar="RUN|LAYOUT", type=Path, nargs="+", help=text)
    options.add_physics_options(parser, uniform=True)
    page = "output file (report.html, in RUN if that comes first)"
    options.add_options(parser, ("html", options.output(".html"), "FILE", None, page))


def run(arguments: argparse.Namespace) -> int:
    """Simulate the layouts and write the page."""
    from domino_env.scenes.io.link import is_link
    from domino_env.view.compared import read_compared
    from optimize.studio.report import headline, write_report

    paths = arguments.paths
    chosen = options.chosen_physics(arguments, *paths)
    folder = Path() if is_link(paths[0]) or not paths[0].is_dir() else paths[0]
    target = arguments.html or folder / "report.html"
    options.require_output(target, ".html")
    compared = read_compared(paths, chosen.scene, chosen.other_physics)
    size = write_report(compared, target)
    print(f"{chosen.line}\n{headline(compared)}\n{target}: {size / 1e3:.0f} kB")
    return 0
