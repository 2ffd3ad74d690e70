"""Design space: round trips, projection and derivatives, by their laws and by brute force."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruled_scenes import RULED

import domino_env as de
from domino_env.core.projection import nearest_choice
from domino_env.scenes.objectives import ScoreGradient

SCENES = RULED | {"in-heights": RULED["growth-both"].replace(growth=None)}
every_scene = pytest.mark.parametrize("name", SCENES)


def random_values(scene: de.Scene, number: int, beyond: float = 0.0) -> np.ndarray:
    """Return random values up to `beyond` ranges outside of the bounds."""
    low, high = scene.space.low, scene.space.high
    parts = np.random.default_rng(3).uniform(-beyond, 1.0 + beyond, (number, *low.shape))
    return low + parts * (high - low)


@every_scene
def test_sizes_and_values_are_inverse(name):
    space = SCENES[name].space
    values = random_values(SCENES[name], 5)
    assert space.values(*space.sizes(values)) == pytest.approx(values, rel=1e-14)
    assert values.shape == (5, len(space.free), space.pairs)


@every_scene
def test_projected_values_keep_the_rules_and_stay(name):
    scene, space = SCENES[name], SCENES[name].space
    nearest = space.project(random_values(scene, 40, beyond=1.0))
    assert space.project(nearest) == pytest.approx(nearest, abs=1e-15)
    batch = scene.batch(*space.sizes(nearest))
    for b in range(len(batch)):
        assert scene.violations(batch.layout(b)) == []
    assert len(np.unique(nearest.round(9), axis=0)) > 20
    uniform = scene.uniform().layout
    assert scene.violations(uniform) == []
    values = space.values(uniform.spacing, uniform.thickness[1:], uniform.height[1:])[None]
    assert space.project(values) == pytest.approx(values, abs=1e-12)


@every_scene
def test_derivatives_by_values_match_differences(name):
    """Through sizes and, where the projection is smooth, through the projection."""
    scene, space, step = SCENES[name], SCENES[name].space, 1e-6
    targets = random_values(scene, 3)
    values = space.project(targets)
    pieces = np.broadcast_to(space.is_discrete, space.low.shape)
    weights = np.arange(1.0, space.pairs + 1.0)

    def parts(values: np.ndarray) -> list[np.ndarray]:
        sizes = space.sizes(values)
        return [np.zeros(values[:, 0].shape) if part is None else part for part in sizes]

    def score(targets: np.ndarray) -> np.ndarray:
        return sum(np.square(part) @ weights for part in parts(space.project(targets)))

    by_sizes = ScoreGradient(*(2.0 * part * weights for part in parts(values)))
    derivatives = space.project_vjp(space.sizes_vjp(values, by_sizes), targets, values)
    for k, i in np.ndindex(space.low.shape):
        shift = np.zeros_like(targets)
        shift[:, k, i] = step * (space.high - space.low)[k, i]
        change = (score(targets + shift) - score(targets - shift)) / (2.0 * shift[0, k, i])
        expected = 0.0 if pieces[k, i] else change
        assert derivatives[:, k, i] == pytest.approx(expected, abs=1e-5 * np.abs(change).max())


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_nearest_pieces_are_chosen(seed):
    random = np.random.default_rng(seed)
    pieces = np.repeat([0.01, 0.005, 0.0075], [*random.integers(1, 3, 2), 1])
    n = int(random.integers(1, len(pieces) + 1))
    targets = random.uniform(0.004, 0.011, n)
    nearest = nearest_choice(targets[None], pieces)[0]
    least = min(np.square(np.array(order) - targets).sum() for order in permutations(pieces, n))
    assert np.square(nearest - targets).sum() == pytest.approx(least, abs=1e-16)
