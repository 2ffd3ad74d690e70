"""Placement noise: random errors of the gaps while a layout is built."""

import numpy as np
import pytest
from env_scenes import size_of

from domino_env import DominoChain, DominoChainVector, DominoLayoutVector, Placement, load_scene
from domino_env.envs.vector import RTOL
from domino_env.scenes.placement import LEAST_GAP

SCENE = load_scene("sprint").replace(count=12, placement=Placement(0.002))
ACTION = -0.2
INTENDED = SCENE.layout(size_of(ACTION, SCENE.spacing, SCENE.uniform().layout.spacing[0]))


def test_chain_and_layout_environments_get_the_same_errors():
    seeds, pairs = [5, 6, 7], SCENE.count - 1
    errors = [SCENE.placement_errors(np.random.default_rng(seed)) for seed in seeds]
    gaps = np.maximum(INTENDED.spacing + np.array(errors), LEAST_GAP)
    batch = SCENE.evaluate(SCENE.batch(gaps, rtol=RTOL)).score
    assert SCENE.score_placed(INTENDED, seeds) == pytest.approx(batch, rel=10.0 * RTOL)
    envs = DominoChainVector(3, SCENE)
    envs.reset(seed=5)
    together = [envs.step(np.full((3, 1), ACTION)) for _ in range(pairs)][-1][4]
    whole = DominoLayoutVector(3, SCENE)
    whole.reset(seed=5)
    at_once = whole.step(np.full((3, pairs), ACTION))[4]
    assert together["score"].tolist() == at_once["score"].tolist() == batch.tolist()
    assert together["layout"][2] != together["layout"][1]


def test_errors_are_those_of_the_scene_and_are_observed():
    env = DominoChain(SCENE, window=1)
    env.reset(seed=3)
    observed = [env.step(np.array([ACTION]))[0][3] for _ in range(SCENE.count - 1)]
    gaps = env.snapshot().wave.layout.spacing
    errors = SCENE.placement_errors(np.random.default_rng(3))
    assert gaps == pytest.approx(np.maximum(INTENDED.spacing + errors, LEAST_GAP), rel=1e-12)
    ratios = np.log(gaps / SCENE.uniform().layout.spacing)
    assert observed == pytest.approx(ratios, abs=1e-6)
