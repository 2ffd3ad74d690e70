"""Draw the figures and tables of Chapman, The physics of toppling dominoes, anew.

Every number comes from this simulator; what is misprinted in the source is marked.
"""

from __future__ import annotations

import argparse

SUMMARY = "Chapman's figures and tables, from our own numbers"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino figures`."""
    parser.add_argument("--out", metavar="FOLDER", default="figures", help="where to (figures)")


def run(arguments: argparse.Namespace) -> int:
    """Draw, write, print the tables."""
    from pathlib import Path

    from domino_env.core.files import write_text
    from domino_env.validation.chapman import FIGURES, draw, markdown

    folder = Path(arguments.out)
    for name in FIGURES:
        draw(name, folder / f"{name}.png")
    tables = markdown()
    write_text(folder / "tables.md", tables)
    print(tables + f"\n{len(FIGURES)} figures and tables.md in {folder}")
    return 0
