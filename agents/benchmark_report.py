"""Report of a benchmark: a page of Markdown, a table of all runs, pictures."""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from pathlib import Path

import numpy as np

from agents.algorithms import ALGORITHMS
from agents.benchmark import problem_of_text
from domino_env import Scene
from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table, write_csv
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
    sections = [_of_scene(experiment, scene) for scene in experiment.problems]
    lines = [*chain(*sections)][1:] + failures_section(experiment)
    return PAGE.read_text("utf-8").format(
        overview="\n".join(table(experiment)),
        scenes="\n".join(lines),
        command=command,
        runs=len(experiment.results),
        minutes=sum(r.seconds for r in experiment.results) / 60.0,
    )


def table(experiment: Experiment, scene: str | None = None) -> list[str]:
    """Return the table of one scene or of all, learning algorithms first, the best of each first.

    The table of one scene has scores too.
    """
    names = ["algorithm", "runs", "normalised score", "95 % interval"]
    names += [f"after {moment:g} s" for moment in MOMENTS]
    names += ["runs past uniform", "processor time", *["worst, best score"] * (scene is not None)]
    lines = []
    for name in experiment.ranked(ALGORITHMS, scene):
        runs, estimate = experiment.runs(name, scene), experiment.mean_score(name, scene)
        low, high = float(estimate.low), float(estimate.high)
        past = sum(r.score > r.uniform_score for r in runs)
        early = [experiment.score_after(name, moment, scene) for moment in MOMENTS]
        seconds = float(np.median([r.seconds for r in runs]))
        line = [
            f"`{name}`", len(runs), f"{float(estimate.value):.1%}",
            f"{low:.1%} to {high:.1%}" if high > low else "–",
            *(f"{score:.1%}" if np.isfinite(score) else "–" for score in early),
            f"{past} of {len(runs)}", f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s",
        ]  # fmt: skip
        if scene is not None:
            form = _form(runs[0])
            ends = form(min(r.score for r in runs)), form(max(r.score for r in runs))
            line.append(", ".join(ends))
        lines.append(line)
    return list(markdown_table(names, lines))


def _of_scene(experiment: Experiment, scene: str) -> list[str]:
    """Return text and table of one scene as lines of Markdown."""
    one = next(r for r in experiment.results if r.problem == scene)
    best = _form(one)(experiment.best[scene])
    about = f"Uniform baseline {one.uniform_score:.5f}, best known {best}."
    if not isinstance(problem_of_text(one.scene), Scene):
        about = SAMPLED.format(best)
    return ["", f"## {scene}", "", about, "", *table(experiment, scene)]


def _form(result: TaskResult) -> Callable[[float], str]:
    """Return the format of the scores of a result: gains where scenes are sampled."""
    fixed = isinstance(problem_of_text(result.scene), Scene)
    return "{:.5f}".format if fixed else "{:+.2%}".format
