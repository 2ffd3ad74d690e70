"""Evaluation: what a trained or scripted policy builds, in one scene or in many."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from agents.designer.features import FEATURES, features_of
from agents.designer.policy import ConditionedPolicy, shipped_policy
from agents.network import Policy
from agents.policy import DESIGNER, POLICIES, ScenePolicy, folder_of, summary_of
from agents.rollout import Rollout
from agents.scripted import SCRIPTED, ScriptedPolicy
from domino_env import DominoChainVector, Scene, SceneDistribution, load_scene
from domino_env.core.checks import require
from domino_env.core.progress import progress_bar
from domino_env.core.tables import markdown_table, write_csv
from domino_env.core.types import Floats
from domino_env.scenes.distribution import load_distribution
from domino_env.scenes.io.reading import distribution_names
from domino_env.scenes.pool import load_test_set
from optimize.searching import compile_for

if TYPE_CHECKING:
    from optimize.evaluator import Evaluator

ROUNDING = 1e-9  # relative; a layout that is equal to the uniform one does not beat it
NOTHING = 1e-4  # a search that gains less has found nothing to gain
STOPPED = -1.0  # gain of a layout whose wave stops
SEARCHED = Path(__file__).with_name("searched.csv")


def evaluate(run: str | Path, scene: str | Scene | None = None, *, trust: bool = False) -> Rollout:
    """Build a layout with the best policy of a training, deterministically.

    NumPy alone is enough, but for an archive.

    Parameters
    ----------
    run
        The folder that a training wrote; the name of a policy that ships: "designer", which was
        trained on many scenes, or one of `agents.policy.shipped`; "uniform", "greedy" or "ramp",
        which are scripted; or, with `trust`, an archive of stable-baselines3 (.zip).
    scene
        Another scene than it was trained on; its observations must have the same entries. A policy
        that was trained on many scenes or on none needs one.
    trust
        Whether an archive may be loaded, which runs code that it holds.

    Returns
    -------
    Rollout
        The layout, beside the best uniform one.

    Raises
    ------
    ValueError
        Where the scene's observations differ from those of the training, and for what is no run.
    """
    target = scene if scene is None or isinstance(scene, Scene) else load_scene(scene)
    return load_policy(run, trust=trust).build(target)


def load_policy(
    run: str | Path, *, trust: bool = False
) -> ScenePolicy | ConditionedPolicy | ScriptedPolicy:
    """Load a policy, whose method `build` builds a layout for a scene; arguments as of `evaluate`.

    Raises
    ------
    ValueError
        For what holds no policy.
    """
    if str(run) in SCRIPTED:
        return ScriptedPolicy(str(run))
    folder = folder_of(run)
    if folder.suffix == ".zip":
        return ScenePolicy.from_archive(folder, trust)
    if folder == POLICIES / DESIGNER:
        return shipped_policy()
    return ScenePolicy.load(folder)


def agent(run: str) -> Callable[[Evaluator, np.random.Generator], None]:
    """Make the method `agent:RUN` of a search: it builds its layout at once.

    The time of the training counts as spent.

    Parameters
    ----------
    run
        As of `evaluate`.

    Raises
    ------
    ValueError
        For what is no agent.
    """
    try:
        policy = load_policy(run)
    except ValueError as error:
        raise ValueError(f"method 'agent:{run}': {error}") from None
    summary = summary_of(folder_of(run))

    def method(evaluator: Evaluator, rng: np.random.Generator) -> None:
        evaluator.add_seconds(0.0 if summary is None else summary.seconds)
        layout = policy.build(evaluator.problem.scene).layout
        evaluator.evaluate(evaluator.problem.design(layout))

    return method


def gains_of(policy: Policy, distribution: SceneDistribution, scenes: Sequence[Scene]) -> Floats:
    """Build a layout for each scene, all side by side.

    Parameters
    ----------
    policy
        Maps observations to actions.
    distribution
        The distribution that it was trained on.
    scenes
        Scenes of that kind.

    Returns
    -------
    ndarray
        (S,) gains over the uniform baselines; -1 where the wave stops.
    """
    env = DominoChainVector(len(scenes), distribution, autoreset_mode="SameStep")
    observations, _ = env.reset(options={"scene": list(scenes)})
    gains = np.full(len(scenes), np.nan)
    while np.isnan(gains).any():
        observations, _, terminated, _, info = env.step(policy(observations))
        for i in np.flatnonzero(terminated & np.isnan(gains)):
            gain = info["final_info"]["gain"][i]
            gains[i] = STOPPED if gain is None else gain
    return gains


def searched_scores(name: str, number: int) -> Floats | None:
    """Return the scores that `auto` found in the first scenes of a test set, 2500 evaluations each.

    `agents.cards` searches them anew.

    Parameters
    ----------
    name
        Name of the set.
    number
        Number of scenes.

    Returns
    -------
    NDArray or None
        (number,) scores, nan where none was searched; None where there are none at all.
    """
    scores = np.full(number, np.nan)
    with SEARCHED.open(newline="", encoding="utf-8") as lines:
        for row in csv.DictReader(lines):
            if row["set"] == name and int(row["scene"]) < number:
                scores[int(row["scene"])] = float(row["score"])
    return scores if np.isfinite(scores).any() else None


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
    require("scenes", number, 1, whole=True)
    if seed is not None:
        require("seed", seed, 0, whole=True)
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
    budget: int | None = None,
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
    budget
        Number of evaluations of a search in each scene, to compare with; None for no search.
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
    designer = policy or shipped_policy()
    compile_for(scenes[0])
    _score(designer, scenes[0])  # what is loaded once is no part of a design's time
    proposes = isinstance(designer, ConditionedPolicy)
    kinds = ((1, None), (2, 0)) if proposes else ((1, None),)
    table = np.full((6, len(scenes)), np.nan)  # in the order of `ScenesEvaluation`, search last
    for i, scene in enumerate(progress_bar(progress, iterable=scenes, unit=" scenes")):
        for at, steps in kinds:
            began = time.process_time()
            table[at, i] = _score(designer, scene, steps)
            table[at + 2, i] = time.process_time() - began
        if budget is not None:
            table[5, i] = search(scene, budget=budget, seed=seed, progress=False).score
        table[0, i] = scene.uniform().score
    uniform, designed, proposed, seconds, seconds_proposed, fresh = table
    return ScenesEvaluation(
        scenes, uniform, designed, proposed, seconds, seconds_proposed,
        searched if budget is None else fresh,
    )  # fmt: skip


def _score(
    policy: ConditionedPolicy | ScenePolicy, scene: Scene, steps: int | None = None
) -> float:
    if isinstance(policy, ConditionedPolicy):
        return float(policy.design(scene, steps=steps).score)
    return policy.build(scene).score
