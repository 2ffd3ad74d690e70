"""Reports of experiments: a page of Markdown, tables in CSV, and pictures.

The report of a comparison has curves over time, that of a sweep curves over the varied settings.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table, write_csv
from optimize.experiments.experiment import Experiment
from optimize.experiments.task import scene_of

COMPARISON_FILES = ("comparison.md", "runs.csv", "traces.csv", "gaps.png", "targets.png")
SWEEP_FILES = ("sweep.md", "sweep.csv", "sweep.png")
MAX_LINES = 200  # of a page's table; the CSV has all
TRACE_COLUMNS = ("scene", "method", "seed", "evaluations", "falls", "seconds", "score")


def write_comparison(experiment: Experiment, folder: Path) -> None:
    """Write all COMPARISON_FILES; other files in the folder stay."""
    from optimize.experiments.pictures import draw_over_time

    steps = (
        (r.scene_name, r.method, r.seed, n, falls, f"{seconds:.6f}", score)
        for r in experiment.results
        for n, falls, seconds, score in r.trace
    )
    write_runs(experiment, folder / "runs.csv")
    write_csv(folder / "traces.csv", TRACE_COLUMNS, steps)
    draw_over_time(experiment, folder / "gaps.png", folder / "targets.png")
    write_text(folder / "comparison.md", comparison_page(experiment))


def write_sweep(experiment: Experiment, folder: Path) -> None:
    """Write all SWEEP_FILES of variations of a scene; other files in the folder stay."""
    from optimize.experiments.pictures import draw_over_settings

    scene = scene_of(experiment.tasks[0].scene)
    write_runs(experiment, folder / "sweep.csv")
    draw_over_settings(experiment, folder / "sweep.png", scene.name, scene.unit)
    write_text(folder / "sweep.md", sweep_page(experiment))


def write_runs(experiment: Experiment, path: Path) -> None:
    """Write a line for each run, with its labels; inf for a gap that was never reached."""
    clock = experiment.clock
    names = (
        "scene", *experiment.keys, "method", "seed", "score", "uniform", "gain", "gap",
        f"{clock}_to_1_percent", f"{clock}_to_0.1_percent", "outcome", "mean_speed", "evaluations",
        "falls", "seconds", "key",
    )  # fmt: skip
    lines = (
        (
            r.scene_name, *r.labels.values(), r.method, r.seed, r.score, r.uniform_score, r.gain,
            experiment.gap(r), experiment.time_to(r, 1e-2), experiment.time_to(r, 1e-3), r.outcome,
            r.mean_speed, r.evaluations, r.falls, r.seconds, r.key,
        )
        for r in experiment.results
    )  # fmt: skip
    write_csv(path, names, lines)


COMPARISON_PAGE = """# Methods compared

{limit} for each run, {over}. *Gain* is over the uniform baseline, *shortfall* from the best score \
known; times are those at which a run came within 1 % and 0.1 % of it.
{sections}

## Shortfall against run time

![shortfall from the best known against run time](gaps.png)

## Targets reached

Part of 41 targets (shortfalls from 10 % to 0.001 %) that were reached by a time, as in the \
reports of COCO.

![part of the targets reached against run time](targets.png)
"""
AGENT_CLOCK = """
The clock of `agent:RUN` began with its training, which may have taken longer than the limit of the
other methods: its layout appears where the training ends."""
SWEEP_PAGE = """# {name}, swept over {keys}

{points} scenes, {runs} searches of up to {limit} each, {over}. *Gain* is over the uniform \
baseline of the same scene, *shortfall* from the best score of any search there.

![{value} over {keys}](sweep.png)

{table}
"""


def comparison_page(experiment: Experiment) -> str:
    """Return the page of a comparison: a table for each scene, best method first."""
    agents = any(method.startswith("agent:") for method in experiment.methods)
    sections = [AGENT_CLOCK] if agents else []
    for problem in experiment.problems:
        r = next(r for r in experiment.results if r.problem == problem)
        # a title may come from anywhere: it is text, not Markdown
        title = re.sub(r"([\\`*_\[\]<>!|&])", r"\\\1", scene_of(r.scene).title)
        best = experiment.best[problem]
        scores = f"Uniform baseline {r.uniform_score:.5f}, best known {best:.5f}."
        sections += ["", f"## {problem}", "", f"{title}. {scores}", ""]
        sections += table(experiment, [problem])
    sections += failures_section(experiment)
    over = experiment.over_seeds("medians over")
    return COMPARISON_PAGE.format(limit=experiment.limit, over=over, sections="\n".join(sections))


def sweep_page(experiment: Experiment) -> str:
    """Return the page of a sweep: the picture and a table."""
    scene = scene_of(experiment.tasks[0].scene)
    lines = [*table(experiment, experiment.problems), *failures_section(experiment)]
    return SWEEP_PAGE.format(
        name=scene.name, keys=", ".join(f"`{key}`" for key in experiment.keys),
        points=len(experiment.points), runs=len(experiment.results), limit=experiment.limit,
        over=experiment.over_seeds("medians over"),
        value="gain over uniform" if scene.unit else "score", table="\n".join(lines),
    )  # fmt: skip


def table(experiment: Experiment, problems: Iterable[str]) -> list[str]:
    """Return a line of Markdown for each problem and method, its best method first."""
    names = (
        *experiment.keys, "method", "score", "worst", "uniform", "gain", "shortfall", "to 1 %",
        "to 0.1 %", "layouts simulated",
    )  # fmt: skip
    time_format = "{:.2g} s" if experiment.clock == "seconds" else "{:.0f}"
    lines: list[tuple[object, ...]] = []
    for problem in problems:
        groups = [runs for m in experiment.methods if (runs := experiment.runs(m, problem))]
        for runs in sorted(groups, key=lambda runs: -np.median([r.score for r in runs])):
            gains = [r.gain for r in runs if r.gain is not None]
            gaps = [gap for r in runs if (gap := experiment.gap(r)) is not None]
            # infinite where half of the seeds never came so near
            times = [np.median([experiment.time_to(r, gap) for r in runs]) for gap in (1e-2, 1e-3)]
            lines.append((
                *(f"{v:.6g}" if isinstance(v, float) else v for v in runs[0].labels.values()),
                f"`{runs[0].method}`",
                f"{np.median([r.score for r in runs]):.5f}",
                f"{min(r.score for r in runs):.5f}",
                f"{runs[0].uniform_score:.5f}",
                f"{np.median(gains):+.2%}" if gains else "–",
                f"{np.median(gaps):.3%}" if gaps else "–",
                *(time_format.format(t) if np.isfinite(t) else "–" for t in times),
                f"{np.median([r.evaluations for r in runs]):.0f}",
            ))  # fmt: skip
    more = ["", f"{len(lines) - MAX_LINES} more lines are in the CSV file."]
    return markdown_table(names, lines[:MAX_LINES]) + (more if len(lines) > MAX_LINES else [])


def failures_section(experiment: Experiment) -> list[str]:
    """Return the runs without a result, with the reasons, as lines of Markdown."""
    if not experiment.failures:
        return []
    lines = [f"- {one.task.name}: {one.reason}" for one in experiment.failures[:MAX_LINES]]
    return ["", "## Runs without a result", "", *lines]
