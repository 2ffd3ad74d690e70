"""Problem: designs, layouts, lengths, scores, gradients."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import domino_env as de
from domino_env.core.projection import nearest_with_sum
from optimize import Problem

FREE = ["spacing", "one-gap", "thickness", "both", "dying"]


def designs_of(problem: Problem, count: int) -> np.ndarray:
    return np.random.default_rng(0).random((count, problem.dimension))


@pytest.mark.parametrize("name", FREE)
def test_corners_of_the_box_are_the_bounds_of_the_scene(scenes, name):
    scene = scenes[name]
    problem = Problem(scene)
    for corner, bound in ((0.0, 0), (1.0, 1)):
        layout = problem.layout(np.full(problem.dimension, corner))
        assert np.all(layout.spacing == scene.spacing[bound])
        assert np.all(layout.thickness[1:] == scene.thickness[bound])
        assert layout.thickness[0] == scene.first_thickness
    assert problem.equality is None


numbers = st.floats(-2.0, 2.0)


@given(
    arrays(np.float64, (3, 6), elements=numbers),
    arrays(np.float64, 6, elements=st.floats(-1.0, 1.0)),
    arrays(np.float64, 6, elements=st.floats(0.01, 1.0)),
    st.floats(0.0, 1.0),
    arrays(np.float64, 6, elements=st.floats(0.0, 1.0)),
)
def test_the_projection_is_the_nearest_point(values, low, room, part, elsewhere):
    """p is nearest to v among the convex set if and only if (v - p)·(y - p) ≤ 0 for all its y."""
    high = low + room
    total = float(low.sum() + part * room.sum())
    nearest = nearest_with_sum(values, low, high, total)
    assert np.all((nearest >= low) & (nearest <= high))
    assert nearest.sum(axis=1) == pytest.approx(np.full(3, total), abs=1e-14)
    # another point of the set: on the line from a random point of the box to a corner
    y = low + elsewhere * room
    corner = high if y.sum() < total else low
    distance = corner.sum() - y.sum()
    y = y + (corner - y) * ((total - y.sum()) / distance if distance else 0.0)
    assert np.all(((values - nearest) * (y - nearest)).sum(axis=1) <= 1e-12)


@pytest.mark.parametrize("name", [*FREE, "length", "length-both", "dead"])
def test_scores_are_those_of_the_scene(scenes, name):
    scene = scenes[name]
    problem = Problem(scene, rtol=1e-10)
    designs = designs_of(problem, 12)
    scores = problem.evaluate(designs).score
    assert scores.tolist() == [scene.score(problem.layout(x)) for x in designs]
    assert problem.evaluate(designs[0]).score == scores[0]


@pytest.mark.parametrize(("name", "designs", "message"), [
    ("evaluate", np.zeros((2, 5)), r"designs has shape \(2, 5\)"),
    ("evaluate", np.full((2, 6), np.nan), r"0 has nan at place 0: give a number in \[0, 1\]$"),
    ("evaluate", np.full((2, 6), 1.1), r"design 0 has 1.1 at place 0: .* through `project`"),
    ("evaluate", np.zeros(5), r"designs has shape \(1, 5\)"),
    ("layout", np.zeros((2, 6)), r"designs has shape \(1, 2, 6\)"),
    ("project", np.full((1, 6), np.inf), "design 0 has inf"),
    ("evaluate", "wide", "design.* = 'wide': give numbers"),
    ("design", de.Layout([0.02], 0.0075), "the layout has 2 dominoes: scene '.*' needs 7"),
])  # fmt: skip
def test_impossible_designs_are_rejected(scenes, name, designs, message):
    with pytest.raises(ValueError, match=message):
        getattr(Problem(scenes["spacing"]), name)(designs)


def test_processes_and_threads_may_share_a_problem(scenes):
    problem = Problem(scenes["length-both"])
    designs = designs_of(problem, 64)
    batch = problem.evaluate(designs, gradient=True)
    copy = pickle.loads(pickle.dumps(problem))
    with ThreadPoolExecutor(8) as pool:
        results = list(pool.map(lambda x: copy.evaluate(x, gradient=True), designs))
    assert [scores.score for scores in results] == batch.score.tolist()
    assert np.array_equal([scores.gradient for scores in results], batch.gradient)
