"""Sounds of waves, and the frequencies of recordings."""

import wave as wav

import numpy as np
import pytest

import domino_env as de
from domino_env.view.sound import RATE, REST, clicks, listen, read_wav, write_wav

PUSH = 5 * np.pi


@pytest.mark.parametrize("pitch", [0.016, 0.024, 0.032])
def test_listening_to_clicks_gives_their_frequency(pitch, tmp_path):
    physics = de.Physics(push=PUSH)
    write_wav(clicks(de.simulate(de.Layout.uniform(100, pitch=pitch), physics)), tmp_path / "w.wav")
    result = listen(*read_wav(tmp_path / "w.wav"))
    true = de.steady_wave(pitch, 0.0075, physics=physics).frequency
    assert result.frequency == pytest.approx(true, rel=0.005)
    assert result.uncertainty < 0.02 * true


def test_noise_lowers_the_clarity_and_hardly_changes_the_frequency():
    wave = de.simulate(de.Layout.uniform(100, pitch=0.024), de.Physics(push=PUSH))
    sound = clicks(wave)
    rng = np.random.default_rng(0)
    noisy = sound + 0.02 * rng.standard_normal(len(sound))
    assert listen(noisy, RATE).frequency == pytest.approx(listen(sound, RATE).frequency, rel=0.02)
    assert listen(rng.standard_normal(2 * RATE), RATE).clarity < 0.5


def test_clicks_come_when_the_dominoes_are_hit():
    wave = de.simulate(de.Layout([0.02, 0.035, 0.01], 0.0075), de.Physics(push=8.0))
    sound = clicks(wave)
    for t in wave.arrival_times[1:]:
        at = int((t + REST) * RATE)
        assert np.abs(sound[at - 40 : at]).max() < 0.2 * np.abs(sound[at : at + 40]).max()


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_recordings_of_every_sample_size_read_the_same(size, tmp_path):
    written = np.round(100 * np.sin(np.arange(500) / 7)) / 128.0
    with wav.open(str(tmp_path / "w.wav"), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(size)
        file.setframerate(8000)
        whole = (written * 2.0 ** (8 * size - 1)).astype(np.int64) + (128 if size == 1 else 0)
        frames = [int(x).to_bytes(size, "little", signed=size > 1) * 2 for x in whole]
        file.writeframes(b"".join(frames))
    samples, rate = read_wav(tmp_path / "w.wav")
    assert rate == 8000
    np.testing.assert_allclose(samples, written, atol=1e-12)
