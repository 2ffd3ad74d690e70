"""Report of a benchmark: a table of all runs, and a page and pictures made from it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from agents.benchmark import TRACE_POINTS, best_known_score, is_learner, read_target, target_hash
from agents.scripted import SCRIPTED
from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table, write_csv
from optimize.experiments import estimates
from optimize.experiments.experiment import Experiment, best_of_problems
from optimize.experiments.report import failures_section
from optimize.experiments.task import TaskResult, Trace

RUNS, REPORT, INTERVALS = "benchmark.csv", "benchmark.md", "benchmark-reached.png"
# pictures of scores over processor time and over dominoes placed
OVER_CLOCK = {"seconds": "benchmark-seconds.png", "steps": "benchmark-steps.png"}
FILES = REPORT, RUNS, INTERVALS, *OVER_CLOCK.values()
TIMES = (1.0, 10.0, 60.0)  # [s] processor times of the columns "after"
WORK = "steps", "simulations", "gradients", "updates"  # counts of a run
COLUMNS = (
    "scene", "algorithm", "seed", "uniform", "score", "best_known", "normalised_score", *WORK,
    "processor_seconds", "key", "scene_hash", "versions", "trace",
)  # fmt: skip
PAGE = Path(__file__).with_name("benchmark_page.md")  # template of the page
# text of the section of a scene distribution
SAMPLED = (
    "Every episode of a training has a new scene. Scores, also in the curves, are median gains "
    "over the uniform baselines in the test set. The best known score, {}, is that of searches "
    "with 2,500 evaluations per scene. A search method searches in each scene of the test set; its "
    "time is the sum over these scenes."
)


def write(experiment: Experiment, folder: Path, command: str) -> None:
    """Write `FILES`; leave other files in the folder unchanged.

    Parameters
    ----------
    experiment
        Results of the benchmark.
    folder
        Folder of the files.
    command
        Command that repeats the benchmark, quoted on the page.
    """
    from optimize.experiments.pictures import draw_intervals, draw_over_clock

    lines = (
        (
            r.scene_name, r.method, r.seed, r.uniform_score, r.score, experiment.best[r.problem],
            round(float(experiment.normalise(r, r.score)), 5),
            *(r.work.get(name, 0) for name in WORK), round(r.seconds, 4),
            r.key, target_hash(read_target(r.scene)), json.dumps(r.versions), _trace_text(r.trace),
        )
        for r in experiment.results
    )  # fmt: skip
    write_csv(folder / RUNS, COLUMNS, lines)
    write_text(folder / REPORT, page(experiment, command))
    learning = [name for name in experiment.methods if is_learner(name)]
    draw_intervals(experiment, folder / INTERVALS, learning)
    for clock, picture in OVER_CLOCK.items():
        draw_over_clock(experiment, clock, folder / picture, learning)


def _trace_text(trace: Trace) -> str:
    """Return at most `TRACE_POINTS` entries of a trace: [steps, seconds, score], as JSON."""
    entries = list(zip(trace["steps"], trace["seconds"], trace["score"], strict=True))
    indices = np.unique(np.linspace(0, len(entries) - 1, TRACE_POINTS).round().astype(int))
    chosen = [entries[i] for i in indices]
    return json.dumps([(n, round(t, 4), float(f"{score:.7g}")) for n, t, score in chosen])


def gather(stored: Iterable[TaskResult], experiment: Experiment | None = None) -> Experiment:
    """Return an experiment with the stored runs of its study added.

    Its own runs, or later ones, replace those of the same scene, method and seed. Runs on an
    earlier scene of the same name are left out.

    Raises
    ------
    ValueError
        If there is no run.
    """
    experiment = experiment or Experiment((), (), {})
    runs = [*stored, *experiment.results]
    if not runs:
        raise ValueError("no run has a result yet: leave out --page")
    scenes = {run.scene_name: run.scene for run in runs}
    latest = {(r.scene, r.method, r.seed): r for r in runs if r.scene == scenes[r.scene_name]}
    results = tuple(latest.values())
    best = best_of_problems(results, best_known_score, fixed=True)
    return replace(experiment, results=results, best=best)


def page(experiment: Experiment, command: str) -> str:
    """Return the page in Markdown; see `write` for the arguments."""
    sections = [_scene_section(experiment, scene) for scene in experiment.problems]
    lines = [*chain(*sections)][1:] + failures_section(experiment)
    machines = Counter(
        ", ".join(f"{name} {value}" for name, value in r.versions.items())
        for r in experiment.results
    )
    firsts = [next(r for r in experiment.results if r.problem == p) for p in experiment.problems]
    hashes = [(f"`{r.problem}`", target_hash(read_target(r.scene))) for r in firsts]
    return PAGE.read_text("utf-8").format(
        summary="\n".join(_summary_table(experiment)),
        overview="\n\n".join(_overview(experiment)),
        work="\n".join(_work_table(experiment)),
        scenes="\n".join(lines),
        command=command,
        runs=len(experiment.results),
        minutes=sum(r.seconds for r in experiment.results) / 60.0,
        hashes="\n".join(markdown_table(("scene", "hash"), hashes)),
        made="\n".join(f"- {number} runs: {text}" for text, number in machines.items()),
        least=estimates.LEAST_RUNS,
    )


def _summary_table(experiment: Experiment) -> list[str]:
    """Return a table of the interquartile means of each algorithm on each scene."""
    lines = []
    for name in experiment.rank([m for m in experiment.methods if is_learner(m)]):
        runs = {scene: experiment.runs(name, scene) for scene in experiment.problems}
        cells = (
            f"{float(experiment.mean_score(name, s).value):.1%}" if runs[s] else ""
            for s in experiment.problems
        )
        lines.append((f"`{name}`", *cells))
    return list(markdown_table(("algorithm", *experiment.problems), lines))


def _overview(experiment: Experiment) -> list[str]:
    """Return a titled table for each group of algorithms with the same scenes, if several."""
    groups: dict[str, list[str]] = {}
    for name in experiment.rank(()):
        if name in SCRIPTED:  # one run on a scene, in its section
            continue
        scenes = sorted({r.problem for r in experiment.runs(name)})
        if len(scenes) > 1 or len(experiment.problems) == 1:  # else in the section of the scene
            groups.setdefault(", ".join(scenes), []).append(name)
    return [
        f"{scenes}:\n\n" + "\n".join(table(experiment, names))
        for scenes, names in sorted(groups.items(), key=lambda group: -len(group[1]))
    ]


def table(
    experiment: Experiment, names: Iterable[str] | None = None, scene: str | None = None
) -> list[str]:
    """Return a Markdown table of algorithms, sorted by score, with learning algorithms first.

    Parameters
    ----------
    experiment
        The benchmark.
    names
        Names of the algorithms; None for all.
    scene
        Name of the scene whose runs are shown, with the worst and the best score; None for the runs
        in all scenes.

    Returns
    -------
    list of str
        Lines of the table.
    """
    columns = ["algorithm", "runs", "interquartile mean", "processor time"]
    columns += [f"after {time:g} s" for time in TIMES]
    columns += ["past uniform", "optimality gap", *["worst, best score"] * (scene is not None)]
    selection = set(experiment.methods if names is None else names)
    lines = []
    for name in experiment.rank([m for m in experiment.methods if is_learner(m)], scene):
        if name not in selection:
            continue
        runs, scores = experiment.runs(name, scene), experiment.final_scores(name, scene)
        past = sum(r.score > r.uniform_score for r in runs)
        early = [experiment.score_after(name, time, scene) for time in TIMES]
        line = [
            f"`{name}`", len(runs), _estimate_text(experiment.mean_score(name, scene)),
            _seconds_text(float(np.median([r.seconds for r in runs]))),
            *(f"{score:.1%}" if np.isfinite(score) else "–" for score in early),
            f"{past} of {len(runs)}",
            _estimate_text(estimates.estimate(estimates.optimality_gap, scores)),
        ]  # fmt: skip
        if scene is not None:
            worst, best = (choose(r.score for r in runs) for choose in (min, max))
            line.append(f"{_score_text(runs[0], worst)}, {_score_text(runs[0], best)}")
        lines.append(line)
    return list(markdown_table(columns, lines))


def _work_table(experiment: Experiment) -> list[str]:
    """Return a table of the ranges of steps, simulations, updates and times of each algorithm."""
    lines = []
    for name in experiment.methods:
        runs = experiment.runs(name)
        counts = ((r.work.get(count, 0) for r in runs) for count in WORK)
        work = (_ends_text("{:,.0f}".format, values) for values in counts)
        lines.append((f"`{name}`", *work, _ends_text(_seconds_text, (r.seconds for r in runs))))
    return list(markdown_table(("algorithm", *WORK, "processor time"), lines))


def _ends_text(format_value: Callable[[float], str], values: Iterable[float]) -> str:
    """Format the smallest and the largest value, or the only one."""
    ordered = sorted(values)
    return " to ".join(dict.fromkeys(map(format_value, (ordered[0], ordered[-1]))))


def _estimate_text(result: estimates.Estimate) -> str:
    """Format an estimate with its interval, if it has one."""
    value = f"{float(result.value):.1%}"
    if result.interval is None:
        return value
    low, high = map(float, result.interval)
    return f"{value} ({100.0 * low:.1f} to {100.0 * high:.1f})"


def _seconds_text(seconds: float) -> str:
    """Format a time with its unit."""
    return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"


def _scene_section(experiment: Experiment, scene: str) -> list[str]:
    """Return the section of a scene as lines of Markdown."""
    result = next(r for r in experiment.results if r.problem == scene)
    best = _score_text(result, experiment.best[scene])
    text = f"Uniform baseline {result.uniform_score:.5f}, best known {best}."
    if not result.uniform_score:  # scenes are sampled
        text = SAMPLED.format(best)
    return ["", f"## {scene}", "", text, "", *table(experiment, None, scene)]


def _score_text(result: TaskResult, score: float) -> str:
    """Format a score on the problem of a result; a gain if scenes are sampled (uniform 0)."""
    return f"{score:.5f}" if result.uniform_score else f"{score:+.2%}"
