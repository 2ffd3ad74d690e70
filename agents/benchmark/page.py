"""What a benchmark leaves in a folder: a page of Markdown, a table of all runs, pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agents.algorithms import ALGORITHMS
from agents.benchmark.many import problem_of
from agents.benchmark.picture import draw_curves, draw_reached
from agents.benchmark.results import SECONDS, STEPS, Benchmark
from agents.benchmark.statistics import Estimate
from domino_env import SceneDistribution
from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table, write_csv
from optimize.studies.task import TaskResult

FILES = (
    "benchmark.md", "benchmark.csv", "benchmark-reached.png", "benchmark-seconds.png",
    "benchmark-steps.png",
)  # fmt: skip
MOMENTS = (1.0, 10.0, 60.0)  # [s] at which the curves are read
COLUMNS = (
    "scene", "algorithm", "seed", "uniform", "score", "best_known", "share", "steps",
    "processor_seconds", "seconds_past_uniform",
)  # fmt: skip
SUMMARY = "<!-- summary -->", "<!-- end -->"


def write(benchmark: Benchmark, folder: Path, command: str) -> None:
    """Write all FILES; what else lies in the folder stays.

    Parameters
    ----------
    benchmark
        All runs.
    folder
        Made where it is not there.
    command
        What made them, as it is typed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / FILES[0], page(benchmark, command))
    write_csv(folder / FILES[1], COLUMNS, (row(benchmark, r) for r in benchmark.results))
    draw_reached(benchmark, folder / FILES[2])
    draw_curves(benchmark, SECONDS, folder / FILES[3])
    draw_curves(benchmark, STEPS, folder / FILES[4])


def row(benchmark: Benchmark, result: TaskResult) -> tuple[object, ...]:
    """Give what COLUMNS name of one run."""
    times, shares = benchmark.steps(result, STEPS)
    return (
        result.scene_name, result.method, result.seed, result.uniform_score, result.score,
        benchmark.best[result.scene_name], round(float(shares[-1]), 5), int(times[-1]),
        round(result.seconds, 2), round(benchmark.seconds_past_uniform(result), 2),
    )  # fmt: skip


def summary(benchmark: Benchmark) -> list[str]:
    """Make the table over all scenes, lines of Markdown: what learns first, each best first."""
    names = (
        "algorithm", "runs", "part of the gain", "95 % interval",
        *(f"after {moment:g} s" for moment in MOMENTS), "runs past uniform", "processor time",
    )  # fmt: skip
    return list(markdown_table(names, [_cells(benchmark, name) for name in _ordered(benchmark)]))


def page(benchmark: Benchmark, command: str) -> str:
    """Write the page."""
    spent = sum(r.seconds for r in benchmark.results)
    lines = [
        "# Benchmark",
        "",
        "What the algorithms of `domino train` reach, and when, beside what needs no learning. A "
        "score counts as the part of the gain that it makes: 0 is the best uniform row, 1 the best "
        "row known. Means are interquartile, those of the middle half of the runs; intervals are "
        "of 95 %, by a bootstrap over seeds, stratified by scene, as Agarwal et al. (2021, "
        "arXiv:2108.13264) advise.",
        "",
        SUMMARY[0],
        "",
        *summary(benchmark),
        "",
        SUMMARY[1],
        "",
        "Times are processor time of one thread; a column *after* says what a run has by then, "
        "whether it still goes on or not. `ramp`, `cma` (CMA-ES) and `auto` search each row anew; "
        "what learns has a policy in the end.",
        "",
        "![Interquartile means and performance profile](benchmark-reached.png)",
        "",
        "## Over processor time",
        "",
        "![Best row so far over processor seconds](benchmark-seconds.png)",
        "",
        "## Over environment steps",
        "",
        "A step places a domino; a row of a search counts as many.",
        "",
        "![Best row so far over environment steps](benchmark-steps.png)",
    ]
    for scene in benchmark.scenes:
        result = next(r for r in benchmark.results if r.scene_name == scene)
        lines += [
            "", f"## {scene}", "",
            _about(benchmark, result), "", *table(benchmark, scene),
        ]  # fmt: skip
    if benchmark.failures:
        lines += ["", "## Runs without a result", ""]
        lines += [f"- {one.task.name}: {one.reason}" for one in benchmark.failures]
    lines += [
        "",
        "## How it was made",
        "",
        "```sh",
        command,
        "```",
        "",
        f"{len(benchmark.results)} runs, {spent / 60.0:.0f} min of processor time. The same "
        "command runs what is missing and writes this page anew; `benchmark.csv` has a line a "
        "run. Ten seeds are asked for where a run takes two minutes or less, five elsewhere.",
    ]
    return "\n".join(lines) + "\n"


def table(benchmark: Benchmark, scene: str) -> list[str]:
    """Make one scene's table, lines of Markdown."""
    names = (
        "algorithm", "runs", "worst, best score", "part of the gain", "95 % interval",
        "past uniform after, at worst", "processor time",
    )  # fmt: skip
    rows = []
    for name in _ordered(benchmark, scene):
        runs = benchmark.of(name, scene)
        scores = [r.score for r in runs]
        found, ends = benchmark.gain(name, scene), (min(scores), max(scores))
        past = max(benchmark.seconds_past_uniform(r) for r in runs)
        rows.append((
            f"`{name}`", len(runs), ", ".join(_score(runs[0], x) for x in ends),
            f"{float(found.value):.1%}", _interval(found),
            _seconds(past) if np.isfinite(past) else "not all", _time(runs),
        ))  # fmt: skip
    return list(markdown_table(names, rows))


def _about(benchmark: Benchmark, result: TaskResult) -> str:
    best = _score(result, benchmark.best[result.scene_name])
    if not _many(result):
        return f"Best uniform row {_score(result, result.uniform_score)}, best known {best}."
    return (
        "Every episode of a training is a new scene. A score is the median gain over the best "
        f"uniform rows of the scenes of the test set; that of searches of 2,500 rows each, {best}, "
        "counts as best known. A search has each of these scenes to search, and its time is that "
        "of all searches; the curve of a training is of other scenes than the test set's."
    )


def _many(result: TaskResult) -> bool:
    return isinstance(problem_of(result.scene), SceneDistribution)


def _score(result: TaskResult, score: float) -> str:
    return f"{score:+.2%}" if _many(result) else f"{score:.5f}"


def _cells(benchmark: Benchmark, name: str) -> tuple[object, ...]:
    runs, found = benchmark.of(name), benchmark.gain(name)
    past = sum(r.score > r.uniform_score for r in runs)
    early = [benchmark.gain_after(name, moment) for moment in MOMENTS]
    return (
        f"`{name}`", len(runs), f"{float(found.value):.1%}", _interval(found),
        *(f"{part:.1%}" if np.isfinite(part) else "–" for part in early),
        f"{past} of {len(runs)}", _time(runs),
    )  # fmt: skip


def _ordered(benchmark: Benchmark, scene: str | None = None) -> list[str]:
    names = [name for name in benchmark.algorithms if benchmark.of(name, scene)]
    return sorted(
        names, key=lambda n: (n not in ALGORITHMS, -float(benchmark.gain(n, scene).value))
    )


def _interval(found: Estimate) -> str:
    return f"{float(found.low):.1%} to {float(found.high):.1%}" if found.is_known else "–"


def _time(runs: list[TaskResult]) -> str:
    return _seconds(float(np.median([r.seconds for r in runs])))


def _seconds(value: float) -> str:
    return f"{value:.2g} s" if value < 10.0 else f"{value:.0f} s"
