"""Report of a benchmark: a table of all runs, from which all else is made; a page, pictures."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path

import msgspec
import numpy as np

from agents.benchmark import Target, hash_of, known_in, learns, problem_of_text
from agents.scripted import SCRIPTED
from domino_env import Scene
from domino_env.core.files import naming, write_text
from domino_env.core.tables import markdown_table, write_csv
from domino_env.scenes.distribution import load_any
from domino_env.scenes.uniform import gain
from optimize.experiments.estimates import (
    LEAST_RUNS,
    Estimate,
    estimate,
    interquartile_mean,
    median_of_problems,
    optimality_gap,
)
from optimize.experiments.experiment import Experiment, best_of_problems
from optimize.experiments.report import failures_section
from optimize.experiments.task import TaskResult

FILES = (
    "benchmark.md", "benchmark.csv", "benchmark-reached.png", "benchmark-seconds.png",
    "benchmark-steps.png",
)  # fmt: skip
MOMENTS = (1.0, 10.0, 60.0)  # [s] processor times of the columns "after"
COLUMNS = (
    "scene", "algorithm", "seed", "uniform", "score", "best_known", "normalised_score", "steps",
    "simulations", "gradients", "updates", "processor_seconds", "seconds_past_uniform", "key",
    "scene_hash", "versions", "trace",
)  # fmt: skip
TRACE_POINTS = 60  # points of a trace in the table
PAGE = Path(__file__).with_name("benchmark_page.md")  # template of the page
SAMPLED = (
    "Every episode of a training has a new scene. Scores, also in the curves, are median gains "
    "over the uniform baselines in the test set; that of searches with 2,500 evaluations each, {}, "
    "counts as best known. A search searches each of these scenes, and its time is that of all "
    "together."
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

    experiment = replace(experiment, results=tuple(map(_shortened, experiment.results)))
    lines = (
        (
            r.scene_name, r.method, r.seed, r.uniform_score, r.score, experiment.best[r.problem],
            round(float(experiment.normalised(r, r.score)), 5), r.evaluations, r.simulations,
            r.gradients, r.updates, r.seconds, experiment.seconds_past_uniform(r), r.key,
            hash_of(problem_of_text(r.scene)), json.dumps(r.versions),
            json.dumps([(steps, seconds, score) for steps, _, seconds, score in r.trace]),
        )
        for r in experiment.results
    )  # fmt: skip
    write_csv(folder / FILES[1], COLUMNS, lines)
    write_text(folder / FILES[0], page(experiment, command))
    draw_intervals(experiment, folder / FILES[2])
    solid = [name for name in experiment.methods if learns(name)]
    draw_over_clock(experiment, "seconds", folder / FILES[3], solid)
    draw_over_clock(experiment, "evaluations", folder / FILES[4], solid)


def _shortened(result: TaskResult) -> TaskResult:
    """Return a result as the table of runs has it, with fewer points and digits."""
    trace = result.trace
    indices = np.unique(np.linspace(0, len(trace) - 1, TRACE_POINTS).round().astype(int))
    points = [trace[i] for i in indices]
    return msgspec.structs.replace(
        result, seconds=round(result.seconds, 4),
        trace=[(n, 0, round(t, 4), float(f"{score:.7g}")) for n, _, t, score in points],
    )  # fmt: skip


def read_runs(path: Path, targets: Iterable[Target] = ()) -> list[TaskResult]:
    """Read the results in a table of runs, but none of scenes that have changed.

    Parameters
    ----------
    path
        The file; a missing one has no results.
    targets
        Scenes and distributions in addition to the shipped ones.

    Raises
    ------
    ValueError
        If the file is no table of runs.
    """
    if not path.exists():
        return []
    known = {target.name: target for target in targets}
    results = list[TaskResult]()
    with path.open(newline="", encoding="utf-8") as file, naming(path):
        lines = csv.DictReader(file)
        if tuple(lines.fieldnames or ()) != COLUMNS:
            raise ValueError(
                "it is no table of runs of this version: move it, or use another folder"
            )
        for line in lines:
            name = line["scene"]
            if name not in known:
                known[name] = load_any(name)
            if line["scene_hash"] == hash_of(known[name]):
                results.append(_result(line, known[name].to_toml()))
    return results


def _result(line: Mapping[str, str], scene: str) -> TaskResult:
    """Return the result of a line of the table of runs."""
    score, uniform = float(line["score"]), float(line["uniform"])
    trace = [(n, 0, seconds, value) for n, seconds, value in json.loads(line["trace"])]
    return TaskResult(
        key=line["key"], scene_name=line["scene"], method=line["algorithm"], seed=int(line["seed"]),
        score=score, uniform_score=uniform, gain=gain(score, uniform) if uniform else score,
        outcome="", mean_speed=0.0, spacing=(), thickness=(), height=(),
        evaluations=int(line["steps"]), falls=0, seconds=float(line["processor_seconds"]),
        trace=trace, versions=json.loads(line["versions"]), scene=scene,
        simulations=int(line["simulations"]), gradients=int(line["gradients"]),
        updates=int(line["updates"]),
    )  # fmt: skip


def merged(table: Iterable[TaskResult], experiment: Experiment | None = None) -> Experiment:
    """Return an experiment with the runs of a table too, where it has no such run of its own."""
    experiment = experiment or Experiment((), (), {})
    runs = {(r.scene_name, r.method, r.seed): r for r in (*table, *experiment.results)}
    results = tuple(runs.values())
    if not results:
        raise ValueError("no run has a result yet: leave out --page")
    best = best_of_problems(results, known_in, fixed=True)
    return replace(experiment, results=results, best=best)


def page(experiment: Experiment, command: str) -> str:
    """Return the page in Markdown."""
    sections = [_of_scene(experiment, scene) for scene in experiment.problems]
    lines = [*chain(*sections)][1:] + failures_section(experiment)
    made = Counter(
        ", ".join(f"{name} {value}" for name, value in r.versions.items())
        for r in experiment.results
    )
    problems = [next(r for r in experiment.results if r.problem == p) for p in experiment.problems]
    hashes = [(f"`{r.problem}`", hash_of(problem_of_text(r.scene))) for r in problems]
    return PAGE.read_text("utf-8").format(
        overview="\n\n".join(_overview(experiment)),
        work="\n".join(work(experiment)),
        improvement="\n".join(_improvement(experiment)),
        scenes="\n".join(lines),
        command=command,
        runs=len(experiment.results),
        minutes=sum(r.seconds for r in experiment.results) / 60.0,
        hashes="\n".join(markdown_table(("scene", "hash"), hashes)),
        made="\n".join(f"- {number} runs: {words}" for words, number in made.items()),
        least=LEAST_RUNS,
    )


def _overview(experiment: Experiment) -> list[str]:
    """Return a table for all algorithms with the same scenes and numbers of runs, with a title."""
    groups: dict[tuple[str, int], list[str]] = {}
    for name in experiment.ranked(()):
        counts = Counter(r.problem for r in experiment.runs(name))
        groups.setdefault((", ".join(sorted(counts)), min(counts.values())), []).append(name)
    for scenes, seeds in [key for key in groups if set(groups[key]) <= set(SCRIPTED)]:
        larger = [key for key in groups if key[0] == scenes and key[1] > seeds]
        if larger:  # scripted policies have no seeds: they join the largest group of their scenes
            groups[max(larger, key=lambda key: key[1])] += groups.pop((scenes, seeds))
    return [
        f"{scenes}, {seeds} run{'s' * (seeds > 1)} on each:\n\n"
        + "\n".join(table(experiment, names))
        for (scenes, seeds), names in sorted(groups.items(), key=lambda group: -len(group[1]))
    ]


def table(
    experiment: Experiment, names: Iterable[str] | None = None, scene: str | None = None
) -> list[str]:
    """Return the table of algorithms, learning ones first, the best of each first.

    Parameters
    ----------
    experiment
        The benchmark.
    names
        Names of the algorithms; None for all.
    scene
        Name of a scene, whose table has scores too; None for all scenes.
    """
    columns = ["algorithm", "runs", "interquartile mean", "median", "optimality gap"]
    columns += [f"after {moment:g} s" for moment in MOMENTS]
    columns += ["runs past uniform", "processor time", *["worst, best score"] * (scene is not None)]
    included = set(experiment.methods if names is None else names)
    lines = []
    for name in experiment.ranked([m for m in experiment.methods if learns(m)], scene):
        if name not in included:
            continue
        runs, scores = experiment.runs(name, scene), experiment.final_scores(name, scene)
        past = sum(r.score > r.uniform_score for r in runs)
        early = [experiment.score_after(name, moment, scene) for moment in MOMENTS]
        line = [
            f"`{name}`", len(runs), _in_words(interquartile_mean(scores)),
            f"{float(median_of_problems(scores)):.1%}",
            _in_words(estimate(optimality_gap, scores)),
            *(f"{score:.1%}" if np.isfinite(score) else "–" for score in early),
            f"{past} of {len(runs)}", _seconds(float(np.median([r.seconds for r in runs]))),
        ]  # fmt: skip
        if scene is not None:
            form = _form(runs[0])
            line.append(f"{form(min(r.score for r in runs))}, {form(max(r.score for r in runs))}")
        lines.append(line)
    return list(markdown_table(columns, lines))


def work(experiment: Experiment) -> list[str]:
    """Return a table of the work of a run of each algorithm, the median over its runs."""
    names = ("algorithm", "steps", "simulations", "gradients", "updates", "processor time")
    lines = []
    for name in experiment.methods:
        runs = experiment.runs(name)
        counts = ((r.evaluations, r.simulations, r.gradients, r.updates) for r in runs)
        medians = np.median(list(counts), axis=0)
        seconds = float(np.median([r.seconds for r in runs]))
        lines.append((f"`{name}`", *(f"{number:,.0f}" for number in medians), _seconds(seconds)))
    return list(markdown_table(names, lines))


def _improvement(experiment: Experiment) -> list[str]:
    """Return a table of the probability that the algorithm of a line is better than another."""
    names = experiment.ranked(())
    lines = []
    for first in names:
        results = (
            None if first == second else experiment.improvement(first, second) for second in names
        )
        lines.append((f"`{first}`", *("" if r is None else _in_words(r, 0) for r in results)))
    return list(markdown_table(("", *(f"`{name}`" for name in names)), lines))


def _in_words(result: Estimate, digits: int = 1) -> str:
    """Return an estimate with its interval, if it has one."""
    words = f"{float(result.value):.{digits}%}"
    if result.interval is None:
        return words
    low, high = map(float, result.interval)
    return f"{words} ({100.0 * low:.{digits}f} to {100.0 * high:.{digits}f})"


def _seconds(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds < 10.0 else f"{seconds:.0f} s"


def _of_scene(experiment: Experiment, scene: str) -> list[str]:
    """Return text and table of one scene as lines of Markdown."""
    result = next(r for r in experiment.results if r.problem == scene)
    best = _form(result)(experiment.best[scene])
    about = f"Uniform baseline {result.uniform_score:.5f}, best known {best}."
    if not isinstance(problem_of_text(result.scene), Scene):
        about = SAMPLED.format(best)
    return ["", f"## {scene}", "", about, "", *table(experiment, None, scene)]


def _form(result: TaskResult) -> Callable[[float], str]:
    """Return the format of the scores of a result: gains where scenes are sampled."""
    fixed = isinstance(problem_of_text(result.scene), Scene)
    return "{:.5f}".format if fixed else "{:+.2%}".format
