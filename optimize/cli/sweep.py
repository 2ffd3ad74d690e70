"""Search many variations of a scene: a grid over keys of its file, or scenes drawn from ranges.

    domino sweep sprint --set physics.friction=0:0.5:11 --set physics.push=4,8,12
    domino sweep sprint --set spacing.min=0.001:0.004 --set row.count=20:80 --random 500

KEY is any key of a scene's file, as scene.toml in a run's folder writes it.  --set takes
KEY=FROM:TO:NUMBER (with :log behind it evenly in the logarithm), KEY=VALUE,VALUE,… or, with
--random, KEY=FROM:TO.  Every point is checked before anything runs.  Results go into the study
store as they come; --resume continues a sweep that was stopped.  The folder gets a page of
Markdown, a table (CSV) and a picture.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from optimize.cli.options import add_study_options, exit_code, opened_study

SUMMARY = "search many variations of a scene, on one machine or many"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino sweep`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene's name or .toml file")
    parser.add_argument(
        "--set", metavar="KEY=VALUES", action="append", default=[], help="what is varied; repeat"
    )
    parser.add_argument(
        "--random", type=int, metavar="N", help="draw N scenes instead of all on the grid"
    )
    parser.add_argument("--seed", type=int, default=0, help="of these draws (0)")
    parser.add_argument("--methods", default="auto", help="names with commas between (auto)")
    parser.add_argument("--seeds", type=int, default=1, help="for each method, from 0 (1)")
    parser.add_argument(
        "--evaluations", type=int, help="layouts that each search may simulate (2000)"
    )
    parser.add_argument("--seconds", type=float, help="time of each search; not repeatable")
    parser.add_argument("--out", metavar="FOLDER", help="for page, table, picture (runs/NAME)")
    add_study_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Check, search, and write the folder."""
    from domino_env.scenes.io.reading import load_scene
    from optimize.experiments.experiment import run_experiment
    from optimize.experiments.report import SWEEP_FILES, write_sweep
    from optimize.experiments.sweep import sweep_tasks

    scene = load_scene(arguments.scene)
    methods = [name.strip() for name in arguments.methods.split(",")]
    tasks = sweep_tasks(
        scene, arguments.set, methods, arguments.seeds, arguments.evaluations, arguments.seconds,
        random=arguments.random, seed=arguments.seed,
    )  # fmt: skip
    settings = {
        "scene": scene.name, "set": arguments.set, "random": arguments.random,
        "seed": arguments.seed, "methods": methods, "seeds": arguments.seeds,
        "evaluations": tasks[0].evaluations, "seconds": arguments.seconds,
    }  # fmt: skip
    out = None if arguments.out is None else Path(arguments.out)
    name = f"sweep-{scene.name}"
    with opened_study(arguments, "sweep", name, tasks, settings, out) as (study, how):
        folder = out or Path(f"runs/{study.name}")
        before = f", {study.tasks} of them done before" if study.tasks else ""
        print(
            f"study '{study.name}' in {arguments.store}: {len(tasks)} searches{before}", flush=True
        )
        found = run_experiment(tasks, **how)
        write_sweep(found, folder, scene)
        print(f"{len(found.results)} results; written to {folder}: {', '.join(SWEEP_FILES)}")
        return exit_code(found)
