"""SearchResult: the best layout of a search, beside the uniform baseline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

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
        The name of the method.
    seed
        Of all randomness.
    layout
        The best layout found.
    wave
        Its wave, at a relative error of 1e-10.
    score
        Its score.
    uniform
        The uniform baseline: the best layout with equal gaps, its wave and score.
    trace
        (evaluations, simulated falls, seconds, best score) at every improvement, and at the end;
        its scores are those of the search, at a relative error of 1e-6.
    slopes
        At each of these the steepest slope left within the box, in score over the whole range of a
        variable; None where the method used no gradient there.
    evaluations
        Number of layouts simulated.
    falls
        Number of single falls simulated.
    seconds
        Time of the search.
    interrupted
        Whether Ctrl-C ended it.
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
    slopes: tuple[float | None, ...]
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
        found = self.scene.against_uniform(self.score, self.wave)
        how = f"{self.evaluations} layouts in {self.seconds:.2g} s"
        return f"SearchResult({self.scene.name} by {self.method}, seed {self.seed}: {found}; {how})"

    def plot(self) -> Any:
        """Draw both layouts, their differences and the search; returns a Matplotlib figure."""
        from domino_env.view.figures import beside_uniform

        return beside_uniform(
            self.scene, self.layout, self.wave, self.score, f"found by {self.method}",
            self._draw_trace,
        )  # fmt: skip

    def _draw_trace(self, axes: Any) -> None:
        """Draw the best score over time, with the score of the uniform baseline as a line."""
        from domino_env.core.colours import OURS, UNIFORM
        from domino_env.core.plot_style import label_line, set_time_axis

        times = np.array([t for _, _, t, _ in self.trace])
        scores = np.array([score for _, _, _, score in self.trace])
        mark, last = self.uniform.score, scores[-1]
        axes.axhline(mark, color=UNIFORM, linewidth=1.5)
        axes.step(times, scores, color=OURS, linewidth=1.5, where="post")
        above = scores[0] < mark  # where the curve is not
        label_line(axes, f"best uniform pitch {mark:.4f}", 0.005, mark, UNIFORM, above=above)
        label_line(axes, f"{self.method} {last:.4f}", 1.0, last, OURS, above=last >= mark)
        lowest = scores[scores > 0.0].min() if last > 0.0 else scores.min()
        if last > 0.0:  # how it began would flatten the rest
            lowest = max(lowest, 0.85 * last)
        low, high = min(lowest, mark if mark > 0.0 else lowest), max(last, mark)
        room = 0.2 * (high - low) + 0.005 * abs(high)
        axes.set_ylim(low - room, high + room)
        set_time_axis(axes, times)
        unit = f" [{self.scene.unit}]" if self.scene.unit else ""
        axes.set_ylabel(f"best score{unit}" if high > 0.0 else "best score (below 0: it dies)")
        axes.set_xlabel(
            f"seconds of search ({self.method}, seed {self.seed}, {self.evaluations} layouts)"
        )

    def summary(self) -> dict[str, Any]:
        """Return the contents of a run's summary.json; SI units."""
        wave, mark = self.wave, self.uniform
        return {
            "scene": self.scene.name,
            "method": self.method,
            "seed": self.seed,
            "outcome": wave.outcome.name,
            "explanation": wave.explanation,
            "score": self.score,
            "score_in_words": self.scene.in_words(self.score, wave),
            "mean_speed": wave.mean_speed,
            "uniform_mean_speed": mark.wave.mean_speed,
            "gain": self.gain,
            "length": self.layout.length,
            "total_time": float(wave.arrival_times[-1]) if wave.mean_speed > 0.0 else None,
            "uniform_outcome": mark.wave.outcome.name,
            "uniform_score": mark.score,
            "uniform_spacing": float(mark.layout.spacing[0]),
            "uniform_thickness": float(mark.layout.thickness[-1]),
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
