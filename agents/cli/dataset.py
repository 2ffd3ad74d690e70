"""Write a dataset of scenes, of the best layouts of searches, and of episodes that build them.

FOLDER receives layouts.parquet, episodes/ in Minari's format (uniform, noisy, searched) and
README.md, which describes them. 5000 scenes take some tens of minutes of one core; --workers
distributes the searches. The same command continues a stopped one. Needs the extra "minari".
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import NATURAL, SEED, folder, number
from optimize.executors import add_executor_options, open_executor

SUMMARY = "write scenes with searched layouts and episodes"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino dataset`."""
    parser.add_argument("folder", type=folder, metavar="FOLDER", help="folder to write to")
    parser.add_argument(
        "--distribution", metavar="NAME", default="varied",
        help="varied (default), varied-thickness, varied-course, or the path of a TOML file",
    )  # fmt: skip
    parser.add_argument(
        "--scenes", type=NATURAL, metavar="N", default=5000, help="number of scenes (5000)"
    )
    parser.add_argument("--seed", type=SEED, default=0, help="seed of all randomness (0)")
    parser.add_argument(
        "--budget", type=NATURAL, metavar="N", default=600, help="evaluations of each search (600)"
    )
    parser.add_argument(
        "--noise", type=number(low=0.0), metavar="SD", default=0.1,
        help="standard deviation of the noise on actions, which are from -1 to 1 (0.1)",
    )  # fmt: skip
    parser.add_argument(
        "--code-link", metavar="URL", help="URL of the code, stored in the Minari datasets"
    )
    add_executor_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the dataset and print its card."""
    from agents.dataset import make_dataset

    with open_executor(arguments.workers, arguments.dask) as executor:
        card = make_dataset(
            arguments.folder, arguments.distribution, arguments.scenes, arguments.seed,
            arguments.budget, executor, noise=arguments.noise, code_link=arguments.code_link,
            progress=None,
        )  # fmt: skip
    print(card.read_text("utf-8"))
    return 0
