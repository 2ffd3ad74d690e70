"""A study as logs that IOHanalyzer reads, in a .zip: a folder for each method.

In it are a JSON file for each scene, which says what was run, and beside it the table of each run:
evaluations and best score so far at every improvement and at the end, with the falls and seconds
that they took.  Scores are maximised.  A batch counts as a whole: where the first holds more than
one row, -1, which no row is below, stands for the first evaluation.  Every run of a scene is of
instance 1, as nothing but its seed differs.

References
----------
de Nobel, J., Ye, F., Vermetten, D., Wang, H., Doerr, C., Bäck, T. (2024). IOHexperimenter:
benchmarking platform for iterative optimization heuristics. Evolutionary Computation 32, 205-210.
"""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Iterator, Sequence
from typing import IO

from optimize.problem import Problem
from optimize.studies.task import TaskResult, layout_of, scene_of

VERSION = "0.3.22"  # of the format, that of the IOHexperimenter which writes it so
WORST = -1.0  # no row scores less
COLUMNS = ("evaluations", "raw_y", "falls", "seconds")


def write_ioh(results: Sequence[TaskResult], file: IO[bytes]) -> None:
    """Write the logs of some results into a .zip file."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, text in _files(results):
            archive.writestr(zipfile.ZipInfo(path), text, zipfile.ZIP_DEFLATED)


def _files(results: Sequence[TaskResult]) -> Iterator[tuple[str, str]]:
    """Paths and texts."""
    scenes = list(dict.fromkeys(result.scene for result in results))
    methods = list(dict.fromkeys(result.method for result in results))
    for m, method in enumerate(methods, 1):
        folder = _safe(method, m, methods)
        for function, scene in enumerate(scenes, 1):
            runs = [r for r in results if r.method == method and r.scene == scene]
            if runs:
                yield from _of_one(folder, function, sorted(runs, key=lambda run: run.seed))


def _of_one(folder: str, function: int, runs: list[TaskResult]) -> Iterator[tuple[str, str]]:
    """The two files of one method on one scene."""
    first = runs[0]
    problem = Problem(scene_of(first.scene))
    name = "_".join([first.scene_name, *(f"{key}={value}" for key, value in first.labels)])
    word = re.sub(r"[^\w.=-]+", "-", name)
    table = f"data_f{function}_{word}/IOHprofiler_f{function}_DIM{problem.dimension}.dat"
    about = {
        "version": VERSION,
        "suite": "domino-chains",
        "function_id": function,
        "function_name": word,
        "maximization": True,
        "algorithm": {"name": first.method, "info": f"domino-chains, {first.method}"},
        "experiment_attributes": [{key: str(value)} for key, value in first.labels],
        "attributes": list(COLUMNS),
        "run_attributes": ["seed"],
        "scenarios": [
            {
                "dimension": problem.dimension,
                "path": table,
                "runs": [_run(problem, result) for result in runs],
            }
        ],
    }
    yield f"{folder}/IOHprofiler_f{function}_{word}.json", json.dumps(about, indent=1)
    lines = []
    for result in runs:
        lines.append(" ".join(COLUMNS))
        # readers tell runs apart by the first evaluation, and the end may be an improvement too
        steps = {1: (1, 0, 0.0, WORST)} | {step[0]: step for step in result.trace}
        lines += [f"{n} {best!r} {falls} {spent!r}" for n, falls, spent, best in steps.values()]
    yield f"{folder}/{table}", "\n".join(lines) + "\n"


def _run(problem: Problem, result: TaskResult) -> dict[str, object]:
    """What is said of a run; its best score is that of the search, as in the table."""
    best = max(step[3] for step in result.trace)
    at = next(step[0] for step in result.trace if step[3] == best)
    x = problem.design(layout_of(problem.scene, result)).tolist()
    return {
        "instance": 1,
        "seed": result.seed,
        "evals": result.evaluations,
        "best": {"evals": at, "y": best, "x": x},
    }


def _safe(name: str, number: int, names: list[str]) -> str:
    """The name of a folder; numbered where two names would share it."""
    words = [re.sub(r"[^\w.-]+", "-", other) for other in names]
    word = words[number - 1]
    return word if words.count(word) == 1 else f"{word}-{number}"
