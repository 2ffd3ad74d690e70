"""Result of a search: its best layout, beside the uniform baseline."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from domino_env.core.files import amount
from domino_env.core.results import document, versions
from domino_env.core.types import Floats
from domino_env.scenes.objectives.base import Objective
from domino_env.scenes.uniform import UniformBaseline
from domino_env.view.notebook import SceneResult

Trace = tuple[tuple[int, int, float, float], ...]  # see `SearchResult.trace`


@dataclass(frozen=True, eq=False)
class SearchResult(SceneResult):
    """Best layout of a search, simulated at a tight tolerance, and the uniform baseline.

    Attributes
    ----------
    scene
        The scene.
    layout
        The best layout.
    wave
        Wave of the layout, simulated at a relative error of 1e-10.
    score
        Score of the layout.
    method
        Name of the method.
    seed
        Seed of all randomness; None if the search was given a generator.
    uniform
        The uniform baseline: the best layout with equal gaps, its wave and score.
    trace
        (evaluations, simulated intervals between hits, seconds, best score) at every improvement
        and at the end. Scores of the search are computed at a relative error of 1e-6.
    evaluations
        Number of layouts simulated.
    falls
        Number of intervals between hits simulated.
    seconds
        Time of the search [s].
    interrupted
        True if the search was interrupted with Ctrl-C.
    stop_reason
        Reason why the search ended, in words: the report of the method, or the limit reached.
    """

    method: str
    seed: int | None
    uniform: UniformBaseline
    trace: Trace
    evaluations: int
    falls: int
    seconds: float
    interrupted: bool
    stop_reason: str = ""

    @property
    def gain(self) -> float | None:
        """Gain over the uniform baseline, see `Scene.gain`; None if one of the waves stops."""
        return self.scene.gain(self.score, self.uniform.score)

    def __repr__(self) -> str:
        effort = f"{amount(self.evaluations, 'layout')} in {self.seconds:.2g} s"
        search = f"{self.scene.name} by {self.method}, seed {self.seed}"
        return f"SearchResult({search}: {self.score_text}; {effort})"

    def figure(self, ax: Any = None, *, register: bool = False) -> Any:
        """Return the figure of `plot`; `pyplot.show` shows it only if `register` is true."""
        from domino_env.view.figures import draw_with_uniform

        name = f"found by {self.method}"
        return draw_with_uniform(self, name, self._draw_trace, ax, register=register)

    def _draw_trace(self, axes: Any) -> None:
        """Draw the best score over time."""
        times, scores = np.array(self.trace)[:, 2:].T
        criterion = self.scene.criterion
        settings = f"{self.method}, seed {self.seed}, {amount(self.evaluations, 'layout')}"
        lines = {"uniform baseline": self.uniform.score}
        curves = {f"{self.method} {criterion.displayed(scores[-1]):.4f}": scores}
        draw_scores(axes, times, curves, lines, criterion, f"seconds of search ({settings})")

    def summary(self) -> dict[str, Any]:
        """Return the contents of summary.json, in SI units, as a dict."""
        wave, uniform = self.wave, self.uniform
        search = document(self, "method seed score gain evaluations seconds interrupted")
        quantities = "outcome explanation mean_speed error_estimate converged flushes releases"
        simulation = document(wave, f"{quantities} largest_flush_loss")
        return {"scene": self.scene.name} | search | simulation | {
            "ended": self.stop_reason,
            "score_in_words": self.scene.format_score(self.score, wave),
            "length": self.layout.length,
            "total_time": float(wave.arrival_times[-1]) if wave.mean_speed > 0.0 else None,
            "lowest_stall_margin": float(np.nanmin(wave.stall_margin)),
            "uniform_mean_speed": uniform.wave.mean_speed,
            "uniform_outcome": uniform.wave.outcome.name,
            "uniform_score": uniform.score,
            "uniform_spacing": float(uniform.layout.spacing[0]),
            "uniform_thickness": float(uniform.layout.thickness[-1]),
            "simulated_falls": self.falls,
            "versions": versions(),
        }  # fmt: skip


def draw_scores(
    axes: Any,
    times: Floats,
    curves: Mapping[str, Floats],
    lines: Mapping[str, float],
    criterion: Objective,
    clock: str,
) -> None:
    """Draw scores over the course of a search or a training, as steps.

    Parameters
    ----------
    axes
        Matplotlib axes.
    times
        (K,) rising times on any clock.
    curves
        Scores (K,) by label, at most two; first those of the best layout so far.
    lines
        Constant scores for comparison by label, at most two; first that of the uniform baseline.
    criterion
        Objective whose `displayed` numbers of the scores are drawn.
    clock
        Label of the time axis.
    """
    from domino_env.core.colours import BEST_KNOWN, RESULT, SKY, UNIFORM
    from domino_env.core.plot_style import LEGEND, set_time_axis, set_wide_axis

    displayed = criterion.displayed
    for (label, value), colour in zip(lines.items(), (UNIFORM, BEST_KNOWN), strict=False):
        axes.axhline(displayed(value), color=colour, label=f"{label} {displayed(value):.4f}")
    for (label, scores), colour in zip(curves.items(), (RESULT, SKY), strict=False):
        axes.step(times, displayed(scores), color=colour, where="post", label=label)
    ends = displayed(np.array([next(iter(curves.values()))[-1], *lines.values()]))
    low, high = ends.min(), ends.max(initial=ends.min(), where=np.isfinite(ends))
    # show the final scores, with room for the legend, not the bad ones at the beginning
    if criterion.shows_errors:
        if not set_wide_axis(axes, ends):
            room = 0.1 * (high - low) + 0.01 * low
            axes.set_ylim(max(low - room, 0.0), high + 9.0 * room)
    elif low > 0.0:
        axes.set_ylim(low - 0.9 * (high - low) - 0.01 * high, 1.01 * high)
    set_time_axis(axes, times)
    axes.set_xlabel(clock)
    axes.set_ylabel(criterion.quantity())
    axes.legend(loc="best", ncols=len(curves) + len(lines), **LEGEND)
