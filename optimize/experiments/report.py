"""Reports of experiments: a page of Markdown, a table, a picture, and summaries of studies.

The report of a comparison has curves over time, that of a sweep curves over the varied settings.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from domino_env.core.files import amount, one_line, write_text
from domino_env.core.tables import markdown_table, text_table
from optimize.experiments.experiment import Experiment, group_runs
from optimize.experiments.store import Store, Study, result_cells, write_table
from optimize.experiments.task import STOPPED_GAIN, TaskResult, describe_labels

# page, table of the runs, picture
COMPARISON_FILES = ("comparison.md", "runs.csv", "gaps.png")
SWEEP_FILES = ("sweep.md", "sweep.csv", "sweep.png")
MAX_LINES = 200  # of a table or list of a page; the CSV file has all results
PAGE = Path(__file__).with_name("report_page.md")  # template of the page
SCHEDULE = " With a schedule of hits, the score is 1/(1 + RMS error/tolerance)."


def write(experiment: Experiment, folder: Path) -> Sequence[str]:
    """Write the page, table and picture of a comparison or a sweep; return the files' names."""
    from optimize.experiments.pictures import draw_over_settings, draw_over_time

    if experiment.keys:
        names, draw = SWEEP_FILES, draw_over_settings
        scene = experiment.results[0].scene_name
        title = f"{scene}, swept over {', '.join(experiment.keys)}"
    else:
        names, draw, title = COMPARISON_FILES, draw_over_time, "Methods compared"
    write_table(folder / names[1], [_cells(experiment, r) for r in experiment.results])
    draw(experiment, folder / names[2])
    write_text(folder / names[0], page(experiment, title, names[2]))
    return names


def _cells(experiment: Experiment, result: TaskResult) -> dict[str, Any]:
    """Return the numbers of a run by column.

    Column gap is the shortfall; the time to a shortfall that is never reached is inf.
    """
    cells = {k: v for k, v in result_cells(result).items() if not isinstance(v, tuple | list)}
    del cells["scene"], cells["versions"]
    times = {
        f"{experiment.clock}_to_{percent:g}_percent": experiment.time_to(result, 0.01 * percent)
        for percent in (1.0, 0.1)
    }
    return cells | {"gap": experiment.shortfall(result)} | times


def page(experiment: Experiment, title: str, picture: str) -> str:
    """Return a page of Markdown: a section for each scene, or one table of a sweep.

    Parameters
    ----------
    experiment
        A comparison or a sweep.
    title
        Title of the page.
    picture
        Name of the picture's file.

    Returns
    -------
    str
        The page.
    """
    sections = ["", *table(experiment, experiment.problems)] if experiment.keys else []
    for problem in () if experiment.keys else experiment.problems:
        r = next(r for r in experiment.results if r.problem == problem)
        uniform, best = map(r.criterion.displayed, (r.uniform_score, experiment.best[problem]))
        text = f"Uniform baseline {uniform:.5f}, best known {best:.5f}."
        sections += ["", f"## {problem}", "", text, ""]
        sections += table(experiment, [problem])
    sections += failures_section(experiment)
    return PAGE.read_text("utf-8").format(
        title=title, picture=picture, runs=amount(len(experiment.results), "search"),
        limit=experiment.tasks[0].limit, over=experiment.describe_seeds("medians over"),
        clock="seconds" if experiment.clock == "seconds" else "layouts simulated",
        note=SCHEDULE * any(r.criterion.shows_errors for r in experiment.results),
        sections="\n".join(sections),
    )  # fmt: skip


def table(experiment: Experiment, problems: Sequence[str]) -> list[str]:
    """Return a Markdown table: a line for each problem and method, the best method first."""
    criteria = {r.problem: r.criterion for r in experiment.results if r.problem in problems}
    quantity = ", ".join(dict.fromkeys(criterion.quantity() for criterion in criteria.values()))
    is_relative = any(not criterion.shows_errors for criterion in criteria.values())
    relative = ["gain", "shortfall"] * is_relative  # in per cent
    names = (
        *experiment.keys, "method", quantity, "worst", "uniform", *relative, "to 1 %", "to 0.1 %",
        "layouts simulated",
    )  # fmt: skip
    time_format = "{:.2g} s" if experiment.clock == "seconds" else "{:.0f}"
    lines: list[tuple[object, ...]] = []
    for problem, criterion in criteria.items():
        groups = [runs for m in experiment.methods if (runs := experiment.runs(m, problem))]
        for runs in sorted(groups, key=lambda runs: -np.median([r.score for r in runs])):
            scores = [r.score for r in runs]
            gains = [STOPPED_GAIN if r.gain is None else r.gain for r in runs]
            shortfalls = [s for r in runs if (s := experiment.shortfall(r)) is not None]
            gain = f"{np.median(gains):+z.2%}" if np.median(gains) > STOPPED_GAIN else "–"
            shortfall = f"{np.median(shortfalls):.3%}" if shortfalls else "–"
            # infinite if half of the runs never came so near
            times = [np.median([experiment.time_to(r, s) for r in runs]) for s in (1e-2, 1e-3)]
            lines.append((
                *(f"{v:.6g}" if isinstance(v, float) else v for v in runs[0].labels.values()),
                f"`{runs[0].method}`",
                f"{np.median(criterion.displayed(scores)):.5f}",
                f"{criterion.displayed(min(scores)):.5f}",
                f"{criterion.displayed(runs[0].uniform_score):.5f}",
                *[gain, shortfall][: len(relative)],
                *(time_format.format(t) if np.isfinite(t) else "–" for t in times),
                f"{np.median([r.work['evaluations'] for r in runs]):.0f}",
            ))  # fmt: skip
    note = ["", f"{len(lines) - MAX_LINES} more: the CSV file has all results."]
    return markdown_table(names, lines[:MAX_LINES]) + (note if len(lines) > MAX_LINES else [])


def failures_section(experiment: Experiment) -> list[str]:
    """Return a section of Markdown with runs without a result and the reasons; empty for none."""
    if not experiment.failures:
        return []
    failures = experiment.failures[:MAX_LINES]
    lines = [f"- {failure.task.name}: {failure.reason}" for failure in failures]
    return ["", "## Runs without a result", "", *lines]


def list_studies(store: Store) -> list[str]:
    """Return a table of the studies of a store, as lines for a terminal."""
    names = ("study", "kind", "results", "begun")
    lines = [(s.name, s.kind, f"{s.result_count:,}", s.begun) for s in store.studies()]
    return text_table(names, lines, right={"results"}) if lines else [f"{store.path}: no studies"]


def summarise(study: Study) -> list[str]:
    """Return the settings of a study, and a table of its problems and methods."""
    results = study.results().values()
    about = f"{study.kind}, {len(results):,} finished tasks, begun {study.begun}"
    text = [f"{study.name}: {about}", describe_labels(study.settings)]
    names = ("problem", "method", "tasks", "quantity", "best", "median", "uniform", "gain")
    lines = []
    for group, runs in group_runs(results, "problem", "method").items():
        best = max(runs, key=lambda r: r.score)
        scores = best.score, np.median([r.score for r in runs]), best.uniform_score
        gain, quantity = "" if best.gain is None else f"{best.gain:+z.2%}", "gain"
        if best.uniform_score:  # it is 0 if scenes are sampled, whose scores are gains
            quantity, scores = best.criterion.quantity(), best.criterion.displayed(scores)
            gain *= not best.criterion.shows_errors
        lines.append((*group, str(len(runs)), quantity, *map("{:.6g}".format, scores), gain))
    table = ["", *text_table(names, lines, right=names[2:])] if lines else []
    return [*map(one_line, filter(None, text)), *table]
