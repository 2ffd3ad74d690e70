"""Search a layout that beats the best uniform pitch of a scene.

SCENE is the name of a scene that ships (sprint, course, …) or the path of a TOML file.  The folder
of the run holds the scene, the layout (CSV and JSON), the trace of the search, a summary and a
picture.  Ctrl-C ends the search and writes the best so far.
"""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from optimize.budget import Budget

SUMMARY = "search a better row than the best uniform one"
DEFAULT_SECONDS = 30.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `domino optimize`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene's name or .toml file")
    parser.add_argument("--method", default="cma", help="cma (default), l-bfgs, random or uniform")
    parser.add_argument("--evaluations", type=int, help="layouts that may be simulated")
    parser.add_argument(
        "--seconds", type=float, help=f"time that may be spent ({DEFAULT_SECONDS:g})"
    )
    parser.add_argument("--seed", type=int, default=0, help="of all randomness (0)")
    parser.add_argument("--out", metavar="FOLDER", help="the run's folder (runs/SCENE)")


def run(arguments: argparse.Namespace) -> int:
    """Search, write the folder, and say what was found."""
    from pathlib import Path

    from tqdm import tqdm

    from domino_env.scene import load_scene
    from optimize import methods
    from optimize.runs import RunFolder
    from optimize.search import search

    scene = load_scene(arguments.scene)
    methods.load(arguments.method)
    seconds = arguments.seconds
    if seconds is None and arguments.evaluations is None:
        seconds = DEFAULT_SECONDS
    folder = RunFolder(Path(arguments.out or f"runs/{scene.name}"), scene)
    print(f"{scene.name}: {scene.title}")
    mark = scene.uniform()
    gap, thickness = mark.layout.spacing[0] * 1e3, mark.layout.thickness[-1] * 1e3
    print(
        f"best uniform row: gap {gap:.3f} mm, thickness {thickness:.3f} mm, "
        f"{mark.wave.mean_speed:.6f} m/s ({mark.wave.outcome.name.lower()})"
    )
    total = arguments.evaluations if seconds is None else seconds
    with tqdm(
        total=total,
        disable=not sys.stderr.isatty(),
        bar_format="{desc} {percentage:3.0f}%|{bar}| {elapsed} {postfix}",
        desc=arguments.method,
    ) as bar:

        def watch(budget: Budget) -> None:
            folder.watch(budget)
            done = budget.problem.evaluations if seconds is None else budget.elapsed
            bar.n = min(done, total)
            best = budget.best_score
            gain = f", {best / mark.score - 1.0:+.2%}" if best > 0.0 and mark.score > 0.0 else ""
            bar.set_postfix_str(f"best {best:.5f}{gain}")

        result = search(
            scene,
            arguments.method,
            arguments.evaluations,
            arguments.seed,
            seconds=seconds,
            watch=watch,
        )
    folder.finish(result)
    ended = "interrupted after" if result.interrupted else "after"
    gain = f"  {result.gain:+.2%}" if result.score > 0.0 and mark.score > 0.0 else ""
    print(
        f"best row found:   {result.wave.mean_speed:.6f} m/s{gain}  "
        f"({result.wave.outcome.name.lower()}; {result.method}, {ended} {result.evaluations} "
        f"layouts, {result.seconds:.1f} s)"
    )
    print(f"written to {folder.path}: layout.csv, layout.json, trace.csv, summary.json, result.png")
    return 0
