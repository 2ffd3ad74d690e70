"""What the window of the observation leaves out: `domino_env.validation.window`."""

import pytest

from domino_env import load_scene
from domino_env.validation.window import LEADER, shares


def test_each_wider_window_leaves_less_out_and_the_whole_row_nothing():
    scene = load_scene("sprint")
    found = [shares(scene, window) for window in (2, 4, 8)]
    for wider, narrower in zip(found[1:], found, strict=False):
        assert all(a < b for a, b in zip(wider, narrower, strict=True))
    for _, variance, rest in found:
        assert rest < variance < 1.0
    assert shares(scene, LEADER)[:2] == pytest.approx((0.0, 0.0), abs=1e-12)
