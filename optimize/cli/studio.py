"""Design a row in the browser: drag, push, improve, print.

SOURCE is a scene (its name or .toml file), a layout (.csv or .json), the folder of a run, or a link
of the page. The page is served on this machine only, until its last tab is closed or until Ctrl-C.
"""

from __future__ import annotations

import argparse
from contextlib import suppress

from domino_env.cli.options import add_flags, add_options, number


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino studio`."""
    parser.add_argument(
        "source", metavar="SOURCE", nargs="?", default="course",
        help="scene, layout, run folder or link (course)",
    )  # fmt: skip
    port = number(whole=True, low=0, high=65535)
    add_options(parser, ("port", port, "N", 0, "port on this machine; 0: a free one"))
    add_flags(parser, no_browser="print the address only")


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until it is closed."""
    import webbrowser

    from optimize.interactive.server import studio

    def open_page(url: str) -> None:
        print(f"{url}\nclose its last tab, or press Ctrl-C here, to end it", flush=True)
        if not arguments.no_browser:
            webbrowser.open(url)

    with suppress(KeyboardInterrupt):
        studio(arguments.source, arguments.port).serve(open_page)
    return 0
