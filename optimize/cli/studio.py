"""Design a row in the browser: drag, push, improve, print.

SOURCE is a scene (its name or .toml file), a layout (.csv or .json), the folder of a run, or a link
of the page. The page is one HTML file, which needs neither network nor server.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import add_flags, add_options, output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino studio`."""
    parser.add_argument(
        "source", metavar="SOURCE", nargs="?", default="course",
        help="scene, layout, run folder or link (course)",
    )  # fmt: skip
    page = "file of the page, which is kept; by default a temporary one"
    add_options(parser, ("out", output(".html"), "FILE", None, page))
    add_flags(parser, no_browser="write the page without opening it")


def run(arguments: argparse.Namespace) -> int:
    """Write the page and open it."""
    from optimize.studio.page import studio

    page = studio(arguments.source)
    print((page.save if arguments.no_browser else page.open)(arguments.out))
    return 0
