"""Write scenes with searched layouts and episodes.

FOLDER receives layouts.parquet, episodes/ in Minari's format (uniform, noisy, searched) and
README.md, which describes them. 5000 scenes take some tens of minutes on one core; --workers
distributes the searches. The same command continues after an interruption. The command needs the
extra "minari".
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import NATURAL, SEED, add_options, folder, number
from optimize.cli.options import add_executor_options
from optimize.executors import open_executor


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino dataset`."""
    parser.add_argument("folder", type=folder, metavar="FOLDER", help="folder to write to")
    names = "varied, varied-thickness, varied-course, or the path of a TOML file"
    noise = "standard deviation of the noise on actions, which are from -1 to 1"
    add_options(
        parser,
        ("distribution", str, "NAME", "varied", names),
        ("scenes", NATURAL, "N", 5000, "number of scenes"),
        SEED,
        ("budget", NATURAL, "N", 600, "evaluations of each search"),
        ("noise", number(low=0.0, high=1.0), "SD", 0.1, noise),
    )
    add_executor_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the dataset and print its README.md."""
    from agents.dataset import make_dataset

    with open_executor(arguments.workers, arguments.dask) as executor:
        card = make_dataset(
            arguments.folder, arguments.distribution, arguments.scenes, arguments.seed,
            arguments.budget, executor, noise=arguments.noise, progress=None,
        )  # fmt: skip
    print(card.read_text("utf-8"))
    return 0
