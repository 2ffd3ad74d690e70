"""Function `search`, which runs one method on one scene within limits."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from domino_env.core.checks import as_path, require
from domino_env.core.progress import progress_bar
from domino_env.core.results import versions
from domino_env.core.types import Floats
from domino_env.kernels.jit.interpreted import compiled
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.rigid.simulation import simulate_standing
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.objectives import Scores
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import UniformBaseline, best_point
from domino_env.scenes.uniform_layouts import UniformLayouts
from optimize.evaluator import TOLERANCE, BudgetSpent, Evaluator, require_options
from optimize.journal import Journal
from optimize.methods import registry
from optimize.methods.registry import Method
from optimize.problem import GRADIENT_RTOL, Problem
from optimize.result import SearchResult
from optimize.run_folder import JOURNAL, begin_run, write_run

Callback = Callable[[Evaluator], None]

NO_SUCCESS = "no layout succeeds: push harder, or allow other gaps, thicknesses or friction"
# line of progress on a terminal, and elsewhere
BAR_FORMAT = "{desc} {percentage:3.0f}%|{bar}| {elapsed}, at most {remaining} left{postfix}"
PLAIN_FORMAT = "{desc} {percentage:.0f} %, {elapsed}{postfix}"
SHORT = 2_000  # budget times dominoes up to which a search without compilation takes less time
BASELINE_SHARE = 0.5  # fraction of the seconds of a search for the uniform baseline on a floor


def search(
    scene: Scene | str | Path,
    method: str | Method = "auto",
    budget: int | None = None,
    seed: int | None = None,
    *,
    rng: int | np.random.Generator | None = None,
    seconds: float | None = None,
    tolerance: float | None = None,
    progress: bool | None = None,
    folder: str | Path | None = None,
    callback: Callback = lambda _: None,
    executor: Executor | None = None,
    resume: bool = False,
    clock: Callable[[], float] = time.perf_counter,
    seconds_before: float = 0.0,
) -> SearchResult:
    """Search for a layout of a scene that is better than the uniform baseline.

    A search ends when its method is done; budget and seconds limit it, and `auto` uses them fully
    unless it meets a schedule. Without a limit it also ends
    when doubling its time is expected to gain less than a tolerance. Ctrl-C ends the search with
    the best layout so far.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    method
        One of `METHODS`, or your own: a function `run(evaluator, rng)`, or its name as
        "package.module:function".
    budget
        Largest number of layouts that may be simulated; None for no limit. With a small budget
        nothing is compiled before the search, see `domino_env.compiled`. At the end the best
        few are simulated again at a tighter tolerance, which is not counted. On a floor only the
        free-standing simulations count, not the analytic ones that select their layouts.
    seed
        Seed of all randomness; None for 0. Without a limit of seconds, the same seed gives bitwise
        the same result for any number of threads.
    rng
        Random numbers, in place of `seed`: a whole number, which is a seed, or a generator, which
        the search uses and advances. None for `seed`, so that a search without both is
        reproducible. A search with a generator has no seed, and cannot be resumed.
    seconds
        Time that may be spent [s], including that of the uniform baseline if the scene object does
        not have it yet; None for no limit. If it is given on a floor, the uniform baseline counts
        as the first evaluation.
    tolerance
        Relative gain of the second half of the search below which it ends, after at least some
        12 s (for up to 250 dominoes) and at most some 13 s times 1e-4 / tolerance. None for 1e-4
        without a budget or seconds, and for no such end with them.
    progress
        True for a line with the best score so far, False for none; None for one on a terminal, and
        elsewhere a new line from time to time.
    folder
        Folder to write the run to, see `optimize.run_folder`; None to write nothing.
    callback
        Function that is called with the `Evaluator` after every batch; it does nothing by default.
    executor
        Executor that simulates batches of thousands of layouts, see `optimize.executors`; smaller
        ones are not sent. None for threads of this process. The result is bitwise the same.
    resume
        True to continue the search in the folder from where its journal ends (from the start if
        there is none), or with a larger budget. The result is bitwise that of a search that was
        never stopped; earlier seconds count.
    clock
        Function that returns seconds, such as `time.process_time`: processor time, which does not
        include other work of the machine.
    seconds_before
        Time that counts as spent before the search [s], such as that of a uniform baseline which
        several searches share.

    Returns
    -------
    SearchResult
        The best layout, beside the uniform baseline.

    Raises
    ------
    ValueError
        If method or scene are unknown, the method evaluates nothing, a number is out of its range,
        `seed` and `rng` are both given,
        the scene has no free values, the folder holds a run or, with `resume`, another search or
        more evaluations of this one, or the result cannot be written.
    TypeError
        If an argument is of another type.
    ImportError
        If the method needs a package that is not installed.
    ExecutorLost
        If the executor has ended.
    KeyboardInterrupt
        If Ctrl-C ends the search before its first evaluation.

    Examples
    --------
    >>> from optimize import search
    >>> result = search("sprint", budget=500)
    >>> round(result.score, 4), round(result.gain, 3)
    (0.8285, 0.032)
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    run, method = registry.load(method), registry.method_name(method)
    seed, rng = _generator(seed, rng)
    require("budget", budget, 1, whole=True, optional=True)
    require("seconds", seconds, above=0.0, unit="s", optional=True)
    require_options(tolerance, callback, executor, clock)
    require("seconds_before", seconds_before, 0.0, unit="s")
    if resume and folder is None:
        raise ValueError("resume = True without a folder: give the folder of the search")
    if resume and seed is None:
        raise ValueError("resume = True with a generator: a search resumes from its seed, give one")
    if tolerance is None and budget is None and seconds is None:
        tolerance = TOLERANCE
    problem = Problem(scene)
    journal = None
    evaluations_before, interrupted = 0, False
    failure: BaseException | None = None
    with ExitStack() as stack:
        closing = stack.enter_context(ExitStack())  # of the journal
        if folder is not None:
            folder = as_path("folder", folder)
            evaluations_before = begin_run(folder, scene, method, seed, resume=resume)
            context = f"{versions()} {scene.to_toml()}"
            journal = Journal(folder / JOURNAL, context, resume=resume)
            closing.callback(journal.close)
        if seconds is not None or budget is None or budget * problem.dominoes > SHORT:
            compile_simulations(scene, gradients=True)
        start = clock()
        scene = with_baseline(scene, seconds)
        if scene is not problem.scene:  # with a baseline that was searched on a floor
            problem = Problem(scene)
        uniform = scene.uniform()
        callback = stack.enter_context(progress_line(scene, method, progress, callback))
        evaluator = Evaluator(
            problem, budget, seconds,
            tolerance=tolerance, callback=callback, journal=journal, executor=executor,
            clock=clock,
        )  # fmt: skip
        evaluator.add_seconds(seconds_before + clock() - start)
        if seconds is not None and scene.simulator.is_slow:
            _record_baseline(evaluator, uniform)
        try:
            # The matrices are small: threads of the linear algebra would only wait for each other.
            with threadpool_limits(1, user_api="blas"):
                run(evaluator, rng)
            stop_reason = f"done: {evaluator.status or 'the method has nothing left to try'}"
        except BudgetSpent as end_of_budget:
            reason = str(end_of_budget) or evaluator.stop_reason or "too few evaluations remain"
            stop_reason = "; ".join(filter(None, (reason, evaluator.status)))
        except KeyboardInterrupt:
            interrupted, stop_reason = True, "interrupted"
        except (Exception, SystemExit) as error:
            failure, stop_reason = error, f"the method failed: {error}"
            if isinstance(error, SystemExit):  # it would end the program without a message
                failure = ValueError(f"SystemExit {error.code}: end a method by `return`")
            failure.add_note(f"(in method '{method}')")
        if evaluator.best_score <= 0.0 and not interrupted:
            stop_reason = f"{stop_reason.partition(';')[0]}; {NO_SUCCESS}"
        duration = evaluator.seconds
        try:
            closing.close()
        except ValueError as error:  # a full disk, say
            failure = failure or error
    # with a folder the best layout so far is written before the error is raised
    if failure is not None and (folder is None or not evaluator.finalists):
        raise failure
    if not evaluator.finalists:
        if interrupted:
            raise KeyboardInterrupt
        raise ValueError(f"method '{method}' ended without evaluating a layout: call `evaluate`")
    layout, wave, score = _best_finalist(scene, evaluator, uniform)
    end = (evaluator.evaluations, evaluator.falls, duration, evaluator.best_score)
    result = SearchResult(
        scene=scene, method=method, seed=seed, layout=layout, wave=wave, score=score,
        uniform=uniform, trace=(*evaluator.trace, end), evaluations=evaluator.evaluations,
        falls=evaluator.falls, seconds=duration, interrupted=interrupted, stop_reason=stop_reason,
    )  # fmt: skip
    try:
        if folder is not None:
            write_run(Path(folder), result, evaluations_before)
    finally:
        if failure is not None:
            raise failure
    return result


def _generator(
    seed: int | None, rng: int | np.random.Generator | None
) -> tuple[int | None, np.random.Generator]:
    """Return the seed, if there is one, and the generator of a search."""
    if seed is not None and rng is not None:
        raise ValueError("seed and rng are both given: give one of them")
    if isinstance(rng, np.random.Generator):
        return None, rng
    name, number = ("rng", rng) if rng is not None else ("seed", 0 if seed is None else seed)
    require(name, number, 0, whole=True)
    return int(number), np.random.default_rng(number)


def with_baseline(scene: Scene, seconds: float | None) -> Scene:
    """Return a scene with its uniform baseline; on a floor within half the seconds of a search."""
    if scene.simulator.is_slow and scene.uniform_point is None and seconds is not None:
        scene = scene.with_uniform(_best_point(scene, BASELINE_SHARE * seconds))
    scene.uniform()
    return scene


@lru_cache(maxsize=32)  # scenes
def _best_point(scene: Scene, seconds: float) -> Floats:
    return best_point(scene, seconds=seconds)


def _record_baseline(evaluator: Evaluator, uniform: UniformBaseline) -> None:
    """Record the uniform baseline as the first evaluation, unless a given one breaks the rules.

    Simulating it again may take longer than the time that is left.
    """
    problem = evaluator.problem
    design = problem.design(uniform.layout)
    layout = problem.layout(design)
    if np.allclose(layout.pitch, uniform.layout.pitch, rtol=0.0, atol=1e-12):  # [m] rounding
        falls = uniform.wave.as_batch().falls
        score = np.array([uniform.score])
        # a wave that stops scores its reach minus 1
        evaluator.record(Scores(score, np.minimum(1.0 + score, 1.0), falls), lambda _: design)


def compile_simulations(scene: Scene, *, gradients: bool = False, episodes: bool = False) -> None:
    """Compile the simulations of a scene, so that the time of a search does not include this.

    Parameters
    ----------
    scene
        The scene.
    gradients
        True to compile scores with gradients too.
    episodes
        True to compile the steps of `DominoChain` too.
    """
    if scene.simulator.is_slow:  # a simulation of two dominoes compiles all functions
        simulate_standing(Layout.uniform(2, pitch=0.02), scene.physics)
        scene = scene.on_pivots
    layouts = UniformLayouts(scene)
    gaps, thickness, height = layouts.sizes_at(0.5 * (layouts.low + layouts.high)[None])
    with compiled():
        scene.evaluate(scene.batch(gaps, thickness, height))
        if gradients:
            scene.evaluate(scene.batch(gaps, thickness, height, rtol=GRADIENT_RTOL), gradient=True)
        if episodes:
            from domino_env import DominoChain

            env = DominoChain(scene)
            env.reset()
            env.step(np.zeros(env.action_space.shape, np.float32))


@contextmanager
def progress_line(
    scene: Scene, method: str, progress: bool | None, callback: Callback
) -> Iterator[Callback]:
    """Open a context with a line of progress.

    Parameters
    ----------
    scene, method, progress, callback
        See `search`.

    Yields
    ------
    callable
        Function of the evaluator that updates the line and calls `callback`.
    """
    name, uniform = f"{scene.name}, {method}", scene.uniform().score
    criterion = scene.criterion
    options: dict[str, Any] = {"total": 1.0, "desc": name, "bar_format": BAR_FORMAT, "leave": False}
    with progress_bar(progress, line=PLAIN_FORMAT, dynamic_ncols=True, **options) as line:

        def update(evaluator: Evaluator) -> None:
            score = evaluator.best_score
            comparison = criterion.compare(score, uniform, "uniform")
            text = ", ".join(filter(None, (f"best {criterion.label(score, 5)}", comparison)))
            if score <= 0.0:
                text = f"no layout succeeds yet, best score {score:.3f}"
            line.set_postfix_str(text, refresh=False)
            line.update(evaluator.progress - line.n)
            callback(evaluator)

        yield update


def _best_finalist(
    scene: Scene, evaluator: Evaluator, uniform: UniformBaseline
) -> tuple[Layout, Wave, float]:
    """Simulate the finalists at a tight tolerance and return the best of them.

    Near a stall, a wave may complete at the tolerance of the search and not at a tight one.
    """
    if scene.simulator.is_slow:  # free-standing scores have the same tolerance in a search
        score, design = evaluator.finalists[-1]
        if score == uniform.score:
            return uniform.layout, uniform.wave, score
        layout = evaluator.problem.layout(design)
        return layout, scene.simulate(layout), score
    layouts = [evaluator.problem.layout(design) for _, design in reversed(evaluator.finalists)]
    waves = [scene.simulate(layout) for layout in layouts]
    return max(zip(layouts, waves, map(scene.score, waves), strict=True), key=itemgetter(2))
