"""Frames of the environments."""

import os
import subprocess
import sys

import gymnasium
import numpy as np
import pytest

import domino_env as de
from domino_env.envs import ENVIRONMENTS
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


@pytest.mark.parametrize("scene", ["sprint", "course", "relay", "gentle", "varied", "hills"])
def test_the_uniform_baseline_equals_itself_at_every_domino(scene):
    env = gymnasium.make("DominoChain-v2", scene=scene)
    env.reset(seed=0)
    over = False
    while not over:
        _, _, over, _, _ = env.step(np.zeros(env.action_space.shape, np.float32))
        assert "m/s so far (+0.0% against uniform here)" in status_line(env.unwrapped.snapshot())


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_the_last_frame_shows_the_row_with_its_run_out(name):
    scene = de.load_scene("relay").replace(count=8, run_out=de.RunOut(5, 0.016))
    env = gymnasium.make(name, scene=scene, render_mode="rgb_array")
    envs = gymnasium.make_vec(name, num_envs=2, scene=scene, render_mode="rgb_array")
    env.reset(seed=0), envs.reset(seed=0)
    over, count = False, 1
    while not over:
        assert env.unwrapped.snapshot().layout.count == env.unwrapped.snapshot().hit == count
        _, _, over, _, info = env.step(np.zeros(env.action_space.shape, np.float32))
        infos = envs.step(np.zeros(envs.action_space.shape, np.float32))[4]
        count += 1
    assert (info["layout"].count, info["wave"].layout) == (8, scene.row(info["layout"]))
    snapshot, same = env.unwrapped.snapshot(), envs.unwrapped.snapshot(1)
    assert snapshot.layout == snapshot.wave.layout == same.layout == infos["wave"][1].layout
    assert "13 of 13 hit" in status_line(snapshot) == status_line(same)
    assert f"{info['score']:.4f} m/s so far (+0.0% against uniform here)" in status_line(snapshot)
    frame = env.render()
    assert np.array_equal(envs.render()[1], frame)
    shown = np.flatnonzero((np.abs(frame.astype(int) - LEADER_COLOUR).sum(axis=-1) < 12).any(0))
    assert 600 < shown.min() < shown.max() < 1200  # the last domino of the run-out is in the frame


def test_a_window_without_pygame_names_the_extra(monkeypatch):
    monkeypatch.setattr("domino_env.core.checks.find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r'a window needs pygame: pip install -e "\.\[render\]"'):
        gymnasium.make("DominoChain-v2", render_mode="human")


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
