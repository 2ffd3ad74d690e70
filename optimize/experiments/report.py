"""Reports of experiments: a page of Markdown, tables in CSV, and pictures.

A comparison is seen over time, a sweep over the settings that it varies.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table, write_csv
from domino_env.scenes.scene import Scene
from optimize.experiments.experiment import Experiment, problem_of
from optimize.experiments.task import scene_of

COMPARISON_FILES = ("comparison.md", "runs.csv", "traces.csv", "gaps.png", "targets.png")
SWEEP_FILES = ("sweep.md", "sweep.csv", "sweep.png")
MOST_LINES = 200  # of a page's table; the CSV has all
TRACE_NAMES = ("scene", "method", "seed", "evaluations", "falls", "seconds", "score")


def write_comparison(experiment: Experiment, folder: Path) -> None:
    """Write all COMPARISON_FILES; other files in the folder stay."""
    from optimize.experiments.pictures import draw_over_time

    steps = (
        (r.scene_name, r.method, r.seed, n, falls, f"{seconds:.6f}", score)
        for r in experiment.results
        for n, falls, seconds, score in r.trace
    )
    write_runs(experiment, folder / "runs.csv")
    write_csv(folder / "traces.csv", TRACE_NAMES, steps)
    draw_over_time(experiment, folder / "gaps.png", folder / "targets.png")
    write_text(folder / "comparison.md", comparison_page(experiment))


def write_sweep(experiment: Experiment, folder: Path, base: Scene) -> None:
    """Write all SWEEP_FILES of variations of a scene; other files in the folder stay."""
    from optimize.experiments.pictures import draw_over_settings

    write_runs(experiment, folder / "sweep.csv")
    draw_over_settings(experiment, folder / "sweep.png", base.name, base.unit)
    write_text(folder / "sweep.md", sweep_page(experiment, base))


def write_runs(experiment: Experiment, path: Path) -> None:
    """Write a line for each run, with its labels; inf where a gap was never reached."""
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


def comparison_page(experiment: Experiment) -> str:
    """Write the page of a comparison: a table for each scene, best method first."""
    lines = [
        "# Methods compared",
        "",
        f"{experiment.budget} for each run, {experiment.over_seeds('medians over')}. "
        "*Gain* is over the uniform baseline, *gap* to the best score known; times are those at "
        "which a run came within 1 % and 0.1 % of it.",
    ]
    if any(method.startswith("agent:") for method in experiment.methods):
        lines += [
            "",
            "The clock of `agent:RUN` began with its training, which may have taken longer than "
            "the budget of the others: its layout stands where that ends.",
        ]
    for problem in experiment.problems:
        r = next(r for r in experiment.results if problem_of(r) == problem)
        # a title may come from anywhere: it is text, not Markdown
        title = re.sub(r"([\\`*_\[\]<>!|&])", r"\\\1", scene_of(r.scene).title)
        about = f"{title}. Uniform baseline {r.uniform_score:.5f}, best known "
        lines += [
            "", f"## {problem}", "", f"{about}{experiment.best[problem]:.5f}.", "",
            *table(experiment, [problem]),
        ]  # fmt: skip
    lines += [
        *failures_section(experiment),
        "",
        "## Gap against run time",
        "",
        "![gap to the best known against run time](gaps.png)",
        "",
        "## Targets reached",
        "",
        "Part of 41 targets (gaps from 10 % to 0.001 %) that were reached by a time, as COCO "
        "draws it.",
        "",
        "![part of the targets reached against run time](targets.png)",
    ]
    return "\n".join(lines) + "\n"


def sweep_page(experiment: Experiment, base: Scene) -> str:
    """Write the page of a sweep: the picture and a table."""
    keys = ", ".join(f"`{key}`" for key in experiment.keys)
    lines = [
        f"# {base.name}, swept over {keys}",
        "",
        f"{len(experiment.points)} scenes, {len(experiment.results)} searches of up to "
        f"{experiment.budget} each, {experiment.over_seeds('medians over')}. "
        "*Gain* is over the uniform baseline of the same scene, *gap* to the best score of "
        "any search there.",
        "",
        f"![{'gain over uniform' if base.unit else 'score'} over {keys}](sweep.png)",
        "",
        *table(experiment, experiment.problems),
        *failures_section(experiment),
    ]
    return "\n".join(lines) + "\n"


def table(experiment: Experiment, problems: Iterable[str]) -> list[str]:
    """Return a line of Markdown for each problem and method, its best method first."""
    names = (
        *experiment.keys, "method", "score", "worst", "uniform", "gain", "gap", "to 1 %",
        "to 0.1 %", "layouts simulated",
    )  # fmt: skip
    rows: list[tuple[object, ...]] = []
    for problem in problems:
        runs = [found for m in experiment.methods if (found := experiment.of(m, problem))]
        for found in sorted(runs, key=lambda found: -_median([r.score for r in found])):
            gains = [r.gain for r in found if r.gain is not None]
            gaps = [gap for r in found if (gap := experiment.gap(r)) is not None]
            times = [_median([experiment.time_to(r, gap) for r in found]) for gap in (1e-2, 1e-3)]
            rows.append((
                *(f"{v:.6g}" if isinstance(v, float) else v for v in found[0].labels.values()),
                f"`{found[0].method}`",
                f"{_median([r.score for r in found]):.5f}",
                f"{min(r.score for r in found):.5f}",
                f"{found[0].uniform_score:.5f}",
                f"{_median(gains):+.2%}" if gains else "–",
                f"{_median(gaps):.3%}" if gaps else "–",
                *(_time(time, experiment.clock) for time in times),
                f"{_median([r.evaluations for r in found]):.0f}",
            ))  # fmt: skip
    lines = markdown_table(names, rows[:MOST_LINES])
    if len(rows) > MOST_LINES:
        lines += ["", f"{len(rows) - MOST_LINES} more lines are in the CSV file."]
    return lines


def failures_section(experiment: Experiment) -> list[str]:
    """Return the runs without a result, with the reasons, as lines of Markdown."""
    if not experiment.failures:
        return []
    lines = [f"- {one.task.name}: {one.reason}" for one in experiment.failures[:MOST_LINES]]
    return ["", "## Runs without a result", "", *lines]


def _median(values: list[float]) -> float:
    """Return the median; infinite where half of the seeds never came there."""
    return float(np.median(values))


def _time(value: float, clock: str) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.2g} s" if clock == "seconds" else f"{value:.0f}"
