"""Search many variations of a scene.

    domino sweep sprint --set physics.friction=0:0.5:11 --set physics.push=4,8,12

KEY is any key of a scene file, see scene.toml in the folder of a run. --set takes
KEY=FROM:TO:NUMBER, evenly spaced values (with :log at the end evenly in their logarithms), or
KEY=VALUE,VALUE,…. All points are checked before the first search. Results are stored in the study
at once; --resume continues a sweep that was stopped. The folder receives a page of Markdown, a
table (CSV) and a picture.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import NATURAL, add_options, add_out_option
from optimize.cli import options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino sweep`."""
    parser.add_argument("scene", metavar="SCENE", help="name of a scene, or .toml file")
    parser.add_argument(
        "--set", metavar="KEY=VALUES", action="append", default=[], help="vary a key; repeatable"
    )
    add_options(
        parser,
        ("methods", options.split_names, "NAME,...", "auto", "methods"),
        ("seeds", NATURAL, "N", 1, "number of seeds of each method"),
    )
    options.add_limit_options(parser, "each search", budget="2000 without --seconds")
    add_out_option(parser, "runs/NAME", literal=False)
    options.add_study_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Check all points, run or continue the searches, and write the folder."""
    from optimize.experiments.sweep import plan_sweep

    tasks = plan_sweep(
        arguments.scene, arguments.set, arguments.methods, arguments.seeds, arguments.budget,
        arguments.seconds,
    )  # fmt: skip
    return options.run_study(arguments, "sweep", f"sweep-{tasks[0].scene_name}", tasks)
