"""Results of episodes: scores, last rewards, and infos with layouts and waves.

A batch ends tens of thousands of episodes per second, and few of their waves are ever used.
Therefore a wave is simulated when it is first read, unless the score required it before.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env.core.types import Floats
from domino_env.envs.baselines import Baselines
from domino_env.kernels.step.batch import RUNNING, Batch
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave, WaveBatch
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.scene import Scene

LEAST_LOSS = 10.0  # [%] or [dB] by a score of 0; twice as much by one of -1
_OUTCOMES = np.array([*Outcome], object)  # members by value


class EpisodeResults:
    """Results of E episodes that ended together, or were cut: these have no score.

    The whole layout is simulated again in three cases: the score is not the mean speed of the wave;
    the error estimate exceeds the tolerance, as only a new simulation can be more exact; or the
    layout is uniform, for which `simulate` has another algorithm. The score of the uniform baseline
    is known.

    Parameters
    ----------
    baselines
        Scenes of the episodes.
    batch
        Arrays of the environments; those of these episodes are copied.
    envs
        Indices of the environments (E,).

    Attributes
    ----------
    outcome
        Values of `Outcome`, (E,).
    reach
        Fraction of the scene's N dominoes that each wave reached, (E,).
    score
        Scores as in `Scene.score`, (E,).
    gain
        Gains over the uniform baseline, (E,). A score of 0 or less counts as the gain of the lowest
        success, plus the score.
    last_rewards
        Rewards of the last steps, (E,), which make the return 100 `gain`, or less than what was
        expected if the score is 0 or less and that of the baseline is more; see `DominoChain`.
    """

    def __init__(self, baselines: Baselines, batch: Batch, envs: NDArray[np.intp]) -> None:
        episodes, scenes = batch.episodes[envs], batch.scene[envs]
        rules, uniform = batch.rules, baselines.results  # by scene; whole records are read slowly
        self._scenes, self._rtol = baselines.scenes[scenes], float(rules["rtol"][scenes[0]])
        self._are_sampled = len(batch.rules) > 1
        # entries beyond the placed dominoes are not used
        self._placed: list[int] = episodes["placed"].tolist()
        self._spacing, self._thickness = batch.spacing[envs], batch.thickness[envs]
        share_heights = len(batch.height) != len(batch.scene)
        self._height = batch.height if share_heights else batch.height[envs]
        self._waves: dict[int, Wave] = {}
        self.outcome, self.reach = episodes["outcome"], episodes["reach"]
        self.score = episodes["score"]
        is_cut = episodes["phase"] == RUNNING  # the dominoes placed so far have all been hit
        is_uniform = episodes["as_uniform"] & ~is_cut
        hits = episodes["placed"] + 1
        if is_cut.any():
            row_count = rules["count"][scenes] + rules["run_out"][scenes]
            self.reach[is_cut] = (hits / row_count)[is_cut]
        self._simulate(np.flatnonzero(episodes["uncertain"] & ~is_uniform).tolist())
        if is_uniform.any():
            same = scenes[is_uniform]
            self.score[is_uniform] = uniform["score"][same]
            self.outcome[is_uniform] = uniform["outcome"][same]
            self.reach[is_uniform] = uniform["reach"][same]
        baseline, sums = uniform["score"][scenes], episodes["reward_sum"]
        self.gain = self._gain(baseline, rules["score_unit"][scenes])
        # without an expected gain, a failure returns less than every success
        expected = np.where(rules["rewards_steps"][scenes], np.minimum(sums, 0.0), -100.0)
        failure = expected - LEAST_LOSS * (1.0 - self.score)
        has_failed = (self.score <= 0.0) & (baseline > 0.0)
        self.last_rewards = np.where(has_failed, failure, 100.0 * self.gain) - sums

    def _simulate(self, episodes: list[int]) -> None:
        """Simulate the whole layouts of some episodes, and score their waves.

        A wave that stopped before all dominoes were placed keeps its outcome and reach, as its
        layout is incomplete.
        """
        groups: dict[tuple[int, int], list[int]] = {}
        for i in episodes:
            groups.setdefault((id(self._scenes[i]), self._placed[i]), []).append(i)
        for (_, placed), group in groups.items():
            scene = self._scenes[group[0]]
            waves, layouts = self._simulate_group(scene, placed, group)
            if placed == scene.count - 1:
                self.outcome[group], self.reach[group] = waves.outcome, waves.reach
            else:
                ends = {"outcome": self.outcome[group], "reach": self.reach[group]}
                waves = replace(waves, summary=waves.summary._replace(**ends))
            for b, (i, layout) in enumerate(zip(group, layouts, strict=True)):
                self._waves[i] = waves.wave(b, layout)
            self.score[group] = scene.as_placed.evaluate_waves(waves).score

    def _simulate_group(
        self, scene: Scene, placed: int, episodes: list[int]
    ) -> tuple[WaveBatch, list[Layout]]:
        """Return waves and layouts of episodes of one scene and one number of placed dominoes."""
        if len(episodes) == 1 and scene.ground is None:  # takes half the time of a batch of one
            wave = scene.simulate(self.layout(episodes[0]), self._rtol)
            return wave.as_batch(), [wave.layout]
        heights = self._height if len(self._height) == 1 else self._height[episodes]
        sizes = self._thickness[episodes, : placed + 1], heights[:, : placed + 1], scene.width
        batch = LayoutBatch(
            self._spacing[episodes, :placed], *sizes, scene.density, scene.physics, self._rtol,
            scene.ground,
        )  # fmt: skip
        if scene.run_out is not None and placed == scene.count - 1:
            batch = scene.run_out.append_to(batch)
        return batch.simulate(record=True), [batch.layout(b) for b in range(len(batch))]

    def _gain(self, baseline: Floats, unit: Floats) -> Floats:
        """Return `gain`, for scores of the baselines and divisors of positive scores (E,)."""
        gain = self._scenes[0].criterion.gain

        def value(score: Floats) -> Floats:
            return np.asarray(gain(np.maximum(score, 0.0), unit) + np.minimum(score, 0.0))

        return value(self.score) - np.where(baseline > 0.0, 0.0, value(baseline))

    def infos(self) -> dict[str, NDArray[Any]]:
        """Return the last info of each episode, an array (E,) for each key.

        "layout" has the dominoes that were placed, as `Scene.score` takes them; "wave" is the wave
        of `Scene.row` of it, `wave.layout`, which also has the dominoes of a run-out.
        """
        episodes, layout, wave = range(len(self._placed)), self.layout, self.wave
        infos: dict[str, NDArray[Any]] = {
            "score": self.score.copy(),
            "gain": self.gain.copy(),
            "outcome": _OUTCOMES[self.outcome],
            "layout": np.fromiter((Layout.later(layout, i) for i in episodes), object),
            "wave": np.fromiter((Wave.later(wave, i) for i in episodes), object),
        }
        if self._are_sampled:
            infos["scene"] = self._scenes
        return infos

    def layout(self, i: int) -> Layout:
        """Return the layout placed in episode i."""
        sizes = self._spacing[i], self._thickness[i], self._height[i % len(self._height)]
        return placed_layout(self._scenes[i], self._placed[i], *sizes)

    def wave(self, i: int) -> Wave:
        """Return the wave of episode i; its reach is relative to the scene's N dominoes."""
        if i in self._waves:
            return self._waves[i]
        wave: Wave = self._scenes[i].simulate(self.layout(i), self._rtol)
        return replace(wave, summary=wave.summary._replace(reach=float(self.reach[i])))


def placed_layout(
    scene: Scene, placed: int, spacing: Floats, thickness: Floats, height: Floats
) -> Layout:
    """Return the layout of the dominoes that an episode has placed.

    Parameters
    ----------
    scene
        Scene of the episode.
    placed
        n, number of dominoes placed after the first.
    spacing, thickness, height
        Gaps (n,), thicknesses (n + 1,) and heights (n + 1,) of its dominoes [m], or more; entries
        beyond these are not used.
    """
    sizes = spacing[:placed], thickness[: placed + 1], height[: placed + 1]
    parts = *sizes, scene.width, scene.density
    return Layout(*parts) if scene.ground is None else scene.ground.layout(*parts)
