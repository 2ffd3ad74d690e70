"""Evaluation in many scenes: a scene-conditioned policy in scenes of no training."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.conditioned.distribution import FEATURES, SceneDistribution, features_of
from agents.conditioned.examples import Examples
from agents.conditioned.observations import PLANS
from agents.conditioned.policy import ConditionedPolicy, shipped_policy
from agents.conditioned.preset import EXAMPLES_SEED
from domino_env.support.progress import progress_bar
from domino_env.support.tables import markdown_table, write_csv
from optimize.searching.compiling import compile_for

Floats = NDArray[np.float64]

ROUNDING = 1e-9  # relative; a row that is equal to the uniform one does not beat it
NOTHING = 1e-4  # a search that gains less has found nothing to gain


@dataclass(frozen=True, eq=False)
class ScenesEvaluation:
    """Evaluation of designs in S scenes.

    Attributes
    ----------
    scenes
        (S, 6) features.
    uniform
        (S,) score of the best uniform row.
    tried, untried
        (S,) score of the design, with its plans simulated and without.
    seconds, seconds_untried
        (S,) time that each design took.
    searched
        (S,) score of what search found; None where it was not asked.
    """

    scenes: Floats
    uniform: Floats
    tried: Floats
    untried: Floats
    seconds: Floats
    seconds_untried: Floats
    searched: Floats | None = None

    def table(self) -> str:
        """Make a table in Markdown, a line for each way to design."""
        names = (
            "row", "beats the best uniform one", "gain: median", "tenth percentile", "worst",
            "part of the search's gain: median", "time: median", "longest",
        )  # fmt: skip
        rows = [
            self._row("best of the plans", self.tried, self.seconds),
            self._row("plan untried", self.untried, self.seconds_untried),
        ]
        if self.searched is not None:
            rows.append(self._row("search", self.searched, None))
        return "\n".join(markdown_table(names, rows))

    def _row(self, name: str, scores: Floats, seconds: Floats | None) -> tuple[str, ...]:
        gain = self.gains(scores)
        died = int(np.sum(scores <= 0.0))
        worst = f"{died} died" if died else f"{gain.min():+.2%}"
        times = ("", "") if seconds is None else (
            f"{1e3 * np.median(seconds):.1f} ms", f"{1e3 * seconds.max():.1f} ms"
        )  # fmt: skip
        share = "" if self.searched is None else f"{self.share(scores):.1%}"
        return (
            name, f"{self.beaten(scores):.1%} of {len(gain)}", f"{np.median(gain):+.2%}",
            f"{np.quantile(gain, 0.1):+.2%}", worst, share, *times,
        )  # fmt: skip

    def gains(self, scores: Floats) -> Floats:
        """Compute gains over the best uniform rows; below -1 where a wave died."""
        return scores / self.uniform - 1.0

    def beaten(self, scores: Floats) -> float:
        """Compute the part of the scenes in which the best uniform row is beaten."""
        return float(np.mean(scores > self.uniform * (1.0 + ROUNDING)))

    def share(self, scores: Floats) -> float:
        """Compute the median part of what search gains over uniform, where it gains anything."""
        assert self.searched is not None
        found = self.gains(self.searched)
        some = found > NOTHING
        return float(np.median(self.gains(scores)[some] / found[some]))

    def save(self, path: Path) -> None:
        """Write a line for each scene, CSV."""
        columns = [
            *self.scenes.T, self.uniform, self.tried, self.untried, self.seconds,
            self.seconds_untried,
        ]  # fmt: skip
        names = [name.replace(" ", "_") for name in FEATURES]
        names += ["uniform", "tried", "untried", "seconds", "seconds_untried"]
        if self.searched is not None:
            columns, names = [*columns, self.searched], [*names, "searched"]
        write_csv(path, names, ([f"{x:.10g}" for x in row] for row in np.array(columns).T))


def evaluate_scenes(
    number: int = 200,
    seed: int = 1,
    policy: ConditionedPolicy | None = None,
    *,
    distribution: SceneDistribution | None = None,
    evaluations: int | None = None,
    examples: Examples | None = None,
    progress: bool | None = False,
) -> ScenesEvaluation:
    """Design rows for scenes that are drawn with a seed, and compare.

    Parameters
    ----------
    number
        Of scenes.
    seed
        That draws them.
    policy
        What designs; None for the one that ships.
    distribution
        What they are drawn from; None for that of the one that ships.
    evaluations
        Budget of a search in each scene, to compare with; None for no search.
    examples
        Of these very scenes, instead of searching.
    progress
        Whether to show a progress bar; None: on a terminal, elsewhere a line now and then.

    Raises
    ------
    ValueError
        For no scenes, the seed of the examples, and examples of other scenes.
    """
    from optimize import search

    if number < 1 or seed < 0:
        raise ValueError(f"{number} scenes, seed {seed}: give 1 or more, and 0 or more")
    if seed == EXAMPLES_SEED:
        raise ValueError(f"seed {seed} drew the examples of the training: choose another")
    rng = np.random.default_rng(seed)
    chosen = distribution or SceneDistribution()
    scenes = [chosen.sample(rng) for _ in range(number)]
    features = np.array([features_of(scene) for scene in scenes])
    if examples is not None and not np.array_equal(examples.scenes, features):
        raise ValueError("the examples are of other scenes")
    designing = policy or shipped_policy()
    compile_for(scenes[0])
    found = np.full((6, number), np.nan)  # in the order of `ScenesEvaluation`, search last
    for i, scene in enumerate(progress_bar(progress, iterable=scenes, unit=" scenes")):
        best, plain = (designing.design(scene, n) for n in (PLANS, 1))
        found[1:5, i] = best.score, plain.score, best.seconds, plain.seconds
        if examples is not None:
            found[[0, 5], i] = examples.uniform[i], examples.score[i]
        elif evaluations is not None:
            result = search(scene, budget=evaluations, seed=seed, progress=False)
            found[[0, 5], i] = result.uniform.score, result.score
        else:
            found[0, i] = scene.uniform().score
    compared = evaluations is not None or examples is not None
    uniform, tried, untried, seconds, seconds_untried, searched = found
    return ScenesEvaluation(
        features, uniform, tried, untried, seconds, seconds_untried, searched if compared else None
    )
