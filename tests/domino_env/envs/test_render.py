"""Frames of the environments."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from domino_env.view.drawing import FALLS, LEADS


def played(mode: str, steps: int, scene: str = "sprint") -> gymnasium.Env:
    env = gymnasium.make("DominoChain-v0", scene=scene, render_mode=mode)
    env.reset(seed=0)
    for _ in range(steps):
        env.step(np.full(env.action_space.shape, -0.1, dtype=np.float32))
    return env


def pixels(frame: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int((np.abs(frame.astype(int) - colour).sum(axis=-1) < 12).sum())


@pytest.mark.parametrize("scene", ["sprint", "course", "marathon"])
def test_an_image_shows_who_leads_and_who_has_fallen(scene: str) -> None:
    assert pixels(played("rgb_array", 0, scene).render(), LEADS) > 100
    env = played("rgb_array", 12, scene)
    frame = env.render()
    assert frame.dtype == np.uint8
    assert frame.shape == (200, 1200, 3)
    assert pixels(frame, LEADS) > 100
    assert pixels(frame, FALLS) > 5 * pixels(frame, LEADS)
    while not env.step(np.full(env.action_space.shape, -0.1, dtype=np.float32))[2]:
        pass
    assert pixels(env.render(), FALLS) > pixels(frame, FALLS)


def test_text_shows_the_row_to_scale() -> None:
    text = played("ansi", 20).render()
    row, line, _ = text.split("\n")
    assert row.replace(" ", "").count(">") == 1
    assert len(row.replace(" ", "")) == 21
    assert "21 of 21 struck" in line
    assert "against uniform" in line


def test_a_window_shows_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = played("human", 3)
    assert env.render() is None
    env.close()
