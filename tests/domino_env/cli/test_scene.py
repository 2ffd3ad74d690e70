"""The scene of a builder's own dominoes, and simulation with placement noise."""

import json

import numpy as np
import pytest

import domino_env as de
from domino_env.scenes.placement import placement_noise


def test_options_in_millimetres_and_degrees_define_a_scene(output_of, tmp_path):
    def scene_of(words: str) -> de.Scene:
        file = tmp_path / "mine.toml"
        file.write_text(output_of("scene", *words.split()), "utf-8")
        return de.load_scene(file)

    words = "--count 120 --thickness 8 --height 43 --width 22 --length 2500 --slope 1"
    scene = scene_of(words)
    assert scene == de.Scene(
        name="mine", title="120 dominoes of 8 x 22 x 43 mm on a slope of 1°", count=120,
        height=0.043, width=0.022, length=2.5, spacing=(0.002, 0.0344), thickness=(0.008, 0.008),
        ground=de.Ground(slope=1.0),
    )  # fmt: skip
    noisy = scene_of(f"{words} --deviation 1 --gaps 5 30 --friction 0.2 --push 9")
    assert noisy.placement == de.Placement(0.001, 256, 0.05)
    assert noisy.spacing == (0.005, 0.03)
    assert noisy.physics == de.Physics(0.2, push=9.0)
    released = scene_of(f"{words} --push released")
    expected = de.Physics.released(de.Ground(slope=1.0).layout([0.01], [0.008] * 2, 0.043))
    assert released.physics == expected
    shown = output_of("simulate", "--scene", tmp_path / "mine.toml", "--push", "released",
                      _row_of(scene, tmp_path))  # fmt: skip
    assert f"push {expected.push:g} rad/s (of scene 'mine', but for --push)" in shown
    floor = scene_of("--count 9 --thickness 8 --floor 0.4 --deviation 1")
    assert (floor.floor_friction, floor.placement.draws) == (0.4, 8)


def _row_of(scene, folder):
    """Write equal gaps of a scene to a file, and return its path."""
    gap = scene.length / (scene.count - 1) - 0.008
    scene.ground.layout([gap] * (scene.count - 1), [0.008] * scene.count, 0.043).to_csv(
        folder / "row.csv"
    )
    return folder / "row.csv"


def test_placement_noise_spreads_the_arrival_time(output_of, tmp_path):
    layout = de.Layout.uniform(30, spacing=0.038)
    layout.to_csv(tmp_path / "row.csv")
    words = "simulate", tmp_path / "row.csv", "--deviation"

    def noise(millimetres: float) -> dict[str, float]:
        return json.loads(output_of(*words, millimetres, "--json"))["placement_noise"]

    spread, physics = noise(5), de.Physics()
    errors = de.Placement(0.005, 256).errors(29)
    waves = [
        de.simulate(de.Layout(np.maximum(gaps, 0.0002), 0.0075), physics)
        for gaps in layout.spacing + errors
    ]
    times = [wave.arrival_times[-1] for wave in waves if wave.mean_speed > 0.0]
    assert spread["completes"] == len(times) / 256
    assert 0.0 < spread["completes"] < 1.0
    assert spread["mean"] == pytest.approx(np.mean(times), rel=1e-5)
    assert spread["spread"] == pytest.approx(np.std(times), rel=1e-3)
    assert noise(0.01)["spread"] < 0.01 * spread["spread"]
    assert "% complete, last domino hit after " in output_of(*words, 5)
    wave = de.simulate(layout)  # the gaps of a run-out have no errors
    assert placement_noise(wave, None, 0.005, run_out=29)["spread"] < 1e-12
