"""Search a layout that scores better than the best uniform layout of a scene.

SCENE is the name of a scene that ships (sprint, course, …) or a .toml file. The folder of the run
receives the scene, the best layout (CSV and JSON), the trace of the search, a summary and a
picture; a folder that holds a run already is refused without --resume. Ctrl-C ends the search and
writes the best layout so far. --resume continues it, after a kill too, or with a larger budget; the
result is that of an undisturbed search.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from domino_env.cli.options import add_out_option
from optimize.cli.options import add_limit_options
from optimize.executors import add_executor_options, executor_from

if TYPE_CHECKING:
    from domino_env.scenes.scene import Scene
    from optimize.result import SearchResult

SUMMARY = "search a layout better than the best uniform one"
MARKED = 1e-6  # a smaller relative distance to the best known is none


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino optimize`."""
    parser.add_argument("scene", metavar="SCENE", help="name of a scene, or .toml file")
    parser.add_argument(
        "--method", default="auto",
        help="auto (default), cma, l-bfgs, slsqp, scp, …, or package.module:function",
    )  # fmt: skip
    add_limit_options(parser, "the search")
    parser.add_argument("--seed", type=int, default=0, help="seed of all randomness (0)")
    add_out_option(parser, "runs/SCENE", literal=False)
    parser.add_argument(
        "--resume", action="store_true",
        help="continue the search in the folder; the time it has spent counts",
    )  # fmt: skip
    parser.add_argument(
        "--update-best", action="store_true", help="keep a new best known layout in the package"
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
    with executor_from(arguments) as executor:
        result = search(
            scene,
            arguments.method,
            arguments.budget,
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
