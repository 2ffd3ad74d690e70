"""What a sweep leaves in its folder: a page of Markdown, a table in CSV, a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table, write_csv
from optimize.studies.task import TaskResult
from optimize.sweeps.runner import Sweep

FILES = ("sweep.md", "sweep.csv", "sweep.png")
MOST_LINES = 200  # of the page's table; the CSV has all
RESULT_NAMES = (
    "method", "seed", "score", "uniform", "gain", "gap", "outcome", "mean_speed", "evaluations",
    "falls", "seconds", "key",
)  # fmt: skip


def write(sweep: Sweep, folder: Path) -> None:
    """Write all FILES; what else lies in the folder stays."""
    from optimize.sweeps.picture import draw

    folder.mkdir(parents=True, exist_ok=True)
    names = (*sweep.keys, *RESULT_NAMES)
    write_csv(folder / "sweep.csv", names, (_row(sweep, result) for result in sweep.results))
    draw(sweep, folder / "sweep.png")
    write_text(folder / "sweep.md", page(sweep))


def page(sweep: Sweep) -> str:
    """Write the page: the picture and a table, a line for each point and method."""
    seeds = len({r.seed for r in sweep.results})
    over = "one seed" if seeds == 1 else f"medians over {seeds} seeds"
    keys = ", ".join(f"`{key}`" for key in sweep.keys)
    asked = {(r.seed, r.evaluations) for r in sweep.results}
    lines = [
        f"# {sweep.scene.name}, swept over {', '.join(sweep.keys)}",
        "",
        f"{sweep.scene.title}, varied in {keys}: {len(sweep.points)} scenes, "
        f"{len(sweep.results)} searches of up to {max(n for _, n in asked)} rows each, "
        f"{over}. *Gain* is over the best uniform row of the same scene, "
        "*gap* to the best score of any search there.",
        "",
        f"![{'gain over uniform' if sweep.scene.unit else 'score'} over {keys}](sweep.png)",
        "",
        *table(sweep),
    ]
    if sweep.failures:
        lines += ["", "## Searches without a result", ""]
        lines += [f"- {one.task.name}: {one.reason}" for one in sweep.failures[:MOST_LINES]]
    return "\n".join(lines) + "\n"


def table(sweep: Sweep) -> list[str]:
    """Make a line for each point and method, lines of Markdown."""
    names = (*sweep.keys, "method", "score", "uniform", "gain", "gap")
    groups: dict[tuple[tuple[float | int | str, ...], str], list[TaskResult]] = {}
    for result in sweep.results:
        groups.setdefault((sweep.point(result), result.method), []).append(result)
    best, rows = sweep.best, []
    for (point, method), found in list(groups.items())[:MOST_LINES]:
        score = _median([r.score for r in found])
        gains = [r.gain for r in found if r.gain is not None]
        rows.append(
            (
                *(f"{value:.6g}" if isinstance(value, float) else value for value in point),
                f"`{method}`",
                f"{score:.5f}",
                f"{found[0].uniform_score:.5f}",
                f"{_median(gains):+.2%}" if gains else "–",
                "–" if best[point] == 0.0 else f"{(best[point] - score) / abs(best[point]):.3%}",
            )
        )
    lines = markdown_table(names, rows)
    if len(groups) > MOST_LINES:
        lines += ["", f"{len(groups) - MOST_LINES} more lines are in sweep.csv."]
    return lines


def _row(sweep: Sweep, r: TaskResult) -> tuple[object, ...]:
    best = sweep.best_of(r)
    return (
        *(value for _, value in r.labels),
        r.method,
        r.seed,
        r.score,
        r.uniform_score,
        r.gain,
        None if best == 0.0 else (best - r.score) / abs(best),
        r.outcome,
        r.mean_speed,
        r.evaluations,
        r.falls,
        r.seconds,
        r.key,
    )


def _median(values: list[float]) -> float:
    return float(np.median(values))
