"""Compare search methods over seeds, with equal budgets.

They are compared with each other and with the uniform baseline. SCENE is the name of a shipped
scene, a .toml file, or `all`. The folder receives a page of Markdown (one table per scene: score,
gain over uniform, shortfall from the best known, time to 1 % and 0.1 % of it), the runs as CSV, and
a picture of the shortfall against run time. Ctrl-C ends it with the runs that are complete. `domino
studies export` writes their layouts and traces too.

Every run is stored in the study at once; --resume continues a comparison that was stopped. Runs are
independent: --workers or --dask distribute them. With --budget the results are bitwise
reproducible; equal --seconds are fair only on cores without other work.

Trained agents (agent:RUN, whose time includes the training) and your own methods
(package.module:function, in this folder or installed) run only if --methods names them.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import NATURAL, add_options, add_out_option
from optimize.cli import options

DEFAULT_SECONDS = 4.0  # [s]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino compare`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="+", help="name, .toml file, or all")
    add_options(
        parser,
        ("methods", options.split_names, "NAME,...", None, "methods (all that are installed)"),
        ("seeds", NATURAL, "N", 5, "number of seeds"),
    )
    options.add_limit_options(parser, "each run", seconds=f"{DEFAULT_SECONDS:g} without --budget")
    add_out_option(parser, "runs/NAME", literal=False)
    options.add_study_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run or continue the comparison, print its tables and write the folder."""
    from domino_env.scenes.io.reading import load_scene, scene_names
    from optimize.experiments.compare import known_score, plan_tasks
    from optimize.methods import registry

    names = scene_names() if arguments.scenes == ["all"] else arguments.scenes
    scenes = [load_scene(name) for name in names]
    methods = arguments.methods or [*registry.METHODS, *registry.installed_third_party()]
    if arguments.seconds is None and arguments.budget is None:
        arguments.seconds = DEFAULT_SECONDS
    tasks = plan_tasks(
        [(scene, {}) for scene in scenes], methods, range(arguments.seeds), arguments.budget,
        arguments.seconds,
    )  # fmt: skip
    default = f"compare-{scenes[0].name if len(scenes) == 1 else f'{len(scenes)}-scenes'}"
    return options.run_study(arguments, "comparison", default, tasks, known_score=known_score)
