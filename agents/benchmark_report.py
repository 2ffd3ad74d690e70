"""Report of a benchmark: a table of all runs, and a page and pictures made from it."""

from __future__ import annotations

import csv
import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from agents.algorithms import ALGORITHMS
from agents.benchmark import (
    BUDGETS,
    COLUMNS,
    FIRST_SEED,
    SCENES,
    TRACE_POINTS,
    ends_of_scale,
    read_target,
    references,
    target_hash,
    uniform_score,
)
from domino_env import Scene
from domino_env.core.checks import require_choice
from domino_env.core.files import amount, errors_with_path, one_line, write_text
from domino_env.core.results import revision
from domino_env.core.tables import markdown_table, write_csv
from domino_env.scenes.distribution import load_any
from optimize.experiments import estimates
from optimize.experiments.experiment import Experiment, best_of_problems, group_runs
from optimize.experiments.report import failures_section
from optimize.experiments.store import write_table
from optimize.experiments.task import TaskResult, Trace
from optimize.methods import registry

RUNS, SUMMARY, REPORT = "benchmark.csv", "benchmark-summary.csv", "benchmark.md"
INTERVALS, CURVES = "benchmark-reached.png", "benchmark-steps.png"
FILES = REPORT, RUNS, SUMMARY, INTERVALS, CURVES
WORK = "steps", "simulations", "gradients", "updates"  # counts of a run
EARLIER = "before 0.5.0"  # revision of runs by versions of the package that did not have one
STATISTICS: dict[str, estimates.Statistic] = {  # of the normalised scores
    "interquartile_mean": estimates.middle_mean, "median": estimates.median, "mean": estimates.mean,
}  # fmt: skip
LEAST_SEEDS = 5  # trainings of an algorithm on a scene
MOST_ERRORS = 5  # that are listed
ROLLOUT = 1.03  # steps of an evaluation over those after which it was due, at most
REST = 4 / 3  # steps of a training over those asked for, at most: whole rollouts
PAGE = Path(__file__).with_name("benchmark_page.md")  # template of the page


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
    from optimize.experiments.pictures import draw_intervals, draw_over_steps

    write_csv(folder / RUNS, COLUMNS, (_line(experiment, run) for run in experiment.results))
    write_table(folder / SUMMARY, list(_summary_lines(experiment)))
    write_text(folder / REPORT, page(experiment, command))
    learning = [name for name in experiment.methods if is_training(name)]
    groups = group_runs(experiment.results, "problem", "method")
    budgets = {key: max(map(budget_of, group)) for key, group in groups.items()}
    longest = [r for r in experiment.results if budget_of(r) == budgets[r.problem, r.method]]
    shown = replace(experiment, results=tuple(longest))
    draw_intervals(shown, folder / INTERVALS, learning)
    draw_over_steps(shown, folder / CURVES, learning)


def _line(experiment: Experiment, run: TaskResult) -> tuple[Any, ...]:
    """Return the cells of a run in the order of `COLUMNS`."""
    versions = dict(run.versions)
    own_revision = versions.pop("revision", EARLIER)
    entries = list(zip(*(run.trace[x] for x in ("steps", "seconds", "score")), strict=True))
    indices = np.unique(np.linspace(0, len(entries) - 1, TRACE_POINTS).round().astype(int))
    trace = [(n, round(t, 4), float(f"{x:.7g}")) for n, t, x in (entries[i] for i in indices)]
    return (
        run.scene_name, run.method, run.seed, own_revision, run.uniform_score, run.score,
        round(float(experiment.normalise(run, run.score)), 5),
        *(run.work.get(name, 0) for name in WORK), round(run.seconds, 4), run.key,
        target_hash(read_target(run.scene)), json.dumps(versions), json.dumps(trace),
    )  # fmt: skip


def read_runs(path: Path) -> list[TaskResult]:
    """Read and check the runs of a file such as `RUNS`.

    Raises
    ------
    ValueError
        If columns are missing or a line is invalid; the message has the first `MOST_ERRORS` errors,
        each with line, column, value, accepted values and what to do.
    """
    runs, errors = [], list[str]()
    with errors_with_path(path), path.open(newline="", encoding="utf-8") as file:
        lines = csv.DictReader(file)
        if missing := [name for name in COLUMNS if name not in (lines.fieldnames or ())]:
            raise ValueError(
                f"without the columns {', '.join(missing)}: write it by `domino benchmark`"
            )
        for number, line in enumerate(lines, 2):
            try:
                runs.append(_read_run(line))
            except ValueError as error:
                errors.append(f"line {number}: {error}")
        errors += _errors_of_seeds(runs)
        if errors:
            more = [f"{len(errors) - MOST_ERRORS} more"] * (len(errors) > MOST_ERRORS)
            listed = "; ".join([*errors[:MOST_ERRORS], *more])
            raise ValueError(f"{amount(len(errors), 'error')}: {listed}")
    return runs


def _read_run(line: dict[str, str]) -> TaskResult:
    """Return the run of a line by column; raise ValueError for an invalid value."""
    require_choice("scene", line["scene"], SCENES)
    if line["revision"] not in (revision(), EARLIER):
        raise ValueError(
            f"revision = '{line['revision']}': these are environments of revision {revision()}, "
            "with other scenes or rewards; run it again with this version"
        )
    target, text, own_hash, uniform, (zero, one) = _shipped_target(line["scene"])
    if line["scene_hash"] != own_hash:
        raise ValueError(
            f"scene_hash = '{line['scene_hash']}': scene '{target.name}' has {own_hash}; run it "
            "with the shipped scene and its test set"
        )
    ranges = {
        "seed": (FIRST_SEED, 2**32 - 1), "uniform": (0.0, math.inf), "score": (-1.0, math.inf),
        "normalised_score": (-math.inf, math.inf), "processor_seconds": (0.0, math.inf),
    } | dict.fromkeys(WORK, (0, math.inf))  # fmt: skip
    values: dict[str, Any] = {}
    for name, (low, high) in ranges.items():
        kind = int if name in ("seed", *WORK) else float
        try:
            values[name] = value = kind(line[name])
        except ValueError:
            value = math.nan
        if not low <= value <= high or (math.isinf(value) and name != "normalised_score"):
            word = "a whole number" if kind is int else "a number"
            raise ValueError(f"{name} = '{line[name]}': give {word} from {low:g} to {high:g}")
    expected = float(estimates.normalise(values["score"], zero, one))
    for name, value, tolerance in (
        ("uniform", uniform, 1e-6), ("normalised_score", expected, 1e-4)
    ):  # fmt: skip
        if not abs(values[name] - value) <= tolerance:
            raise ValueError(
                f"{name} = {line[name]}: in scene '{target.name}' it is {value:.5f} for a score of "
                f"{line['score']}; do not edit the file of `domino benchmark`"
            )
    trace, score = _read_trace(line, values), values["score"]
    gain = score if not uniform else None
    if isinstance(target, Scene):
        gain = target.gain(score, uniform)
    return TaskResult(
        key=line["key"], scene_name=target.name, method=line["algorithm"], seed=values["seed"],
        score=score, uniform_score=uniform, gain=gain, seconds=values["processor_seconds"],
        work={name: values[name] for name in WORK}, trace=trace, scene=text,
        versions={"revision": line["revision"], **_read_json(line, "versions")},
    )  # fmt: skip


@lru_cache(len(SCENES))
def _shipped_target(name: str) -> tuple[Any, str, str, float, tuple[float, float]]:
    """Return a target of the benchmark with its text, its hash and its reference scores."""
    target = load_any(name)
    ends = uniform_score(target), ends_of_scale(target)
    return target, target.to_toml(), target_hash(target), *ends


def _read_json(line: dict[str, str], name: str) -> Any:
    """Return the value of a column in JSON."""
    try:
        value = json.loads(line[name])
        return dict(value) if name == "versions" else value
    except (TypeError, ValueError) as error:  # no text if the line was cut off
        raise ValueError(f"{name}: not JSON ({error}); copy the whole line") from None


def _read_trace(line: dict[str, str], values: dict[str, Any]) -> Trace:
    """Return the trace of a line; raise a ValueError if it does not lead to the values."""
    entries, names = _read_json(line, "trace"), ("steps", "seconds", "score")
    try:
        table = np.array(entries, np.float64).reshape(-1, len(names))
    except (TypeError, ValueError):
        table = np.full((1, len(names)), np.nan)
    steps, _, scores = table.T
    ends = len(table) and abs(scores[-1] - values["score"]) <= 1e-5 * max(1.0, abs(scores[-1]))
    ends = ends and steps[-1] <= values["steps"]
    if not (np.isfinite(table).all() and np.all(np.diff(steps) >= 0.0) and ends):
        raise ValueError(
            f"trace = '{one_line(line['trace'], 60)}': give lists of steps, seconds and score with "
            f"ascending steps, which end at {values['steps']} steps or before and at the score "
            f"{line['score']}; copy the whole line"
        )
    return dict(zip(names, ([*column] for column in zip(*entries, strict=True)), strict=True))


@lru_cache(100)
def is_training(method: str) -> bool:
    """Return True for a learning algorithm; the code of third-party ones is not imported."""
    family, colon, _ = method.partition(":")
    searches = *registry.METHODS, *registry.THIRD_PARTY, *registry.installed_families()
    return method in ALGORITHMS or (bool(colon) and family not in searches)


def _errors_of_seeds(runs: Iterable[TaskResult]) -> Iterator[str]:
    """Yield a sentence for each algorithm on a scene with repeated or too few seeds."""
    groups = group_runs(runs, "scene_name", "method")
    budgets = {(key, budget_of(run)): None for key, group in groups.items() for run in group}
    for (scene, method), budget in budgets:
        group = groups[scene, method]
        seeds = Counter(run.seed for run in group if budget_of(run) == budget)
        if repeated := [str(seed) for seed, times in seeds.items() if times > 1]:
            yield f"{method} on {scene}: seed {', '.join(repeated)} has several lines; keep one"
        if is_training(method) and len(seeds) < LEAST_SEEDS:
            yield (
                f"{method} on {scene}: {amount(len(seeds), 'seed')}; run at least {LEAST_SEEDS} "
                f"(--seeds {LEAST_SEEDS}, better 10)"
            )


def gather(stored: Iterable[TaskResult], experiment: Experiment | None = None) -> Experiment:
    """Return an experiment with the stored runs of its study added.

    Its own runs, or later ones, replace those of the same scene, method, seed and budget. Runs on
    an earlier scene of the same name are left out. Scenes are in the order of `SCENES`.

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
    runs = [run for run in runs if run.scene == scenes[run.scene_name]]
    latest = {(run.scene, run.method, run.seed, budget_of(run)): run for run in runs}
    order = {name: i for i, name in enumerate(SCENES)}
    results = sorted(latest.values(), key=lambda run: order.get(run.scene_name, len(order)))
    texts = {run.problem: run.scene for run in results}
    ends = {problem: ends_of_scale(read_target(text)) for problem, text in texts.items()}
    best = best_of_problems(results, lambda run: ends[run.problem][1], fixed=True)
    zero = {problem: low for problem, (low, _) in ends.items()}
    return replace(experiment, results=tuple(results), best=best, zero=zero)


def page(experiment: Experiment, command: str) -> str:
    """Return the page in Markdown; see `write` for the arguments."""
    scales = []
    for scene in experiment.problems:
        run = next(r for r in experiment.results if r.problem == scene)
        hindsight = references().get(scene, {}).get("hindsight")
        ends = experiment.zero[scene], experiment.best[scene], hindsight
        numbers = ("" if x is None else _score_text(run, x) for x in ends)
        scales.append((f"`{scene}`", *numbers, f"`{target_hash(read_target(run.scene))}`"))
    revisions = Counter(run.versions.get("revision", EARLIER) for run in experiment.results)
    return PAGE.read_text("utf-8").format(
        summary="\n".join(tables(experiment)),
        scales="\n".join(markdown_table(("scene", "0 %", "100 %", "hindsight", "hash"), scales)),
        failures="\n".join(failures_section(experiment)),
        command=command,
        runs=len(experiment.results),
        minutes=sum(r.seconds for r in experiment.results) / 60.0,
        revisions=", ".join(f"{number} of revision {name}" for name, number in revisions.items()),
        least=estimates.LEAST_RUNS,
    )


def budget_of(run: TaskResult) -> float:
    """Return the budget of a training, inf beyond all of `BUDGETS`; 0 for another method."""
    if not is_training(run.method):
        return 0.0
    return next((b for b in BUDGETS if run.work["steps"] <= REST * b), math.inf)


def _classes(experiment: Experiment) -> list[tuple[str, Experiment]]:
    """Return titled parts: trainings until each budget, and methods that need no training.

    A longer training counts until a budget if its algorithm has none for this budget on the scene.
    """
    learners = [run for run in experiment.results if is_training(run.method)]
    whole = replace(experiment, results=tuple(learners))
    parts = []
    for budget in BUDGETS:
        own = {(run.problem, run.method) for run in learners if budget_of(run) == budget}
        runs = [
            run for run in learners
            if budget_of(run) >= budget
            and (budget_of(run) == budget or (run.problem, run.method) not in own)
        ]  # fmt: skip
        part = replace(whole, results=tuple(runs)).until("steps", ROLLOUT * budget, REST * budget)
        if part.results:
            parts.append((f"Trainings until {budget:,} steps:", part))
    others = [run for run in experiment.results if not is_training(run.method)]
    if others:
        title = "Methods that need no training, to their ends:"
        parts.append((title, replace(experiment, results=tuple(others))))
    return parts


def tables(experiment: Experiment) -> list[str]:
    """Return titled tables of trainings until each budget and of methods that need no training."""
    parts = ([title, "", *table(part), ""] for title, part in _classes(experiment))
    return [*chain.from_iterable(parts)][:-1]


def table(experiment: Experiment) -> list[str]:
    """Return a Markdown table: a line for each algorithm, with its mean score on each scene.

    Means over scenes are over those on which all algorithms have runs; if there is none, over those
    of each algorithm.
    """
    lines = []
    shared = set(experiment.problems)
    for name in experiment.methods:
        shared &= {run.problem for run in experiment.runs(name)}
    common = [run for run in experiment.results if run.problem in shared or not shared]
    compared = replace(experiment, results=tuple(common))
    for name in compared.rank(()):
        runs, scores = compared.runs(name), compared.final_scores(name)
        counts = sorted({len(compared.runs(name, scene)) for scene in {r.problem for r in runs}})
        cells = (
            f"{float(experiment.mean_score(name, scene).value):.0%}"
            if experiment.runs(name, scene) else ""
            for scene in experiment.problems
        )  # fmt: skip
        steps, seconds = np.median([found_at(run) for run in runs], axis=0)
        lines.append((
            f"`{name}`", *cells,
            *(_estimate_text(estimates.estimate(f, scores)) for f in STATISTICS.values()),
            " to ".join(map(str, dict.fromkeys((counts[0], counts[-1])))),
            f"{steps:,.0f}", f"{float(f'{seconds:.2g}'):g} s",
        ))  # fmt: skip
    means = (name.replace("_", " ") for name in STATISTICS)
    names = "algorithm", *experiment.problems, *means, "runs", "steps", "processor time"
    return markdown_table(names, lines)


def _summary_lines(experiment: Experiment) -> Iterator[dict[str, Any]]:
    """Yield the numbers of each algorithm on each scene, of each part of `_classes`."""
    for title, part in _classes(experiment):
        for (scene, method), runs in group_runs(part.results, "problem", "method").items():
            line: dict[str, Any] = {"scene": scene, "algorithm": method}
            line |= {"budget": title.partition(":")[0], "runs": len(runs)}
            steps, seconds = np.median([found_at(run) for run in runs], axis=0)
            line |= {"steps": float(steps), "processor_seconds": float(seconds)}
            for name, statistic in STATISTICS.items():
                result = estimates.estimate(statistic, part.final_scores(method, scene))
                line[name] = float(result.value)
                low, high = result.interval or (np.nan, np.nan)
                line |= {f"{name}_low": float(low), f"{name}_high": float(high)}
            scores = [run.score for run in runs]
            line |= {"worst_score": min(scores), "best_score": max(scores)}
            line["past_uniform"] = sum(run.score > run.uniform_score for run in runs)
            yield line


def found_at(run: TaskResult) -> tuple[float, float]:
    """Return steps and processor time [s] after which the final score of a run was found."""
    scores = np.array(run.trace["score"])
    first = int(np.flatnonzero(np.append(True, scores[1:] != scores[:-1]))[-1])  # last change
    return float(run.trace["steps"][first]), float(run.trace["seconds"][first])


def _estimate_text(result: estimates.Estimate) -> str:
    """Format an estimate with its interval, if it has one."""
    value = f"{float(result.value):.1%}"
    if result.interval is None:
        return value
    low, high = map(float, result.interval)
    return f"{value} ({100.0 * low:.1f} to {100.0 * high:.1f})"


def _score_text(result: TaskResult, score: float) -> str:
    """Format a score on the problem of a result; a gain if scenes are sampled (uniform 0)."""
    return f"{score:.5f}" if result.uniform_score else f"{score:+z.2%}"
