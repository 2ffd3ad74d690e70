"""SearchResult: the best layout of a search, beside the uniform baseline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from domino_env.core.files import counted
from domino_env.core.results import versions
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import UniformBaseline, gain
from domino_env.view.notebook import MadeForScene

Trace = tuple[tuple[int, int, float, float], ...]


@dataclass(frozen=True, eq=False)
class SearchResult(MadeForScene):
    """The best layout of a search, simulated closely, beside the uniform baseline.

    Attributes
    ----------
    scene
        The scene.
    method
        Name of the method.
    seed
        Seed of all randomness.
    layout
        The best layout found.
    wave
        Wave of the layout, at a relative error of 1e-10.
    score
        Score of the layout.
    uniform
        The uniform baseline: the best layout with equal gaps, its wave and score.
    trace
        (evaluations, simulated falls, seconds, best score) at every improvement, and at the end;
        its scores are those of the search, at a relative error of 1e-6.
    evaluations
        Number of layouts simulated.
    falls
        Number of single falls simulated.
    seconds
        Time of the search.
    interrupted
        Ctrl-C ended it.
    ended
        Reason of its end in words: what the method reported, or the limit that was reached.
    """

    scene: Scene
    method: str
    seed: int
    layout: Layout
    wave: Wave
    score: float
    uniform: UniformBaseline
    trace: Trace
    evaluations: int
    falls: int
    seconds: float
    interrupted: bool
    ended: str = ""

    @property
    def gain(self) -> float | None:
        """Score over that of the uniform baseline, minus 1; None where one of the waves stops."""
        return gain(self.score, self.uniform.score)

    def __repr__(self) -> str:
        score = self.scene.against_uniform(self.score, self.wave)
        effort = f"{counted(self.evaluations, 'layout')} in {self.seconds:.2g} s"
        search = f"{self.scene.name} by {self.method}, seed {self.seed}"
        return f"SearchResult({search}: {score}; {effort})"

    def plot(self, ax: Any = None) -> Any:
        """Draw both layouts, their differences and the search.

        Parameters
        ----------
        ax
            Matplotlib axes that get the gaps of both layouts and nothing else; None for a new
            figure.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, which notebooks show, and `pyplot.show` where pyplot is imported.
        """
        return self.figure(ax, register=True)

    def figure(self, ax: Any = None, *, register: bool = False) -> Any:
        """Return the figure of `plot`, which pyplot does not show unless it is registered."""
        from domino_env.view.figures import beside_uniform

        sizes = self.scene, self.layout, self.wave, self.score
        name = f"found by {self.method}"
        return beside_uniform(*sizes, name, self._draw_trace, ax, register=register)

    def _draw_trace(self, axes: Any) -> None:
        """Draw the best score over time, with the score of the uniform baseline as a line."""
        from domino_env.core.colours import OURS, UNIFORM
        from domino_env.core.plot_style import label_line, set_time_axis

        times, scores = np.array(self.trace)[:, 2:].T
        uniform, last = self.uniform.score, float(scores[-1])
        axes.axhline(uniform, color=UNIFORM, linewidth=1.5)
        axes.step(times, scores, color=OURS, linewidth=1.5, where="post")
        above = bool(scores[0] < uniform)  # where the curve is not
        label_line(axes, f"uniform baseline {uniform:.4f}", 0.005, uniform, UNIFORM, above=above)
        label_line(axes, f"{self.method} {last:.4f}", 1.0, last, OURS, above=last >= uniform)
        if min(last, uniform) > 0.0:  # the scores at the beginning would flatten the rest
            low, high = min(uniform, max(scores.min(), 0.85 * last)), max(last, uniform)
            room = 0.2 * (high - low) + 0.005 * high
            axes.set_ylim(low - room, high + room)
        set_time_axis(axes, times)
        unit = f" [{self.scene.unit}]" if self.scene.unit else ""
        axes.set_ylabel(f"best score{unit}")
        scale = ", logarithmic" if axes.get_xscale() == "log" else ""
        run = f"{self.method}, seed {self.seed}, {self.evaluations} layouts"
        axes.set_xlabel(f"seconds of search{scale} ({run})")

    def summary(self) -> dict[str, Any]:
        """Return the contents of a run's summary.json; SI units."""
        wave, uniform = self.wave, self.uniform
        return {
            "scene": self.scene.name,
            "method": self.method,
            "seed": self.seed,
            "outcome": wave.outcome.name,
            "explanation": wave.explanation,
            "score": self.score,
            "score_in_words": self.scene.in_words(self.score, wave),
            "mean_speed": wave.mean_speed,
            "uniform_mean_speed": uniform.wave.mean_speed,
            "gain": self.gain,
            "length": self.layout.length,
            "total_time": float(wave.arrival_times[-1]) if wave.mean_speed > 0.0 else None,
            "uniform_outcome": uniform.wave.outcome.name,
            "uniform_score": uniform.score,
            "uniform_spacing": float(uniform.layout.spacing[0]),
            "uniform_thickness": float(uniform.layout.thickness[-1]),
            "evaluations": self.evaluations,
            "simulated_falls": self.falls,
            "seconds": self.seconds,
            "interrupted": self.interrupted,
            "ended": self.ended,
            "error_estimate": wave.error_estimate,
            "converged": wave.converged,
            "lowest_stall_margin": float(min(m for m in wave.stall_margin if m == m)),
            "flushes": wave.flushes,
            "releases": wave.releases,
            "largest_flush_loss": wave.largest_flush_loss,
            "versions": versions(),
        }
