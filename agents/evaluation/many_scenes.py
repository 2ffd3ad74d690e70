"""Evaluation in many scenes: a policy that was trained on many, in scenes of no training."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.conditioned.features import FEATURES, features_of
from agents.conditioned.policy import ConditionedPolicy, shipped_policy
from agents.single.policy import ScenePolicy
from domino_env import Scene, SceneDistribution
from domino_env.core.progress import progress_bar
from domino_env.core.tables import markdown_table, write_csv
from domino_env.scenes.distribution import load_distribution
from domino_env.scenes.io.reading import distribution_names
from domino_env.scenes.pool import load_test_set
from optimize.compiling import compile_for

Floats = NDArray[np.float64]

ROUNDING = 1e-9  # relative; a row that is equal to the uniform one does not beat it
NOTHING = 1e-4  # a search that gains less has found nothing to gain


@dataclass(frozen=True, eq=False)
class ScenesEvaluation:
    """Evaluation of designs in S scenes.

    Attributes
    ----------
    scenes
        The scenes.
    uniform
        (S,) score of the best uniform row.
    designed, proposed
        (S,) score of the design, and of what the networks proposed for it; nan where they propose
        nothing, for the policy builds in the environment.
    seconds, seconds_proposed
        (S,) processor time that each took.
    searched
        (S,) score of what search found, nan where none was done; None where none was at all.
    """

    scenes: Sequence[Scene]
    uniform: Floats
    designed: Floats
    proposed: Floats
    seconds: Floats
    seconds_proposed: Floats
    searched: Floats | None = None

    def table(self) -> str:
        """Make a table in Markdown, a line for each way to design."""
        names = (
            "row", "beats the best uniform one", "gain: median", "tenth percentile", "worst",
            "part of the search's gain: median", "tenth percentile", "time: median", "longest",
        )  # fmt: skip
        rows = [self._row("design", self.designed, self.seconds)]
        if np.isfinite(self.proposed).any():
            rows.append(self._row("its proposal", self.proposed, self.seconds_proposed))
        if self.searched is not None:
            rows.append(self._row("search", self.searched, None))
        return "\n".join(markdown_table(names, rows))

    def _row(self, name: str, scores: Floats, seconds: Floats | None) -> tuple[str, ...]:
        gain = self.gains(scores)
        gain = gain[np.isfinite(gain)]
        died = int(np.sum(scores <= 0.0))
        worst = f"{died} died" if died else f"{gain.min():+.2%}"
        times = ("", "") if seconds is None else (
            f"{1e3 * np.median(seconds):.1f} ms", f"{1e3 * seconds.max():.1f} ms"
        )  # fmt: skip
        shares = ("", "") if self.searched is None else (
            f"{self.share(scores):.1%}", f"{self.share(scores, 0.1):.1%}"
        )  # fmt: skip
        return (
            name, f"{np.mean(gain > ROUNDING):.1%} of {len(gain)}", f"{np.median(gain):+.2%}",
            f"{np.quantile(gain, 0.1):+.2%}", worst, *shares, *times,
        )  # fmt: skip

    def gains(self, scores: Floats) -> Floats:
        """Compute gains over the best uniform rows; below -1 where a wave died."""
        return scores / self.uniform - 1.0

    def share(self, scores: Floats, quantile: float = 0.5) -> float:
        """Compute a quantile of the part of search's gain, where search gains anything."""
        assert self.searched is not None
        found = self.gains(self.searched)
        some = found > NOTHING  # and so no nan
        return float(np.quantile(self.gains(scores)[some] / found[some], quantile))

    def missed(self, scores: Floats) -> int:
        """Count the scenes in which search beats the best uniform row and these rows do not."""
        assert self.searched is not None
        bar = self.uniform * (1.0 + ROUNDING)
        return int(np.sum((self.searched > bar) & ~(scores > bar)))

    def save(self, path: Path) -> None:
        """Write a line for each scene, CSV."""
        columns = [
            *np.array([features_of(scene) for scene in self.scenes]).T, self.uniform,
            self.designed, self.proposed, self.seconds, self.seconds_proposed,
        ]  # fmt: skip
        names = [name.replace(" ", "_") for name in FEATURES]
        names += ["uniform", "designed", "proposed", "seconds", "seconds_proposed"]
        if self.searched is not None:
            columns, names = [*columns, self.searched], [*names, "searched"]
        write_csv(path, names, ([f"{x:.10g}" for x in row] for row in np.array(columns).T))


def scenes_of(
    name: str | Path | SceneDistribution, number: int, seed: int | None = None
) -> list[Scene]:
    """Give scenes to evaluate in: of a test set that ships, or drawn with a seed.

    Parameters
    ----------
    name
        Of a distribution that ships, or the path of one's file, or a distribution itself.
    number
        How many; of a test set at most 200, its first.
    seed
        That draws them; None for the test set.

    Raises
    ------
    ValueError
        For numbers that make no sense, and as of `load_distribution` and `load_test_set`.
    """
    if number < 1 or (seed is not None and seed < 0):
        raise ValueError(f"{number} scenes, seed {seed}: give 1 or more, and 0 or more")
    if seed is not None:
        distribution = name if isinstance(name, SceneDistribution) else load_distribution(name)
        rng = np.random.default_rng(seed)
        return [distribution.sample(rng) for _ in range(number)]
    if isinstance(name, SceneDistribution):
        if name.name not in distribution_names() or load_distribution(name.name) != name:
            raise ValueError(f"no test scenes ship for '{name.name}': give a seed (--seed)")
        name = name.name
    known = load_test_set(str(name))
    if number > len(known):
        raise ValueError(f"the test set of {name} has {len(known)} scenes: give a seed for more")
    return known[:number]


def evaluate_scenes(
    scenes: Sequence[Scene],
    policy: ConditionedPolicy | ScenePolicy | None = None,
    *,
    evaluations: int | None = None,
    seed: int = 0,
    searched: Floats | None = None,
    progress: bool | None = False,
) -> ScenesEvaluation:
    """Design rows for scenes, and compare.

    Parameters
    ----------
    scenes
        One or more.
    policy
        What designs: a designer, or what was trained on drawn scenes; None for the designer that
        ships.
    evaluations
        Budget of a search in each scene, to compare with; None for no search.
    seed
        Of the searches.
    searched
        (S,) scores of searches that were done before.
    progress
        Whether to show a progress bar; None: on a terminal, elsewhere a line now and then.

    Raises
    ------
    ValueError
        For no scenes.
    """
    from optimize import search

    if not scenes:
        raise ValueError("no scenes to evaluate in: give 1 or more")
    designing = policy or shipped_policy()
    compile_for(scenes[0])
    _designed(designing, scenes[0])  # what is loaded once is no part of a design's time
    proposes = isinstance(designing, ConditionedPolicy)
    ways = ((1, None), (2, 0)) if proposes else ((1, None),)
    found = np.full((6, len(scenes)), np.nan)  # in the order of `ScenesEvaluation`, search last
    for i, scene in enumerate(progress_bar(progress, iterable=scenes, unit=" scenes")):
        for at, steps in ways:
            began = time.process_time()
            found[at, i] = _designed(designing, scene, steps)
            found[at + 2, i] = time.process_time() - began
        if evaluations is not None:
            found[5, i] = search(scene, budget=evaluations, seed=seed, progress=False).score
        found[0, i] = scene.uniform().score
    uniform, designed, proposed, seconds, seconds_proposed, fresh = found
    return ScenesEvaluation(
        scenes, uniform, designed, proposed, seconds, seconds_proposed,
        searched if evaluations is None else fresh,
    )  # fmt: skip


def _designed(
    policy: ConditionedPolicy | ScenePolicy, scene: Scene, steps: int | None = None
) -> float:
    """Score of what a policy makes of a scene."""
    if isinstance(policy, ConditionedPolicy):
        return float(policy.design(scene, steps=steps).score)
    return policy.build(scene).score
