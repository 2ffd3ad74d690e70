"""Frames of the environments."""

import os
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

from domino_env.envs.rendering import status_line
from domino_env.view.drawing import FALLEN_COLOUR, LEADER_COLOUR


def played(mode: str, steps: int, scene: str = "sprint") -> gymnasium.Env:
    env = gymnasium.make("DominoChain-v2", scene=scene, render_mode=mode)
    env.reset(seed=0)
    for _ in range(steps):
        env.step(np.full(env.action_space.shape, -0.1, dtype=np.float32))
    return env


def pixels(frame: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int((np.abs(frame.astype(int) - colour).sum(axis=-1) < 12).sum())


@pytest.mark.parametrize("scene", ["sprint", "course", "marathon"])
def test_an_image_shows_leader_and_fallen_dominoes(scene):
    assert pixels(played("rgb_array", 0, scene).render(), LEADER_COLOUR) > 100
    env = played("rgb_array", 12, scene)
    frame = env.render()
    assert frame.dtype == np.uint8
    assert frame.shape == (200, 1200, 3)
    assert pixels(frame, LEADER_COLOUR) > 100
    assert pixels(frame, FALLEN_COLOUR) > 5 * pixels(frame, LEADER_COLOUR)
    while not env.step(np.full(env.action_space.shape, -0.1, dtype=np.float32))[2]:
        pass
    assert pixels(env.render(), FALLEN_COLOUR) > pixels(frame, FALLEN_COLOUR)
    line, count = status_line(env.unwrapped.snapshot()), env.unwrapped.scene.count
    assert f"{count} of {count} hit" in line
    assert "against uniform" in line


CHECK = """
import sys
if {hidden}:
    sys.modules["pygame"] = None
import gymnasium, domino_env
from gymnasium.utils.env_checker import check_env
env = gymnasium.make("DominoChain-v2", scene="gentle")
check_env(env.unwrapped)
print(*env.metadata["render_modes"])
"""


@pytest.mark.parametrize(("hidden", "modes"), [
    (True, "rgb_array"), (False, "rgb_array human"),
], ids=["without pygame", "with pygame"])  # fmt: skip
def test_the_checker_renders_every_available_mode(hidden, modes):
    pytest.importorskip("pygame")
    done = subprocess.run(
        [sys.executable, "-W", "error::UserWarning", "-c", CHECK.format(hidden=hidden)],
        env=os.environ | {"SDL_VIDEODRIVER": "dummy"}, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""  # pygame's mixer prints errors without a sound device
    assert done.stdout.splitlines()[-1] == modes
