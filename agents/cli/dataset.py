"""Data to learn from: scenes, the rows that search finds for them, episodes that build these.

Writes rows.parquet, episodes/ in Minari's format (uniform, noisy, searched) and README.md, which
says what they are. 5000 scenes take some tens of minutes of one core; --workers shares them, and
the same command goes on where it was stopped. Needs the extra "minari".
"""

from __future__ import annotations

import argparse

from optimize.executors import add_executor_options, asked_executor

SUMMARY = "scenes with searched rows and episodes, to learn from"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino dataset`."""
    parser.add_argument("folder", metavar="FOLDER", help="where it is written")
    parser.add_argument(
        "--of",
        metavar="NAME",
        default="varied",
        help="scenes to draw: varied (default), varied-thickness, varied-course, a file",
    )
    parser.add_argument("--scenes", type=int, default=5000, metavar="N", help="how many (5000)")
    parser.add_argument("--seed", type=int, default=0, help="of draws, searches and noise (0)")
    parser.add_argument(
        "--search", type=int, default=600, metavar="E", help="evaluations of each search (600)"
    )
    parser.add_argument(
        "--noise", type=float, default=0.1, help="of the actions of noisy episodes (0.1)"
    )
    add_executor_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Make it, and say where it is."""
    from agents.dataset import make_dataset

    with asked_executor(arguments) as executor:
        card = make_dataset(
            arguments.folder, arguments.of, arguments.scenes, arguments.seed, arguments.search,
            executor, noise=arguments.noise, progress=None,
        )  # fmt: skip
    print(card.read_text("utf-8"))
    return 0
