"""The mapping of actions to gaps, thicknesses and heights, and its derivatives."""

import numpy as np
import pytest
from env_scenes import SCENES, play, size_of

import domino_env as de
from domino_env.envs import CHAIN, ENVIRONMENTS

NAMES = ("sprint", "sprint-thickness", "course", "free course", "magnify")


@pytest.mark.parametrize("name", [*NAMES, "tempo-noise"])
@pytest.mark.parametrize("drift", [-0.4, 0.0, 0.4])
def test_place_all_equals_single_steps(name, drift):
    noisy = SCENES[name]
    uniform = noisy.uniform().layout
    scene = noisy.replace(placement=None)
    if noisy.placement:  # its baseline too is planned for noise
        scene = scene.with_uniform([uniform.spacing[0], uniform.thickness[1]])
    env, together = de.DominoChain(scene), de.DominoChainVector(2, noisy)
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
    equal = uniform.spacing, uniform.thickness[1:], uniform.height[1:]
    for part, wanted, baseline in zip(parts, sizes, equal, strict=True):
        np.testing.assert_array_equal(part[1, :placed], wanted)
        np.testing.assert_allclose(part[0], baseline, rtol=1e-12)


def test_entries_are_logarithmic_about_the_uniform_baseline():
    scene = SCENES["sprint-thickness"]
    env, uniform = de.DominoChainVector(1, scene), scene.uniform().layout
    for entries in ((0.0, 0.0), (1.0, -1.0), (-1.0, 1.0), (0.3, -0.7), (-0.01, 2.0)):
        env.reset()
        env.step([entries])
        layout = env.snapshot(0).layout
        gap = size_of(entries[0], scene.spacing, uniform.spacing[0])
        thickness = size_of(entries[1], scene.thickness, uniform.thickness[1])
        assert layout.spacing[0] == pytest.approx(gap, rel=1e-12)
        assert layout.thickness[1] == pytest.approx(thickness, rel=1e-12)


@pytest.mark.parametrize("name", [*NAMES, "tempo", "uphill", "box"])
def test_actions_towards_a_layout_place_it(name):
    scene, rng = SCENES[name], np.random.default_rng(3)
    env, noise = de.DominoChainVector(1, scene, autoreset_mode="SameStep"), 0.3
    shape = 1, scene.count - 1, *env.single_action_space.shape
    env.reset()
    parts = [part[0] for part in env.place_all(rng.uniform(-noise, noise, shape))]
    layout = scene.layout(*parts[: 2 + (scene.growth is not None)])
    env.reset()
    ended = [False]
    while not ended[0]:
        *_, ended, _, infos = env.step(env.actions_towards(layout))
    built = infos["final_info"]["layout"][0]
    np.testing.assert_allclose(built.spacing, layout.spacing, rtol=1e-9)
    np.testing.assert_allclose(built.thickness, layout.thickness, rtol=1e-9)
    np.testing.assert_allclose(built.height, layout.height, rtol=1e-9)


STRICT = de.load_scene("tempo").settings.replace(first=300.0, last=450.0, tolerance=1e-8)
FIXED = {name: scene for name, scene in SCENES.items() if not (scene.hand or scene.placement)}
FIXED["far from a schedule"] = SCENES["tempo"].replace(settings=STRICT)


@pytest.mark.parametrize("name", FIXED)
def test_actions_of_zero_build_the_uniform_baseline(name):
    scene = FIXED[name]
    uniform = scene.uniform()
    for entry in ENVIRONMENTS.values():
        env = entry.make(scene)
        *_, rewards, info = play(env, lambda _, env=env: np.zeros(env.action_space.shape))
        assert rewards.sum() == pytest.approx(0.0, abs=1e-9)
        assert info["score"] == uniform.score or (entry is CHAIN and uniform.score <= 0.0)
    assert (info["outcome"], info["wave"].reach) == (uniform.wave.outcome, uniform.wave.reach)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_by_actions_match_finite_differences(name):
    scene, rng = SCENES[name], np.random.default_rng(2)
    env = de.DominoChainVector(1, scene)
    shape = (1, scene.count - 1, *env.single_action_space.shape)
    for spread in (0.3, 1.0):
        actions = rng.uniform(-spread, spread, shape)
        derivatives = rng.normal(size=(*shape[:2], 3))

        def total(changed, derivatives=derivatives):
            return (np.stack(env.place_all(changed), axis=-1) * derivatives).sum()

        total(actions)
        exact = env.place_all_vjp(actions, derivatives)
        without_effect = 0
        for place in np.ndindex(shape):
            step = np.zeros(shape)
            step[place] = 1e-7
            difference = (total(actions + step) - total(actions - step)) / 2e-7
            if difference == 0.0:  # at a bound, where the derivative is one-sided
                without_effect += 1
                continue
            assert exact[place] == pytest.approx(difference, rel=1e-5, abs=1e-8)
        assert without_effect < 0.8 * actions.size


def test_an_action_for_a_piece_keeps_the_bounds_of_a_length():
    scene = SCENES["box"]  # environments reject a length beside a stock, the kernel does not
    env = de.DominoChainVector(1, scene)
    pieces = scene.uniform().layout.thickness[1:]
    target = scene.layout([0.003] * 4 + [0.03] * 4, pieces)
    env._batch.rules["length"] = target.length
    env.reset()
    for n in range(3):  # then the wave stops
        env.step(env.actions_towards(target))
        assert env._batch.thickness[0, n + 1] == target.thickness[n + 1]
        assert env._batch.spacing[0, n] == pytest.approx(target.spacing[n], rel=1e-9)
