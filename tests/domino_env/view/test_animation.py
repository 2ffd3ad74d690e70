"""Animated pictures, and the command that writes them."""

import numpy as np
import pytest
from PIL import Image, ImageSequence

import domino_env as de
from domino_env.view.animation import STRIP_HEIGHT, frames, write_gif
from domino_env.view.compared import ComparedLayout
from domino_env.view.drawing import FALLEN_COLOUR, LEADER_COLOUR, STANDING_COLOUR


def pixels(frame: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int((np.abs(frame.astype(int) - colour).sum(axis=-1) < 12).sum())


def test_a_race_ends_when_all_dominoes_lie(tmp_path):
    compared = [
        ComparedLayout(name, de.simulate(de.Layout.uniform(40, spacing=gap), de.Physics()))
        for name, gap in (("a", 0.010), ("b", 0.018))
    ]
    images = list(frames(compared, rate=10, slow=4, width=600))
    first, last = np.asarray(images[0]), np.asarray(images[-1])
    assert first.shape == (2 * STRIP_HEIGHT, 600, 3)
    assert pixels(first, FALLEN_COLOUR) == 0
    assert pixels(first, STANDING_COLOUR) > 1000
    assert pixels(last, STANDING_COLOUR) < 20
    headed = np.asarray(next(frames(compared, rate=10, slow=4, width=600, heading=40 * "long ")))
    above = len(headed) - len(first)
    assert above > 20
    assert np.array_equal(headed[above:], first)
    seconds = write_gif(iter(images), tmp_path / "race.gif", 10)
    with Image.open(tmp_path / "race.gif") as read:
        durations = [frame.info["duration"] for frame in ImageSequence.Iterator(read)]
        assert len(images) / 2 < len(durations) <= len(images)  # frames that are alike are one
        assert sum(durations) == pytest.approx(1e3 * seconds)
        assert pixels(np.asarray(read.convert("RGB")), LEADER_COLOUR) > 0
    assert [f.name for f in tmp_path.iterdir()] == ["race.gif"]


@pytest.mark.parametrize("count", [30, 120])
def test_a_race_has_one_camera_and_one_finish(count):
    # 120 dominoes do not fit the picture, which follows the first leader in both strips
    gaps = np.linspace(0.006, 0.030, count - 1)
    compared = [
        ComparedLayout(name, de.simulate(de.Layout(spacing, 0.0075), de.Physics()))
        for name, spacing in (("a", gaps), ("b", np.full_like(gaps, gaps.mean())))
    ]
    places = set()
    for image in list(frames(compared, rate=5, slow=1, width=600))[::2]:
        both = np.asarray(image).astype(int).reshape(2, STRIP_HEIGHT, 600, 3)[:, 36:60]
        dark = (both.sum(axis=-1) < 400) & (np.ptp(both, axis=-1) < 40)
        finish = [np.flatnonzero(strip) for strip in dark.sum(axis=1) > 8]
        assert np.array_equal(*finish)
        places.add(tuple(finish[0]))
    assert any(places)
    assert (len(places) == 1) == (count == 30)


def test_placements_mark_the_gap_and_the_piece_of_each_step(script):
    films = script("docs/films.py")
    layout = de.Layout([0.02, 0.01, 0.03], [0.0075, 0.005, 0.010, 0.0075])
    hands = [np.array([0.005, 0.010]), np.array([0.0075, 0.010]), np.array([0.0075])]
    images = [np.asarray(image) for image in films.placements(layout, 0.015, "end", 400, hands)]
    assert len(images) == layout.count
    assert images[0].shape == (STRIP_HEIGHT + films.GAPS_HEIGHT, 400, 3)
    for image, thickness in zip(images[:-1], layout.thickness[1:], strict=True):
        hand, gaps = image[34:90, 200:], image[STRIP_HEIGHT:]
        assert pixels(gaps, LEADER_COLOUR) > 50
        assert pixels(hand, LEADER_COLOUR) > 4e4 * thickness
    assert pixels(images[-1][STRIP_HEIGHT:], LEADER_COLOUR) == 0


@pytest.mark.parametrize(("ending", "begins"), [("gif", b"GIF8"), ("mp4", b"ftyp")])
def test_the_command_writes_the_file(ending, begins, output_of, tmp_path):
    pytest.importorskip("imageio_ffmpeg" if ending == "mp4" else "PIL")
    layout, out = tmp_path / "layout.csv", tmp_path / f"out.{ending}"
    de.Layout.uniform(6, pitch=0.02).to_csv(layout)
    output_of("render", layout, f"--{ending}", out, "--rate", 5, "--width", 400)
    assert begins in out.read_bytes()[:16]
    assert sorted(tmp_path.iterdir()) == sorted([out, layout])
