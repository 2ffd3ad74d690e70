"""search(): one method on one scene under one budget."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from domino_env.core.results import versions
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from optimize.compiling import compile_for
from optimize.evaluator import Budget, BudgetSpent
from optimize.journal import Journal
from optimize.methods import registry
from optimize.methods.registry import name_of
from optimize.problem import Problem
from optimize.progress import Watch, progress_line
from optimize.recorder import Recorder
from optimize.result import SearchResult
from optimize.run_folder import RunFolder

if TYPE_CHECKING:
    from optimize.methods.registry import Method


def search(
    scene: Scene | str | Path,
    method: str | Method = "auto",
    budget: int | None = None,
    seed: int = 0,
    *,
    seconds: float | None = None,
    progress: bool | None = None,
    folder: str | Path | None = None,
    watch: Watch | None = None,
    executor: Executor | None = None,
    resume: bool = False,
    clock: Callable[[], float] = time.perf_counter,
) -> SearchResult:
    """Search a layout of a scene that beats the best uniform pitch.

    A search ends when its method is done, and says why; budget and seconds are limits to it. Where
    there is no limit, one that is never done ends when its evaluations have gained nothing for
    long. Ctrl-C ends the search with the best so far.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    method
        One of `METHODS`, or one of your own: a function `run(budget, rng)`, or its name as
        "package.module:function".
    budget
        Layouts that may be simulated, never exceeded; None: no limit. The best few are simulated
        once more, closely, at the end; that is not counted. On a floor those count that are toppled
        standing, and not the analytic ones that say which.
    seed
        Of all randomness; the same seed gives the same result to the bit, under a budget of
        evaluations or none (one of seconds cannot), whatever the number of threads.
    seconds
        Time that may be spent, not counting the search of the uniform pitch; None: no limit.
    progress
        Whether to show a line with the best so far; None: on a terminal.
    folder
        Where to write the run, see `optimize.run_folder`; None: nowhere.
    watch
        Called with the Budget after every batch.
    executor
        Scores batches of thousands of rows, see `optimize.executors`; smaller ones are not sent.
        None: threads of this process. The result is the same to the bit.
    resume
        Go on with the search in the folder, from where its journal ends (from the start where there
        is none), or further with a larger budget. The result is the same to the bit as that of a
        search that was never stopped; seconds that it took before are counted.
    clock
        Gives the seconds of a search without a folder, such as `time.process_time`: processor time,
        from which what else the machine does falls out.

    Returns
    -------
    SearchResult
        The best layout, beside the best uniform one.

    Raises
    ------
    ValueError
        For an unknown method or scene, a method that asks for no score, a budget that is not
        positive, a folder that holds a run already or, with resume, another search or more of this
        one, a result that cannot be written, or a scene that leaves nothing free.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    run, method = registry.load(method), name_of(method)
    require_limits(budget, seconds, seed)
    if resume and folder is None:
        raise ValueError("resume: name the folder of the search to go on with")
    problem = Problem(scene)
    files = journal = None
    interrupted = False
    with ExitStack() as stack:
        if folder is not None:
            files = RunFolder(Path(folder), scene, method, seed, resume=resume, evaluations=budget)
            journal = Journal(files.journal, scene, method, seed, versions(), resume=resume)
        recorder = stack.enter_context(Recorder(problem, journal, executor, clock))
        uniform = scene.uniform()
        compile_for(scene, gradients=True)
        show = stack.enter_context(
            progress_line(f"{scene.name}, {method}", uniform.score, progress, scene.unit)
        )

        def look(meter: Budget) -> None:
            show(meter)
            if files is not None:
                files.save(meter)
            if watch is not None:
                watch(meter)

        meter = Budget(recorder, budget, seconds, look)
        try:
            # Matrices are small here: threads of the linear algebra only wait for each other.
            with threadpool_limits(1, user_api="blas"):
                run(meter, np.random.default_rng(seed))
            ended = f"done: {meter.standing or 'the method has nothing left to try'}"
        except BudgetSpent as spent_up:
            ended = "; ".join(
                filter(None, (str(spent_up) or meter.over or "too little is left", meter.standing))
            )
        except KeyboardInterrupt:
            interrupted, ended = True, "interrupted"
        spent = meter.elapsed
    if not (meter.finalists or interrupted):
        raise ValueError(f"method '{method}' ended without asking budget for a score")
    layout, wave, score = _best(scene, meter)
    end = (meter.spent, meter.falls, spent, meter.best_score)
    result = SearchResult(
        scene=scene,
        method=method,
        seed=seed,
        layout=layout,
        wave=wave,
        score=score,
        uniform=uniform,
        trace=(*meter.trace, end),
        slopes=(*meter.slopes, meter.slopes[-1] if meter.slopes else None),
        evaluations=meter.spent,
        falls=meter.falls,
        seconds=spent,
        interrupted=interrupted,
        ended=ended,
    )
    if files is not None:
        files.finish(result)
        if not interrupted:
            recorder.finish()
    return result


def require_limits(budget: int | None, seconds: float | None, seed: int) -> None:
    """Refuse limits that leave a search nothing, and seeds that are none, as `search` does.

    Parameters
    ----------
    budget, seconds, seed
        As of `search`.

    Raises
    ------
    ValueError
        With the number, and what to give.
    """
    if budget is not None and budget < 1:
        raise ValueError(f"budget = {budget}: give at least one evaluation")
    if seconds is not None and not seconds > 0.0:
        raise ValueError(f"seconds = {seconds}: give a time of more than 0 s")
    if seed < 0:
        raise ValueError(f"seed = {seed}: give a whole number, 0 or more")


def _best(scene: Scene, meter: Budget) -> tuple[Layout, Wave, float]:
    """The best of the finalists, simulated closely.

    A hair above a stall, a row may run through at the search's tolerance and not at a closer one.
    """
    if not meter.finalists:
        raise KeyboardInterrupt  # ended by hand before anything was found
    layouts = [meter.problem.layout(design) for _, design in reversed(meter.finalists)]
    waves = [scene.simulate(layout) for layout in layouts]
    scores = scene.evaluate_waves(waves).score.tolist()
    return max(zip(layouts, waves, scores, strict=True), key=lambda one: one[2])
