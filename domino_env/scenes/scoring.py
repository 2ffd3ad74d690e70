"""Scoring: the stages from layouts to scores.

Layouts, draws of placement noise, run-out, simulator, waves, objective, limits, statistic over the
draws: each stage is a value that a scene has or has not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from domino_env.physics.wave import WaveBatch
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.limits import Limits
from domino_env.scenes.objectives import Objective, Scores
from domino_env.scenes.placement import Placement
from domino_env.scenes.run_out import RunOut
from domino_env.scenes.simulators import FixedPivots, Simulator, Stop


@dataclass(frozen=True)
class Scoring:
    """Stages from layouts to scores, of which only objective and simulator are required.

    Parameters
    ----------
    objective
        Rule that scores waves.
    simulator
        Simulator of the layouts.
    limits
        Limits on the waves; None for none.
    placement
        Placement noise over whose draws a score is a statistic; None to score layouts without
        errors.
    run_out
        Dominoes after those that are designed; None for none.
    """

    objective: Objective
    simulator: Simulator
    limits: Limits | None
    placement: Placement | None
    run_out: RunOut | None

    @property
    def follows_wave(self) -> bool:
        """True if a score follows from the wave of the layout itself with fixed pivots."""
        return self.placement is None and not self.simulator.is_slow

    @property
    def is_mean_speed(self) -> bool:
        """True if a success scores the mean speed of the layout itself with fixed pivots."""
        return self.objective.is_mean_speed and self.follows_wave

    @property
    def cost(self) -> int:
        """Run time of one score over that of a simulation with fixed pivots."""
        return self.simulator.cost * (1 if self.placement is None else self.placement.draws)

    def score(self, waves: WaveBatch) -> Scores:
        """Score waves by objective and limits."""
        scores = self.objective.score(waves)
        if self.limits is None:
            return scores
        return replace(scores, score=self.limits.apply(scores.score, waves))

    def evaluate(self, layouts: LayoutBatch, gradient: bool = False, stop: Stop = None) -> Scores:
        """Simulate layouts and score them; arguments and result are those of `Scene.evaluate`."""
        if self.placement is None:
            return self._evaluate(layouts, gradient, stop)
        return self.placement.evaluate(layouts, partial(self._evaluate, stop=stop), gradient)

    def _evaluate(self, layouts: LayoutBatch, gradient: bool, stop: Stop = None) -> Scores:
        """Evaluate layouts as placed."""
        objective, pairs = self.objective, layouts.count - 1
        by_time = gradient and objective.needs_time_gradient
        if self.run_out is not None:
            layouts = self.run_out.append_to(layouts)
        waves = self.simulator.simulate(
            layouts,
            record=objective.needs_arrivals or (self.limits is not None and not by_time),
            gradient=by_time,
            stop=stop,
        )
        scores = self.score(waves)
        if not gradient:
            return scores
        if not self.simulator.is_slow:
            with np.errstate(all="ignore"):  # of waves that stop, whose numbers are not used
                derivatives = objective.derivatives(waves, layouts)
            if self.run_out is not None:
                derivatives = derivatives.first(pairs)
            return scores.with_gradient(derivatives)
        fixed = replace(self, simulator=FixedPivots(), run_out=None)
        on_pivots = fixed._evaluate(layouts, True, stop)
        both = (scores.score > 0.0) & (on_pivots.score > 0.0)
        ratio = np.where(both, scores.score / np.where(both, on_pivots.score, 1.0), 0.0)
        return scores.with_gradient(on_pivots.gradient.scale(ratio).first(pairs))

    def format_score(self, score: float) -> str:
        """Format the score of a success with its unit, its simulator and its statistic."""
        objective, noise = self.objective, self.placement
        text = objective.format_score(score, self.simulator.digits)
        if noise is not None and noise.quantile is None:  # a mean is that of no wave
            text = objective.label(score)
        text += self.simulator.place
        return text if noise is None else noise.describe(text, objective.unit)
