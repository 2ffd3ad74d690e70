"""Report of a benchmark: a page of Markdown, a table of all runs, pictures."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import numpy as np

from agents.algorithms import ALGORITHMS
from agents.benchmark import problem_of_text
from domino_env import Scene
from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table, write_csv
from optimize.experiments.estimates import Estimate
from optimize.experiments.experiment import Experiment
from optimize.experiments.report import failures_section
from optimize.experiments.task import TaskResult

FILES = (
    "benchmark.md", "benchmark.csv", "benchmark-reached.png", "benchmark-seconds.png",
    "benchmark-steps.png",
)  # fmt: skip
MOMENTS = (1.0, 10.0, 60.0)  # [s] processor times of the columns "after"
COLUMNS = (
    "scene", "algorithm", "seed", "uniform", "score", "best_known", "normalised_score", "steps",
    "processor_seconds", "seconds_past_uniform",
)  # fmt: skip
PAGE = Path(__file__).with_name("benchmark_page.md")  # template
SAMPLED = (
    "Every episode of a training has a new scene. A score is the median gain over the uniform "
    "baselines in the test set; that of searches with 2,500 evaluations each, {}, counts as best "
    "known. A search searches each of these scenes, and its time is that of all together; the "
    "curve of a training is of other scenes than the test set's."
)


def write(experiment: Experiment, folder: Path, command: str) -> None:
    """Write all FILES; other files in the folder stay.

    Parameters
    ----------
    experiment
        Results of the benchmark.
    folder
        Folder of the files.
    command
        Command that repeats it, for the page.
    """
    from optimize.experiments.pictures import draw_intervals, draw_over_clock

    lines = []
    for r in experiment.results:
        times, scores = experiment.steps(r, "evaluations")
        lines.append((
            r.scene_name, r.method, r.seed, r.uniform_score, r.score, experiment.best[r.problem],
            round(float(experiment.normalised(r, scores[-1])), 5), int(times[-1]),
            round(r.seconds, 2), round(experiment.seconds_past_uniform(r), 2),
        ))  # fmt: skip
    write_text(folder / FILES[0], page(experiment, command))
    write_csv(folder / FILES[1], COLUMNS, lines)
    draw_intervals(experiment, folder / FILES[2])
    draw_over_clock(experiment, "seconds", folder / FILES[3], ALGORITHMS)
    draw_over_clock(experiment, "evaluations", folder / FILES[4], ALGORITHMS)


def page(experiment: Experiment, command: str) -> str:
    """Return the page in Markdown."""
    sections = [["", f"## {scene}", "", *_of_scene(experiment, scene)]
                for scene in experiment.problems]  # fmt: skip
    lines = [*chain(*sections)][1:] + failures_section(experiment)
    return PAGE.read_text("utf-8").format(
        overview="\n".join(overview(experiment)),
        scenes="\n".join(lines),
        command=command,
        runs=len(experiment.results),
        minutes=sum(r.seconds for r in experiment.results) / 60.0,
    )


def overview(experiment: Experiment) -> list[str]:
    """Return the table over all scenes, learning algorithms first, the best of each first."""
    names = (
        "algorithm", "runs", "normalised score", "95 % interval",
        *(f"after {moment:g} s" for moment in MOMENTS), "runs past uniform", "processor time",
    )  # fmt: skip
    rows = []
    for name in experiment.ranked(ALGORITHMS):
        runs, estimate = experiment.runs(name), experiment.mean_score(name)
        past = sum(r.score > r.uniform_score for r in runs)
        early = [experiment.score_after(name, moment) for moment in MOMENTS]
        rows.append((
            f"`{name}`", len(runs), f"{float(estimate.value):.1%}", _interval(estimate),
            *(f"{part:.1%}" if np.isfinite(part) else "–" for part in early),
            f"{past} of {len(runs)}", _time(runs),
        ))  # fmt: skip
    return list(markdown_table(names, rows))


def _of_scene(experiment: Experiment, scene: str) -> list[str]:
    """Return text and table of one scene as lines of Markdown."""
    one = next(r for r in experiment.results if r.problem == scene)
    fixed = isinstance(problem_of_text(one.scene), Scene)
    scores = "{:.5f}" if fixed else "{:+.2%}"
    best = scores.format(experiment.best[scene])
    uniform = scores.format(one.uniform_score)
    about = f"Uniform baseline {uniform}, best known {best}." if fixed else SAMPLED.format(best)
    names = (
        "algorithm", "runs", "worst, best score", "normalised score", "95 % interval",
        "past uniform after, at worst", "processor time",
    )  # fmt: skip
    rows = []
    for name in experiment.ranked(ALGORITHMS, scene):
        runs, estimate = experiment.runs(name, scene), experiment.mean_score(name, scene)
        ends = min(r.score for r in runs), max(r.score for r in runs)
        past = max(experiment.seconds_past_uniform(r) for r in runs)
        rows.append((
            f"`{name}`", len(runs), ", ".join(map(scores.format, ends)),
            f"{float(estimate.value):.1%}", _interval(estimate),
            _seconds(past) if np.isfinite(past) else "not all", _time(runs),
        ))  # fmt: skip
    return [about, "", *markdown_table(names, rows)]


def _interval(estimate: Estimate) -> str:
    low, high = float(estimate.low), float(estimate.high)
    return f"{low:.1%} to {high:.1%}" if high > low else "–"


def _time(runs: list[TaskResult]) -> str:
    return _seconds(float(np.median([r.seconds for r in runs])))


def _seconds(value: float) -> str:
    return f"{value:.2g} s" if value < 10.0 else f"{value:.0f} s"
