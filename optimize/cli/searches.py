"""Search for a layout that is better than the uniform baseline.

SCENE is the name of a shipped scene (sprint, course, …) or a .toml file. The folder of the run
receives the scene, the best layout (CSV and JSON), the trace of the search, a summary and a
picture; a folder that contains a run is rejected without --resume. Ctrl-C ends the search and
writes the best layout so far. --resume continues a search that was stopped or killed, also with a
larger budget; the result is that of a search that was never stopped. If pieces are drawn in random
order (`draw`), the search chooses their order, which a builder cannot do.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from domino_env.cli import options
from domino_env.core.files import amount
from optimize.cli.options import add_executor_options, add_limit_options
from optimize.executors import open_executor

if TYPE_CHECKING:
    from domino_env import Scene, Wave
    from optimize.result import SearchResult

EQUAL_SCORE = 1e-6  # relative shortfall from the best known that counts as none


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino optimize`."""
    parser.add_argument("scene", metavar="SCENE", help="name of a scene, or .toml file")
    methods = "auto, cma, l-bfgs, slsqp, scp, …, or package.module:function"
    tolerance = (
        "relative gain of the second half of the evaluations below which the search ends "
        "(1e-4 without a limit)"
    )
    options.add_options(parser, ("method", str, "NAME", "auto", methods))
    add_limit_options(parser, "the search")
    reader = options.number(above=0.0, below=1.0)
    options.add_options(parser, ("tolerance", reader, "GAIN", None, tolerance), options.SEED)
    options.add_out_option(parser, "runs/SCENE", literal=False)
    resume = "continue the search in the folder; the time it has spent counts"
    options.add_flags(parser, resume=resume)
    add_executor_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Search, write the folder, and print the result."""
    from domino_env.scenes.io.reading import load_scene, scene_names
    from optimize.methods.registry import load
    from optimize.run_folder import FILES
    from optimize.searching import search

    load(arguments.method)  # raises for an unknown method, before the scene is printed
    scene = load_scene(arguments.scene)
    folder = arguments.out or f"runs/{scene.name}"
    print(f"{scene.name}: {scene.title}", flush=True)
    if scene.hand:
        print(f"order of pieces:  chosen; in environments it is random, with {scene.hand} in hand")
    with open_executor(arguments.workers, arguments.dask) as executor:
        result = search(
            scene, arguments.method, arguments.budget, arguments.seed, seconds=arguments.seconds,
            tolerance=arguments.tolerance, folder=folder, executor=executor,
            resume=arguments.resume,
        )  # fmt: skip
    print(f"uniform baseline: {_uniform(result)}")
    print(f"best found:       {_best(result)}")
    print(f"the search ended: {result.stop_reason}")
    if scene.name in scene_names() and load_scene(scene.name) == scene:
        print(f"best known:       {_best_known(result)}")
    print(f"written to {folder}: {', '.join(FILES)}")
    return 0


def _uniform(result: SearchResult) -> str:
    """Return the score, the sizes and the outcome of the uniform baseline as a text."""
    scene, uniform = result.scene, result.uniform
    gap, thickness = uniform.layout.spacing[0] * 1e3, uniform.layout.thickness[-1] * 1e3
    score, kind = scene.format_score(uniform.score, uniform.wave), _kind(scene, uniform.wave)
    return f"{score}, gaps {gap:.3f} mm, thickness {thickness:.3f} mm ({kind})"


def _kind(scene: Scene, wave: Wave) -> str:
    """Return the outcome of a wave, or the statistic over draws of errors that the score is."""
    placement = scene.placement
    if placement is None or not placement.draws:
        return wave.outcome.name
    name = "mean" if placement.quantile is None else f"{placement.quantile:.0%} quantile"
    return f"{name} over {placement.draws} draws"


def _best_known(result: SearchResult) -> str:
    """Return the score of the best known layout, and the shortfall of a search, as a text."""
    from optimize.experiments.best_known import MIN_GAIN, accurate_score, best_known_of

    scene, best = result.scene, best_known_of(result.scene)
    if best is None:
        return "none so far"
    score = scene.format_score(best.score, scene.simulate(best.layout))
    shortfall = (best.score - accurate_score(scene, result.layout)) / abs(best.score)
    if shortfall < -MIN_GAIN:
        return f"{score}: this search is better"
    is_relative = not scene.criterion.shows_errors
    difference = f"shortfall {shortfall:.4%}" if is_relative else "not reached"
    difference = "reached" if shortfall < EQUAL_SCORE else difference
    return f"{score}, by {best.method}: {difference}"


def _best(result: SearchResult) -> str:
    """Return the score of the best layout of a search, and its effort, as a text."""
    wave, score = result.wave, result.scene.format_score(result.score, result.wave)
    gain, is_relative = result.gain, not result.scene.criterion.shows_errors
    gain_text = f", {gain:+z.2%}" if gain is not None and is_relative else ""
    prefix = "interrupted after " if result.interrupted else ""
    text = (
        f"{score}{gain_text} ({_kind(result.scene, wave)}; {result.method}, seed {result.seed}, "
        f"{prefix}{amount(result.evaluations, 'layout')} in {result.seconds:.1f} s)"
    )
    return text if result.score > 0.0 else f"{text}\n{wave.explanation}"
