"""Search a row that beats the best uniform pitch of a scene, and write it down.

SCENE is the name of a scene that ships (sprint, course, …) or the path of a TOML file.  The folder
of the run holds the scene, the best row (CSV and JSON), the trace of the search, a summary and a
picture; one that holds a run already is refused.  Ctrl-C ends the search and writes the best so
far; --resume goes on from there, after a kill too, or further with a larger budget, and comes to
what an undisturbed search would have.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from optimize.executors import add_executor_options, asked_executor

if TYPE_CHECKING:
    from domino_env.scenes.scene import Scene
    from optimize.result import SearchResult

SUMMARY = "search a better row than the best uniform one"
MARKED = 1e-6  # a smaller relative distance to the best known is none


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino optimize`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene's name or .toml file")
    parser.add_argument(
        "--method",
        default="auto",
        help="auto (default), cma, l-bfgs, slsqp, scp, …, or package.module:function",
    )
    parser.add_argument(
        "--evaluations", type=int, help="layouts that may be simulated (until the search is done)"
    )
    parser.add_argument("--seconds", type=float, help="time that may be spent (the same)")
    parser.add_argument("--seed", type=int, default=0, help="of all randomness (0)")
    parser.add_argument("--out", metavar="FOLDER", help="the run's folder (runs/SCENE)")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on with the search in the folder; its seconds so far count",
    )
    parser.add_argument(
        "--update-best",
        action="store_true",
        help="write a new record into the package",
    )
    add_executor_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Search, write the folder, and say what was found."""
    from domino_env.scenes.io.reading import load_scene, scene_names
    from optimize.experiments.best_known import update
    from optimize.run_folder import FILES
    from optimize.searching import search

    scene = load_scene(arguments.scene)
    folder = arguments.out or f"runs/{scene.name}"
    print(f"{scene.name}: {scene.title}", flush=True)
    with asked_executor(arguments) as executor:
        result = search(
            scene,
            arguments.method,
            arguments.evaluations,
            arguments.seed,
            seconds=arguments.seconds,
            folder=folder,
            executor=executor,
            resume=arguments.resume,
        )
    print(f"best uniform row: {_uniform(scene)}")
    print(f"best row found:   {_found(result)}")
    print(f"the search ended: {result.ended}")
    if scene.name in scene_names() and load_scene(scene.name) == scene:
        print(f"best known:       {_against_best_known(result)}")
        if arguments.update_best:
            print(f"new records: {', '.join(update([(scene, result)])) or 'none'}")
    print(f"written to {folder}: {', '.join(FILES)}")
    return 0


def _uniform(scene: Scene) -> str:
    mark = scene.uniform()
    gap, thickness = mark.layout.spacing[0] * 1e3, mark.layout.thickness[-1] * 1e3
    worth = scene.in_words(mark.score, mark.wave)
    return f"{worth}, gaps {gap:.3f} mm, thickness {thickness:.3f} mm ({mark.wave.outcome.name})"


def _against_best_known(result: SearchResult) -> str:
    from optimize.experiments.best_known import NOTICED, best_known, closest_score

    scene, record = result.scene, best_known().get(result.scene.name)
    if record is None:
        return "none so far"
    worth = scene.in_words(record.score, scene.simulate(record.layout))
    lead = closest_score(scene, result.layout) - record.score
    if lead > NOTICED * abs(record.score):
        return f"{worth}: a new record, for --update-best to keep"
    short = -lead / abs(record.score)
    return f"{worth}, by {record.method}: " + (
        "reached" if short < MARKED else f"{short:.4%} short"
    )


def _found(result: SearchResult) -> str:
    wave = result.wave
    worth = result.scene.in_words(result.score, wave)
    # of a score without a unit, the ratio says nothing
    gain = "" if result.gain is None or not result.scene.unit else f", {result.gain:+.2%}"
    ended = "interrupted after " if result.interrupted else ""
    text = (
        f"{worth}{gain} ({wave.outcome.name}; {result.method}, seed {result.seed}, "
        f"{ended}{result.evaluations} layouts in {result.seconds:.1f} s)"
    )
    return text if result.score > 0.0 else f"{text}\n{wave.explanation}"
