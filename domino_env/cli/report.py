"""A page that plays rows against each other in true time, and shows why one wins.

RUN is a folder that `domino optimize` or `domino train` wrote, LAYOUT a .csv or .json file.  The
page is one file that needs no network.
"""

from __future__ import annotations

import argparse

from domino_env.cli.physics_options import add_physics_options, asked_physics

SUMMARY = "a page that races rows against each other"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino report`."""
    parser.add_argument("paths", metavar="RUN|LAYOUT", nargs="+", help="a folder or a layout file")
    add_physics_options(parser, "its physics, and its best uniform row as a rival")
    parser.add_argument("--html", metavar="FILE", help="(report.html, in the run's folder)")


def run(arguments: argparse.Namespace) -> int:
    """Simulate, write the page."""
    from pathlib import Path

    from domino_env.view.race import headline
    from domino_env.view.report import read_racers, write_report

    paths = [Path(name) for name in arguments.paths]
    asked = asked_physics(arguments, *paths)
    racers, title = read_racers(paths, asked.scene, asked.physics if asked.changed else None)
    folder = paths[0] if paths[0].is_dir() else Path()
    target = Path(arguments.html) if arguments.html else folder / "report.html"
    size = write_report(racers, title, target)
    said = headline(racers)
    print(asked.line)
    print(f"{said['who']}: {said['why']}\n{target}: {size / 1e3:.0f} kB")
    return 0
