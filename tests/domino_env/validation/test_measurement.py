"""Measured chains: synthetic recordings with known truth, and recordings that are rejected."""

from pathlib import Path

import numpy as np
import pytest
from recordings import LOUDNESS, record

import domino_env as de
from domino_env.cli.main import main
from domino_env.validation.measured_gain import source_document
from domino_env.validation.measurement import Measurement
from domino_env.validation.source import read_source
from domino_env.view.sound import write_wav
from optimize.experiments.best_known import best_known

SCENE = de.load_scene("sprint")
UNIFORM = SCENE.uniform().layout
GAPS = np.append(np.geomspace(0.028, 0.009, 36), [0.002] * 3)
UNEQUAL = de.Layout(GAPS, 0.0075)
RATES = 44100, 8000, 48000, 22050


def simulated(layout, seed):
    """Return a wave whose friction and push follow from the seed."""
    rng = np.random.default_rng(seed)
    physics = de.Physics(friction=rng.uniform(0.1, 0.35), push=rng.uniform(5.0, 12.0))
    return de.simulate(layout, physics)


def check(sound, rate, wave):
    result = de.measure(sound, rate, wave.layout)
    assert result.friction == pytest.approx(wave.physics.friction, abs=0.02)
    assert result.mean_speed == pytest.approx(wave.mean_speed, rel=0.005)
    assert abs(result.mean_speed - wave.mean_speed) < 4.0 * result.mean_speed_error
    assert result.misfit_rms < 0.001
    assert not result.model_rejected
    heard = np.isfinite(result.arrival_times)
    assert np.abs(result.arrival_times - wave.arrival_times)[heard].max() < 0.02
    return result


@pytest.mark.parametrize("seed", range(4))
def test_friction_and_speed_are_those_of_the_recorded_chain(seed):
    layout = UNIFORM if seed % 2 else UNEQUAL
    wave, rate = simulated(layout, seed), RATES[seed]
    loudness = list(LOUDNESS)[seed]
    check(record(wave.arrival_times, seed, rate=rate, loudness=loudness, hum=0.3), rate, wave)


def test_a_released_domino_has_no_push_to_fit():
    base = de.Physics.released(UNEQUAL, friction=0.2)
    # a slower finger: half the angular velocity at the balance
    wave = de.simulate(UNEQUAL, base.replace(push=base.push * np.sqrt(1.0025 / 1.01)))
    result = de.measure(record(wave.arrival_times, 2), 44100, UNEQUAL, base)
    assert result.push == pytest.approx(base.push, rel=1e-4)
    assert result.friction == pytest.approx(0.2, abs=0.002)
    expected = de.simulate(UNEQUAL, base).mean_speed
    assert result.mean_speed == pytest.approx(expected, rel=0.002)
    assert result.mean_speed != pytest.approx(wave.mean_speed, rel=0.02)


def test_silence_around_a_chain_reveals_no_second_one():
    silence = np.random.default_rng(0).normal(0.0, 0.002, 300_000)
    layout = best_known()["sprint"].layout
    wave = de.simulate(layout, de.Physics(friction=0.2, push=8.75))
    sound = np.concatenate([silence, record(wave.arrival_times, 4), silence])
    check(sound, 44100, wave)


def chains_apart(times, seconds):
    """Return the sound of two chains, the second later by some seconds."""
    first, second = record(times, 50), record(times, 70)
    late = int(44100 * seconds)
    both = np.zeros(late + len(second))
    both[: len(first)] += first
    both[late:] += second
    return both


WAVE = simulated(UNEQUAL, 0)
TIMES = WAVE.arrival_times
SOUND = record(TIMES, 0)
CUT = int(44100 * (0.3 + TIMES[19]))


@pytest.mark.parametrize(("sound", "layout", "words"), [
    (SOUND, UNIFORM, "the sound is not that of this layout"),
    (SOUND, de.Layout(GAPS[::-1].copy(), 0.0075), "the sound is not that of this layout"),
    (np.random.default_rng(1).standard_normal(90_000), UNEQUAL, "is not that of this layout"),
    (record(TIMES[:23], 2), UNEQUAL, r"the last hit heard is that of domino 2\d of 40"),
    (SOUND[:CUT], UNEQUAL, "the chain stopped there, or the recording was cut"),
    (SOUND[CUT:], UNEQUAL, "the recording begins after the push, or is of another layout"),
    (chains_apart(TIMES, 0.37), UNEQUAL, "the recording contains two chains"),
    (chains_apart(TIMES, 2.5), UNEQUAL, r"are heard twice, 2\.50 s apart"),
    (SOUND, de.Layout([0.02] * 5, 0.0075), "the layout has 6 dominoes: measure one of at least 9"),
    (np.full(90_000, np.nan), UNEQUAL, r"samples\[0\] = nan"),
])  # fmt: skip
def test_other_sounds_are_rejected(sound, layout, words):
    with pytest.raises(ValueError, match=words):
        de.measure(sound, 44100, layout)


def test_times_follow_the_hits_where_the_model_is_wrong():
    times = TIMES + 0.002 * np.sin(2.0 * np.pi * np.linspace(0.0, 1.0, 40))
    result = de.measure(record(times, 3, missing=0.0, double=0.0), 44100, UNEQUAL)
    assert result.model_rejected
    assert "the model is rejected" in result.verdict
    assert result.speed(10, 30)[0] == pytest.approx(
        (UNEQUAL.positions[30] - UNEQUAL.positions[10]) / (times[30] - times[10]), rel=0.003
    )
    for first, last in (-1, 3), (3, 3), (3, 40):
        with pytest.raises(ValueError, match="give a whole number"):
            result.speed(first, last)


def measurement(layout, speed, **changes):
    """Return a measurement of a given speed."""
    physics = de.Physics(friction=0.2)
    values = dict.fromkeys(Measurement.__dataclass_fields__, 0.0) | {
        "layout": layout, "physics": physics, "friction": 0.2, "push": 8.0,
        "mean_speed": speed, "mean_speed_error": 0.002,
    }  # fmt: skip
    return Measurement(**values | changes)


def test_a_gain_has_an_interval_from_five_recordings_on():
    base = [measurement(UNIFORM, 0.80 + 0.004 * k) for k in (-2, -1, 0, 1, 2)]
    other = [measurement(UNEQUAL, 0.84 + 0.004 * k) for k in (-2, -1, 0, 1, 2)]
    gain = de.measured_gain(base, other)
    assert gain.gain == pytest.approx(0.05, abs=1e-4)
    # standard errors of the logarithms 0.00354 and 0.00337, 8 degrees of freedom
    low, high = np.exp(np.log1p(gain.gain) + np.array([-1, 1]) * 2.306 * 0.00488) - 1.0
    assert gain.interval == pytest.approx((low, high), abs=5e-5)
    speeds = [de.simulate(a, de.Physics(friction=0.2)).mean_speed for a in (UNIFORM, UNEQUAL)]
    assert gain.predicted == pytest.approx(speeds[1] / speeds[0] - 1.0)
    assert gain.further == 0
    few = de.measured_gain(base[:2], other[3:])
    assert few.interval is None
    assert "no interval: it takes 5 recordings of each layout" in str(few)
    assert few.further > 0
    with pytest.raises(ValueError, match="number of measurements of other = 0"):
        de.measured_gain(base, [])


def test_a_recording_becomes_scene_source_picture_and_table(tmp_path, capsys):
    wave = de.simulate(UNIFORM, de.Physics(friction=0.2, push=9.0))
    write_wav(0.3 * record(wave.arrival_times, 1), tmp_path / "a.wav")
    (tmp_path / "noise.wav").write_bytes(b"RIFF")
    gap = 1e3 * UNIFORM.pitch[0]
    scene, source, out = (tmp_path / name for name in ("my.toml", "source.toml", "out"))
    files = ["--scene-out", scene, "--source-out", source, "--out", out]
    recordings = [tmp_path / "noise.wav", tmp_path / "a.wav"]
    words = "measure", *recordings, "--uniform", f"40,{gap}", *files
    assert main([str(word) for word in words]) == 0
    text, notices = capsys.readouterr()
    assert "a.wav: 3" in text
    assert "not measured: " in notices
    assert de.load_scene(scene).physics.friction == pytest.approx(0.2, abs=0.002)
    assert read_source(source).chains[0].value == pytest.approx(wave.mean_speed, rel=0.005)
    assert (out / "a.png").stat().st_size > 10_000
    assert len((out / "a-hits.csv").read_text().splitlines()) == 41


@pytest.mark.parametrize(("words", "message"), [
    ("--layout slope.csv a.wav --scene-out s.toml", "equal dominoes on flat ground"),
    ("--layout dense.csv a.wav --source-out s.toml", "equal dominoes on flat ground"),
    ("--uniform 40,20 a.wav b/a.wav --out out", "several recordings are named a: rename them"),
])  # fmt: skip
def test_files_that_would_be_wrong_are_rejected_before_any_work(
    words, message, tmp_path, monkeypatch, error_of
):
    monkeypatch.chdir(tmp_path)
    spacing, thickness = [0.0125] * 39, [0.0075] * 40
    de.Ground(slope=2.0).layout(spacing, thickness).to_csv("slope.csv")
    de.Layout(spacing, 0.0075, density=np.linspace(500.0, 900.0, 40)).to_csv("dense.csv")
    assert message in error_of("measure", *words.split())


def test_layouts_are_compared_in_the_order_of_the_command_line(tmp_path, monkeypatch, output_of):
    monkeypatch.chdir(tmp_path)
    UNEQUAL.to_csv("row.csv")
    for name, layout in (("a", UNEQUAL), ("b", UNIFORM)):
        times = de.simulate(layout, de.Physics(friction=0.2)).arrival_times
        write_wav(0.3 * record(times, 1), Path(f"{name}.wav"))
    pitch = f"40,{1e3 * UNIFORM.pitch[0]}"
    words = f"measure --layout row.csv a.wav --uniform {pitch} b.wav"
    assert f"{pitch} over row.csv: measured gain" in output_of(*words.split())


def test_a_source_has_equal_gaps_only():
    with pytest.raises(ValueError, match="a source contains chains of equal gaps"):
        source_document([[measurement(UNEQUAL, 0.8)]])
    other = de.Layout.uniform(30, pitch=0.03)
    with pytest.raises(ValueError, match="different dominoes"):
        source_document([[measurement(UNIFORM, 0.8)], [measurement(other, 0.8)]])


@pytest.mark.parametrize("options", [
    {"loudness": "alternating", "missing": 0.0, "double": 0.0},
    {"double": 1.0, "late": (0.0124, 0.0126), "missing": 0.0, "loudness": "even"},
], ids=["every second hit is softer", "second clacks half a period later"])  # fmt: skip
def test_hits_are_not_counted_by_halves_or_doubles(options):
    wave = de.simulate(de.Layout.uniform(60, pitch=0.0225), de.Physics(friction=0.2, push=9.0))
    check(record(wave.arrival_times, 1, **options), 44100, wave)
