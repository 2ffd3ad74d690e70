"""Reproduce Chapman's figures and tables.

They are computed with this simulator, and misprints of the article are marked.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import add_out_option


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino figures`."""
    add_out_option(parser, "figures")


def run(arguments: argparse.Namespace) -> int:
    """Draw the figures, and write and print the tables."""
    from domino_env.core.files import write_text
    from domino_env.validation.chapman import FIGURES, draw, markdown

    for name in FIGURES:
        draw(name, arguments.out / f"{name}.png")
    tables = markdown()
    write_text(arguments.out / "tables.md", tables)
    print(tables + f"\n{len(FIGURES)} figures and tables.md in {arguments.out}")
    return 0
