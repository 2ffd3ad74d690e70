"""Frames of the environments, and the animated pictures of `domino render`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from PIL import Image

import domino_env as de
from domino_env.cli.main import main
from domino_env.view.animation import frames, write_gif
from domino_env.view.drawing import FALLS, LEADS, STANDS
from domino_env.view.race import Racer


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
    env = played("rgb_array", 12, scene)
    frame = env.render()
    assert frame.dtype == np.uint8
    assert frame.shape == (200, 1200, 3)
    assert pixels(frame, LEADS) > 100
    assert pixels(frame, FALLS) > 5 * pixels(frame, LEADS)
    env.step(np.full(env.action_space.shape, -0.1, dtype=np.float32))
    assert not np.array_equal(env.render(), frame)
    env.close()


def test_a_frame_after_reset_and_after_the_end() -> None:
    env = played("rgb_array", 0)
    assert pixels(env.render(), LEADS) > 100
    env = played("rgb_array", 39)
    assert pixels(env.render(), FALLS) > 1000
    env.close()


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


def test_nothing_that_draws_is_loaded_unless_asked_for() -> None:
    script = (
        "import sys, gymnasium, domino_env, numpy as np;"
        "env = gymnasium.make('DominoChain-v0', scene='sprint'); env.reset(seed=0);"
        "env.step(np.zeros(1, dtype=np.float32));"
        "print([m for m in ('PIL', 'pygame', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


def test_a_race_ends_when_all_lie(tmp_path: Path) -> None:
    scene = de.load_scene("sprint")
    slow = de.simulate(de.Layout.uniform(40, spacing=0.010), scene.physics)
    fast = de.simulate(scene.uniform().layout, scene.physics)
    images = list(frames([Racer("a", slow), Racer("b", fast)], rate=10, slow=4, width=600))
    first, last = np.asarray(images[0]), np.asarray(images[-1])
    assert first.shape == (300, 600, 3)
    assert pixels(first, FALLS) == 0
    assert pixels(first, STANDS) > 1000
    assert pixels(last, STANDS) < 20
    assert write_gif(iter(images), tmp_path / "race.gif", 10) == len(images)
    with Image.open(tmp_path / "race.gif") as read:
        assert read.n_frames > len(images) / 2  # frames that are alike are one
        assert pixels(np.asarray(read.convert("RGB")), LEADS) > 0
    assert [f.name for f in tmp_path.iterdir()] == ["race.gif"]


def test_a_heading_stands_above_the_rows_and_says_the_pace() -> None:
    wave = de.simulate(de.Layout.uniform(5, pitch=0.02), de.Physics())
    plain, headed, other = (
        np.asarray(next(frames([Racer("a", wave)], slow=slow, width=400, heading=heading)))
        for heading, slow in (("", 4.0), ("sprint: " + 20 * "a long title ", 4.0), ("sprint", 5.0))
    )
    above = len(headed) - len(plain)
    assert above > 20
    assert np.array_equal(headed[above:], plain)
    assert not np.array_equal(headed[:above, 300:], other[:above, 300:])  # 4 and 5 times slower


def test_the_command_writes_what_it_is_asked_for(tmp_path: Path, capsys) -> None:
    row = tmp_path / "row.csv"
    de.Layout.uniform(6, pitch=0.02).to_csv(row)
    words = ["render", str(row), "--scene", "sprint", "--rate", "10", "--slow", "2"]
    assert main([*words, "--gif", str(tmp_path / "out.gif"), "--width", "400"]) == 0
    assert "images" in capsys.readouterr().out
    assert (tmp_path / "out.gif").read_bytes()[:4] == b"GIF8"
    for wrong, message in (
        ([], "give --gif FILE, --mp4 FILE or --png FILE"),
        (["--png", "out.gif"], "a file for --png ends in .png"),
        (["--png", "out.png", "--moments", "0"], "moments = 0: give a whole number"),
        (["--gif", "out.png"], "a file for --gif ends in .gif"),
        (["--gif", "out.gif", "--slow", "0"], "slow = 0.0: give a finite number, more than 0"),
        (["--gif", "out.gif", "--width", "401"], "give an even number"),
    ):
        assert main(["render", str(row), *wrong]) != 0
        assert message in capsys.readouterr().err


def test_a_film(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    row = tmp_path / "row.csv"
    de.Layout.uniform(5, pitch=0.02).to_csv(row)
    film = tmp_path / "out.mp4"
    assert main(["render", str(row), "--mp4", str(film), "--rate", "10", "--width", "400"]) == 0
    assert b"ftyp" in film.read_bytes()[:16]
    assert sorted(f.name for f in tmp_path.iterdir()) == ["out.mp4", "row.csv"]
