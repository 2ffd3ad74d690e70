"""The scene of a builder's own dominoes, and simulation with placement noise."""

import json
import re

import numpy as np
import pytest

import domino_env as de
from domino_env.cli.main import main


def scene_of(capsys, tmp_path, words: str) -> de.Scene:
    assert main(["scene", *words.split()]) == 0
    file = tmp_path / "mine.toml"
    file.write_text(capsys.readouterr().out, "utf-8")
    return de.load_scene(file)


def test_options_in_millimetres_and_degrees_define_a_scene(capsys, tmp_path):
    words = "--count 120 --thickness 8 --height 43 --width 22 --length 2500 --slope 1"
    scene = scene_of(capsys, tmp_path, words)
    assert scene == de.Scene(
        name="mine", title="120 dominoes of 8 x 22 x 43 mm", count=120, height=0.043, width=0.022,
        length=2.5, spacing=(0.002, 0.0344), thickness=(0.008, 0.008), ground=de.Ground(slope=1.0),
    )  # fmt: skip
    noisy = scene_of(capsys, tmp_path, f"{words} --deviation 1 --gaps 5 30 --friction 0.2 --push 9")
    assert (noisy.objective, noisy.settings) == ("robust", de.Placement(0.001))
    assert noisy.spacing == (0.005, 0.03)
    assert noisy.physics == de.Physics(0.2, push=9.0)
    floor = scene_of(capsys, tmp_path, "--count 9 --thickness 8 --floor 0.4 --deviation 1")
    assert (floor.floor_friction, floor.settings.draws) == (0.4, 8)


@pytest.mark.parametrize(("words", "message"), [
    ("--length 9000", "row.length = 9 m cannot be met: .* row.count = 198 to 948 would fit"),
    ("--thickness 60", "--thickness = 60.0 mm: give a finite number, less than 48"),
    ("--deviation 30", "--deviation = 30.0 mm: give a finite number, at most 19.2"),
    ("--deviation 0.001", "--deviation = 0.001 mm: give a finite number from 0.01"),
    ("--out x.csv", "x.csv: name a .toml file"),
    ("--slope 20", "the ground slopes by 20°"),
    ("--gaps 30 5", "--gaps = 5.0 mm: give a finite number, at least 30, less than 48"),
])  # fmt: skip
def test_impossible_scenes_are_rejected(capsys, words, message):
    assert main(["scene", "--count", "40", "--thickness", "7.5", *words.split()]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert re.search(message, output.err)


def test_placement_noise_spreads_the_arrival_time(capsys, tmp_path):
    layout = de.Layout.uniform(30, spacing=0.038)
    layout.to_csv(tmp_path / "row.csv")

    def noise(millimetres: str) -> dict[str, float]:
        words = ["simulate", str(tmp_path / "row.csv"), "--json", "--deviation", millimetres]
        assert main(words) == 0
        return json.loads(capsys.readouterr().out)["placement_noise"]

    spread, physics = noise("5"), de.Physics()
    errors = 0.005 * np.random.default_rng(0).standard_normal((256, 29))
    waves = [
        de.simulate(de.Layout(np.maximum(gaps, 0.0002), 0.0075), physics)
        for gaps in layout.spacing + errors
    ]
    times = [wave.arrival_times[-1] for wave in waves if wave.mean_speed > 0.0]
    assert spread["completes"] == len(times) / 256
    assert 0.0 < spread["completes"] < 1.0
    assert spread["mean"] == pytest.approx(np.mean(times), rel=1e-5)
    assert spread["spread"] == pytest.approx(np.std(times), rel=1e-3)
    assert noise("0.01")["spread"] < 0.01 * spread["spread"]
    assert main(["simulate", str(tmp_path / "row.csv"), "--deviation", "5"]) == 0
    assert "% complete, last domino hit after " in capsys.readouterr().out
