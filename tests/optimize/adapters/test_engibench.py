"""Scenes as problems of EngiBench satisfy the tests of EngiBench's own problems."""

import typing
from dataclasses import asdict

import msgspec
import numpy as np
import pytest

pytest.importorskip("engibench", reason="needs engibench: pip install 'domino-chains[engibench]'")

from engibench.core import ObjectiveDirection, Problem
from gymnasium import spaces

import domino_env as de
from optimize.adapters.engibench import DominoProblem


def test_the_class_has_the_interface_of_engibench():
    """Repeat EngiBench's test of problems, except for the data set."""
    (base,) = DominoProblem.__orig_bases__
    assert typing.get_origin(base) is Problem
    assert len(typing.get_args(base)) == len(Problem.__parameters__)
    methods = {"simulate", "render", "random_design", "reset", "optimize"}
    assert methods <= set(vars(DominoProblem))
    problem = DominoProblem()
    assert isinstance(problem.design_space, spaces.Box)
    assert problem.objectives == (("mean_speed", ObjectiveDirection.MAXIMIZE),)
    assert problem.conditions_keys == ["friction", "gravity", "push"]
    assert asdict(problem.conditions) == msgspec.structs.asdict(problem.scene.physics)
    assert problem.dataset_id
    with pytest.raises(ValueError, match="no data set is published"):
        _ = problem.dataset


@pytest.mark.parametrize("name", ["spacing", "both", "length-both", "dying"])
def test_designs_are_simulated_and_optimised(scenes, name):
    scene = scenes[name]
    problem = DominoProblem(config={"budget": 60}, scene=scene)
    problem.reset(seed=1)
    design, _ = problem.random_design()
    problem.reset(seed=1)
    assert np.array_equal(problem.random_design()[0], design)
    assert not problem.check_constraints(design, {})
    score = problem.simulate(design)
    assert score.tolist() == [scene.score(problem.layout(design))]
    best, history = problem.optimize(starting_point=design)
    assert problem.design_space.contains(best)
    assert not problem.check_constraints(best, {})
    best_score = problem.simulate(best)
    assert best_score >= score
    assert history[-1].step == 60
    assert all(len(step.obj_values) == 1 for step in history)
    assert history[-1].obj_values == pytest.approx(best_score, abs=1e-5)
    assert problem.render(best).size == (1000, 200)


def test_conditions_are_taken_from_the_configuration(scenes):
    problem = DominoProblem(config={"friction": 0.1}, scene=scenes["spacing"])
    design, _ = problem.random_design()
    layout = problem.layout(design)
    for config, friction in (({}, 0.1), ({"friction": 0.2}, 0.2)):
        speed = de.simulate(layout, de.Physics(friction=friction)).mean_speed
        assert speed > 0.0
        assert problem.simulate(design, config) == pytest.approx(speed, rel=1e-7)


def test_a_broken_rule_is_a_violation(scenes):
    problem = DominoProblem(scene=scenes["length"])
    space = problem.design_space
    long, outside = space.high, space.high + 0.001
    assert "m long: the scene has 0.18 m" in str(problem.check_constraints(long, {}))
    assert "design ∉ design_space" in str(problem.check_constraints(outside, {}))
    assert "friction: -1.0" in str(problem.check_constraints(long, {"friction": -1.0}))
    assert np.isfinite(problem.simulate(long)).all()
    with pytest.raises(ValueError, match=r"design has shape \(3,\): give \(8,\)"):
        problem.simulate(np.zeros(3))
