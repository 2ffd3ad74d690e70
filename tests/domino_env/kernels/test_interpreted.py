"""Kernels run by Python before they are compiled: the same bits, and what ends it."""

import copy
from itertools import islice
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from env_scenes import SCENES
from uneven_layouts import UNEVEN_SCENE, uneven_layout

import domino_env as de
from domino_env.envs import baselines, vector
from domino_env.kernels.jit import interpreted
from domino_env.kernels.step import environment
from domino_env.physics import ground, steady, wave
from domino_env.validation.edge_cases import edge_cases

STEPS = SimpleNamespace(**vars(environment))
ENTRY_POINTS = [
    (wave, "solve_batch"), (wave, "vjp"), (wave, "vjp_batch"), (steady, "compose_falls"),
    (steady, "period_falls"), (ground, "place_on_ground"), (ground, "place_on_ground_vjp"),
    (STEPS, "step_batch"), (STEPS, "encode_batch"), (STEPS, "place_batch"), (STEPS, "place_vjp"),
]  # fmt: skip


def parts_of(value):
    if isinstance(value, tuple):
        return [part for each in value for part in parts_of(each)]
    if not isinstance(value, np.ndarray):
        return [value]
    return [value[field].tobytes() for field in value.dtype.names or (...,)]  # without gaps


@pytest.fixture
def compare_all(monkeypatch):
    """A function from which on entry points are run by Python too, and compared bit by bit.

    It returns the set of their names, which grows.
    """
    names, threads = set(), numba.get_num_threads()

    def compare(name, compiled):
        def call(*arguments):
            copies = copy.deepcopy(arguments)
            try:
                result = interpreted.interpret(compiled, copies)
            except (ArithmeticError, ValueError) as error:  # machine code computes inf or nan
                assert parts_of(copies) == parts_of(arguments)
                names.add(type(error).__name__)
                return compiled(*arguments)
            expected = compiled(*arguments)
            np.testing.assert_equal(result, expected)
            assert parts_of(copies) == parts_of(arguments)
            names.add(name)
            return expected

        return call

    def compare_from_now():
        # elements of arrays that nothing writes are compared too
        numpy = SimpleNamespace(**vars(np) | {"empty": np.zeros})
        monkeypatch.setattr(wave, "np", numpy)
        numba.set_num_threads(1)  # others would write into the arrays meanwhile
        for module in (baselines, vector):
            monkeypatch.setattr(module, "kernels", STEPS)
        for module, name in ENTRY_POINTS:
            monkeypatch.setattr(module, name, compare(name, getattr(module, name)))
        return names

    yield compare_from_now
    numba.set_num_threads(threads)


def test_edge_cases(compare_all):
    compared = compare_all()
    for case in islice(edge_cases(longest=50), 0, None, 3):
        if case.layout.count <= 50:
            de.simulate(case.layout, case.physics)
    assert compared == {"solve_batch"}  # and no errors


@pytest.mark.parametrize(("rtol", "friction"), [(1e-4, 0.25), (1e-12, 0.0)])
def test_layouts(compare_all, friction, rtol):
    compared = compare_all()
    physics = de.Physics(friction, push=14.0)
    rng = np.random.default_rng(0)
    random = de.Layout(rng.uniform(0.002, 0.04, 19), rng.uniform(0.005, 0.012, 20))
    for layout in (random, de.Layout.uniform(25, pitch=0.02), uneven_layout(2, 15, True)):
        de.simulate(layout, physics, rtol=rtol, gradient=True).gradient()
    de.simulate_batch(rng.uniform(0.002, 0.04, (3, 9)), 0.0075, physics, rtol=rtol, tilt=0.02)
    de.smallest_push(random, physics, rtol=rtol)
    de.steady_wave(0.02, 0.0075, physics=physics)
    scene = UNEVEN_SCENE.replace(physics=physics)
    gaps, thickness = rng.uniform(*scene.spacing, (3, 8)), rng.uniform(*scene.thickness, (3, 8))
    scene.evaluate(scene.batch(gaps, thickness, rtol=rtol), gradient=True)
    names = {name for module, name in ENTRY_POINTS if module in (wave, steady, ground)}
    assert compared == names


# others have the same code paths as one of the rest
LIKE_OTHERS = (
    "course-released", "downhill", "ideal", "marathon", "tempo", "limits", "few draws",
    "tight course", "stretched course",
)  # fmt: skip


@pytest.mark.parametrize("name", sorted(SCENES.keys() - LIKE_OTHERS))
def test_an_episode(compare_all, name):
    scene = SCENES[name]
    env = de.DominoChainVector(2, scene)
    compared = compare_all()
    env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(5):
        env.step(env.action_space.sample())
    shape = 2, scene.count - 1
    env.actions_towards(scene.uniform().layout)
    actions = np.linspace(-0.9, 0.9, 2 * shape[1]).reshape(*shape, 1)
    actions = np.repeat(actions, env.single_action_space.shape[0], axis=2)
    env.place_all(actions)
    env.place_all_vjp(actions, np.ones((*shape, 3)))
    assert compared >= {name for module, name in ENTRY_POINTS if module is STEPS}
