"""Compare methods with each other and with the best uniform pitch, over seeds, with equal clocks.

SCENE is the name of a scene that ships, a .toml file, or `all`.  The folder gets a page of Markdown
(a table a scene: score, gain over uniform, gap to the best known, time to 1 % and 0.1 % of it), the
runs and their traces as CSV, and two pictures: the gap against run time, and the part of a ladder
of targets that was reached.  Ctrl-C ends it with the runs that are complete.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from optimize.result import SearchResult

SUMMARY = "compare search methods over seeds, with equal clocks"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `domino compare`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="+", help="names, .toml files, or all")
    parser.add_argument(
        "--methods", help="names with commas between (all, and the peers that are installed)"
    )
    parser.add_argument("--seeds", type=int, default=5, help="how many, from 0 (5)")
    parser.add_argument("--seconds", type=float, default=10.0, help="for each run (10)")
    parser.add_argument("--out", metavar="FOLDER", default="runs/comparison", help="%(default)s")
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
    total = len(scenes) * len(chosen) * arguments.seeds
    print(f"{total} runs of {arguments.seconds:g} s: {total * arguments.seconds / 60.0:.1f} min")
    comparison = compare(scenes, chosen, range(arguments.seeds), arguments.seconds, _tell)
    folder = Path(arguments.out)
    write(comparison, folder)
    for name in comparison.scenes:
        print(f"\n{name}\n" + "\n".join(table(comparison, name)))
    print(f"\nwritten to {folder}: {', '.join(FILES)}")
    if arguments.update_best:
        shipped = [r for r in comparison.results if r.scene.name in scene_names()]
        improved = best_known.update(shipped)
        print(f"new records: {', '.join(improved) or 'none'}")
    return 0


def _tell(result: SearchResult) -> None:
    gain = "" if result.gain is None else f", {result.gain:+.2%}"
    print(
        f"{result.scene.name}, {result.method}, seed {result.seed}: {result.score:.6f}{gain} "
        f"({result.evaluations} rows)",
        flush=True,
    )
