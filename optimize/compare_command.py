"""Compare methods with each other and with the best uniform pitch, over seeds, with equal budgets.

SCENE is the name of a scene that ships, a .toml file, or `all`.  The folder gets a page of Markdown
(a table a scene: score, gain over uniform, gap to the best known, time to 1 % and 0.1 % of it), the
runs and their traces as CSV, and two pictures: the gap against run time, and the part of a ladder
of targets that was reached.  Ctrl-C ends it with the runs that are complete.

Runs are independent: --workers or --dask spread them.  With --evaluations the results can be
repeated to the bit; equal --seconds are equal chances only where there are no more workers than
cores and nothing else to do.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from optimize.engine_options import add_engine_options, asked_engine

if TYPE_CHECKING:
    from optimize.result import SearchResult

SUMMARY = "compare search methods over seeds, with equal budgets"
DEFAULT_SECONDS = 10.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `domino compare`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="+", help="names, .toml files, or all")
    parser.add_argument(
        "--methods", help="names with commas between (all, and the peers that are installed)"
    )
    parser.add_argument("--seeds", type=int, default=5, help="how many, from 0 (5)")
    parser.add_argument(
        "--seconds", type=float, help=f"for each run ({DEFAULT_SECONDS:g}), or instead:"
    )
    parser.add_argument("--evaluations", type=int, help="rows that each run may simulate")
    parser.add_argument("--out", metavar="FOLDER", default="runs/comparison", help="%(default)s")
    add_engine_options(parser)
    parser.add_argument(
        "--update-best",
        action="store_true",
        help="write new records of scenes that ship into optimize/best_known.json",
    )


def run(arguments: argparse.Namespace) -> int:
    """Compare, write the folder, print the tables."""
    from domino_env.scene import load_scene, scene_names
    from optimize import best_known, methods
    from optimize.comparison import compare
    from optimize.comparison_page import FILES, table, write

    names = scene_names() if arguments.scenes == ["all"] else arguments.scenes
    scenes = [load_scene(name) for name in names]
    if arguments.methods is None:
        chosen = [*methods.METHODS, *methods.installed_peers()]
    else:
        chosen = [name.strip() for name in arguments.methods.split(",")]
    for name in chosen:
        methods.load(name)
    if arguments.seeds < 1:
        raise ValueError(f"--seeds {arguments.seeds}: give at least one")
    seconds, evaluations = arguments.seconds, arguments.evaluations
    if seconds is None and evaluations is None:
        seconds = DEFAULT_SECONDS
    seeds, total = range(arguments.seeds), len(scenes) * len(chosen) * arguments.seeds
    with asked_engine(arguments) as executor:
        at_a_time = getattr(executor, "workers", 1)
        if seconds is not None:
            turns = -(-total // at_a_time)
            print(f"{total} runs of {seconds:g} s: {turns * seconds / 60.0:.1f} min", flush=True)
        else:
            print(f"{total} runs of {evaluations} rows", flush=True)
        comparison = compare(
            scenes, chosen, seeds, seconds, _tell, evaluations=evaluations, executor=executor,
            progress=None,
        )  # fmt: skip
    folder = Path(arguments.out)
    write(comparison, folder)
    for name in comparison.scenes:
        print(f"\n{name}\n" + "\n".join(table(comparison, name)))
    print(f"\nwritten to {folder}: {', '.join(FILES)}")
    if arguments.update_best:
        shipped = [r for r in comparison.results if r.scene.name in scene_names()]
        improved = best_known.update(shipped)
        print(f"new records: {', '.join(improved) or 'none'}")
    for failure in comparison.failures:
        print(f"domino: {failure.task.name} failed: {failure.reason}", file=sys.stderr)
    if comparison.interrupted:
        done = len(comparison.results)
        raise KeyboardInterrupt(f"interrupted: the folder holds the {done} runs that are complete")
    return 1 if comparison.failures else 0


def _tell(result: SearchResult) -> None:
    gain = "" if result.gain is None else f", {result.gain:+.2%}"
    print(
        f"{result.scene.name}, {result.method}, seed {result.seed}: {result.score:.6f}{gain} "
        f"({result.evaluations} rows)",
        flush=True,
    )
