"""The mapping of actions to gaps, thicknesses and heights, and its derivatives."""

import numpy as np
import pytest
from env_scenes import SCENES

from domino_env import DominoChain, DominoChainVector

NAMES = ("sprint", "sprint-thickness", "course", "free course", "smooth", "magnify")


@pytest.mark.parametrize("name", [*NAMES, "tempo-noise"])
@pytest.mark.parametrize("drift", [-0.4, 0.0, 0.4])
def test_place_all_equals_single_steps(name, drift):
    scene = SCENES[name].replace(placement_deviation=0.0, placement_draws=0)
    env, together = DominoChain(scene), DominoChainVector(2, SCENES[name])
    size = (scene.count - 1, *env.action_space.shape)
    actions = drift + np.random.default_rng(1).normal(0.0, 0.6, size)
    env.reset()
    placed, ended = 0, False
    while not ended:
        *_, ended, _, info = env.step(actions[placed])
        placed += 1
    layout = info["layout"]
    together.reset(seed=0)
    parts = together.place_all(np.stack([0.0 * actions, actions]))
    sizes = layout.spacing, layout.thickness[1:], layout.height[1:]
    for part, wanted in zip(parts, sizes, strict=True):
        np.testing.assert_array_equal(part[1, :placed], wanted)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_by_actions_match_finite_differences(name):
    scene, rng = SCENES[name], np.random.default_rng(2)
    env = DominoChainVector(1, scene)
    shape = (1, scene.count - 1, *env.single_action_space.shape)
    for spread in (0.3, 1.0):
        actions = rng.uniform(-spread, spread, shape)
        derivatives = rng.normal(size=(*shape[:2], 3))

        def total(changed, derivatives=derivatives):
            return (np.stack(env.place_all(changed), axis=-1) * derivatives).sum()

        total(actions)
        exact = env.place_all_vjp(actions, derivatives)
        for place in np.ndindex(shape):
            step = np.zeros(shape)
            step[place] = 1e-7
            difference = (total(actions + step) - total(actions - step)) / 2e-7
            assert exact[place] == pytest.approx(difference, rel=1e-5, abs=1e-8)
