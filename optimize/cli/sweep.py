"""Search many variations of a scene: a grid over keys of its file, or points sampled from ranges.

    domino sweep sprint --set physics.friction=0:0.5:11 --set physics.push=4,8,12
    domino sweep sprint --set spacing.min=0.001:0.004 --set row.count=20:80 --random 500

KEY is any key of a scene file, see scene.toml in the folder of a run. --set takes
KEY=FROM:TO:NUMBER (with :log at the end evenly in the logarithm), KEY=VALUE,VALUE,… or, with
--random, KEY=FROM:TO. Every point is checked before anything runs. Results are stored in the study
at once; --resume continues a sweep that was stopped. The folder receives a page of Markdown, a
table (CSV) and a picture.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import NATURAL, SEED, add_out_option
from optimize.cli.options import (
    add_limit_options,
    add_methods_option,
    add_study_options,
    run_study,
)

SUMMARY = "search many variations of a scene"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino sweep`."""
    parser.add_argument("scene", metavar="SCENE", help="name of a scene, or .toml file")
    parser.add_argument(
        "--set", metavar="KEY=VALUES", action="append", default=[], help="vary a key; repeatable"
    )
    parser.add_argument(
        "--random", type=NATURAL, metavar="N", help="sample N points instead of all of the grid"
    )
    parser.add_argument("--seed", type=SEED, default=0, help="seed of these points (0)")
    add_methods_option(parser, "auto", ["auto"])
    parser.add_argument(
        "--seeds", type=NATURAL, metavar="N", default=1, help="number of seeds of each method (1)"
    )
    add_limit_options(parser, "each search", budget="2000 without --seconds")
    add_out_option(parser, "runs/NAME", literal=False)
    add_study_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Check, search, and write the folder."""
    from optimize.experiments.report import write_sweep
    from optimize.experiments.sweep import plan_sweep

    tasks = plan_sweep(
        arguments.scene, arguments.set, arguments.methods, arguments.seeds, arguments.budget,
        arguments.seconds, random=arguments.random, seed=arguments.seed,
    )  # fmt: skip
    return run_study(arguments, "sweep", f"sweep-{tasks[0].scene_name}", tasks, write_sweep)
