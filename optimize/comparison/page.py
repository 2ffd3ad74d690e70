"""What a comparison leaves in its folder: a page of Markdown, tables in CSV, pictures."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table, write_csv
from optimize.comparison.runner import Comparison
from optimize.result import SearchResult

FILES = ("comparison.md", "runs.csv", "traces.csv", "gaps.png", "targets.png")
RUN_NAMES = (
    "scene", "method", "seed", "score", "gain", "gap", "{}_to_1_percent", "{}_to_0.1_percent",
    "evaluations", "seconds",
)  # fmt: skip
TRACE_NAMES = ("scene", "method", "seed", "evaluations", "falls", "seconds", "score")


def write(comparison: Comparison, folder: Path) -> None:
    """Write all FILES; what else lies in the folder stays."""
    from optimize.comparison.picture import draw_gaps, draw_targets

    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "comparison.md", page(comparison))
    clock = "seconds" if comparison.evaluations is None else "evaluations"
    names = [name.format(clock) for name in RUN_NAMES]
    write_csv(folder / "runs.csv", names, (row(comparison, r) for r in comparison.results))
    write_csv(folder / "traces.csv", TRACE_NAMES, _steps(comparison))
    draw_gaps(comparison, folder / "gaps.png")
    draw_targets(comparison, folder / "targets.png")


def row(comparison: Comparison, result: SearchResult) -> tuple[object, ...]:
    """Give what RUN_NAMES name of one run; inf where a gap was never reached."""
    best = comparison.best[result.scene.name]
    return (
        result.scene.name,
        result.method,
        result.seed,
        result.score,
        result.gain,
        (best - result.score) / abs(best),
        comparison.time_to(result, 1e-2),
        comparison.time_to(result, 1e-3),
        result.evaluations,
        result.seconds,
    )


def page(comparison: Comparison) -> str:
    """Write the page: a table for each scene, best method first, and the pictures."""
    seeds = len({r.seed for r in comparison.results})
    over = "one seed. " if seeds == 1 else f"{seeds} seeds. Medians over the seeds, with the worst "
    over += "" if seeds == 1 else "seed beside the score. "
    budget = f"{comparison.evaluations} rows"
    if comparison.evaluations is None:
        budget = f"{comparison.seconds:g} s"
    lines = [
        "# Methods compared",
        "",
        f"{budget} for each run, {over}*Gain* is over the best uniform pitch, *gap* to the best "
        "score known; times are those at which a run came within 1 % and 0.1 % of it.",
    ]
    if any(method.startswith("agent:") for method in comparison.methods):
        lines += [
            "",
            "The clock of `agent:RUN` began with its training, which may have taken longer than "
            "the others were given: its row stands where that ends.",
        ]
    for scene in comparison.scenes:
        lines += ["", f"## {scene}", "", _about(comparison, scene), "", *table(comparison, scene)]
    if comparison.failures:
        lines += ["", "## Runs without a result", ""]
        lines += [f"- {one.task.name}: {one.reason}" for one in comparison.failures]
    lines += [
        "",
        "## Gap against run time",
        "",
        "One seed." if seeds == 1 else "Median over the seeds, and their range.",
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


def table(comparison: Comparison, scene: str) -> list[str]:
    """Make one scene's table, lines of Markdown."""
    names = (
        "method", "score", "worst", "gain", "gap", "to 1 %", "to 0.1 %", "rows simulated",
    )  # fmt: skip
    rows = []
    runs = {m: comparison.of(scene, m) for m in comparison.methods}
    runs = {m: found for m, found in runs.items() if found}
    best = comparison.best[scene]
    for method in sorted(runs, key=lambda m: -_median([r.score for r in runs[m]])):
        found = runs[method]
        scores = [r.score for r in found]
        gains = [r.gain for r in found if r.gain is not None]
        rows.append(
            (
                f"`{method}`",
                f"{_median(scores):.5f}",
                f"{min(scores):.5f}",
                f"{_median(gains):+.2%}" if gains else "–",
                f"{(best - _median(scores)) / abs(best):.3%}",
                _time(_median([comparison.time_to(r, 1e-2) for r in found]), comparison.unit),
                _time(_median([comparison.time_to(r, 1e-3) for r in found]), comparison.unit),
                f"{_median([r.evaluations for r in found]):.0f}",
            )
        )
    return markdown_table(names, rows)


def _about(comparison: Comparison, scene: str) -> str:
    result = next(r for r in comparison.results if r.scene.name == scene)
    mark = result.uniform.score
    # a stranger's title is text, not Markdown
    title = re.sub(r"([\\`*_\[\]<>!|&])", r"\\\1", result.scene.title)
    return f"{title}. Best uniform pitch {mark:.5f}, best known {comparison.best[scene]:.5f}."


def _median(values: list[float]) -> float:
    """Infinite where half of the seeds never came there."""
    return float(np.median(values))


def _time(value: float, unit: str) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.2g} s" if unit == "s" else f"{value:.0f}"


def _steps(comparison: Comparison) -> Iterable[tuple[object, ...]]:
    for r in comparison.results:
        for evaluations, falls, seconds, score in r.trace:
            yield r.scene.name, r.method, r.seed, evaluations, falls, f"{seconds:.6f}", score
