"""Placement noise: random errors of the gaps while a layout is built."""

import numpy as np
import pytest
from env_scenes import play, size_of

from domino_env import DominoChain, Placement, load_scene
from domino_env.scenes.placement import LEAST_GAP

SCENE = load_scene("sprint").replace(count=12, placement=Placement(0.002))


def test_errors_are_those_of_the_scene_and_are_observed():
    equal = SCENE.uniform().layout.spacing[0]
    intended = size_of(-0.2, SCENE.spacing, equal)
    env = DominoChain(SCENE, window=1)
    _, observations, _, info = play(env, lambda _: np.array([-0.2]), seed=3)
    errors = SCENE.placement_errors(np.random.default_rng(3))
    gaps = info["layout"].spacing
    assert gaps == pytest.approx(np.maximum(intended + errors, LEAST_GAP), rel=1e-12)
    assert observations[1:, 3] == pytest.approx(np.log(gaps / equal), abs=1e-6)
