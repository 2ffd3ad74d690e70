"""What an unsteady hand costs: `agents.lab.unsteady`."""

from dataclasses import replace

import numpy as np
import pytest

from agents.lab.unsteady import Builder, ways
from domino_env import load_scene
from domino_env.scenes.unsteady import LEAST_GAP, placed

SCENE = replace(load_scene("sprint"), count=8, placement_deviation=0.003)
BEST = SCENE.uniform().layout.spacing


def test_a_steady_hand_builds_what_was_planned():
    found = ways(replace(SCENE, placement_deviation=1e-12), BEST, rows=2, hands=2)
    assert found.nominal == pytest.approx(SCENE.score(SCENE.layout(BEST)), rel=1e-6)
    assert found.closed_loop == pytest.approx(found.open_loop, rel=2e-3)  # it climbs a little on


def test_gaps_are_placed_by_hand_one_after_the_other_and_kept_from_touching():
    builder, errors = Builder(SCENE), np.array([0.004, -0.004, -1.0, 0.0, 0.0, 0.0, 0.0])
    stands = builder.closed_loop(BEST, errors)
    assert stands[0] == pytest.approx(BEST[0] + 0.004)
    assert stands[2] == LEAST_GAP == placed(BEST, errors)[2]
    assert len(stands) == 7


def test_looking_is_worth_something_but_less_than_knowing_all():
    best = Builder(SCENE).planned(BEST, np.zeros((1, 7)), np.empty(0), 100)
    found = ways(SCENE, best, rows=6, hands=6)
    assert found.nominal.mean() < found.open_loop.mean() < found.hindsight.mean()
    assert found.closed_loop.mean() < found.hindsight.mean()
