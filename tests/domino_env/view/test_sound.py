"""Sounds of waves, and recordings from files."""

import subprocess
import wave as wav

import numpy as np
import pytest

import domino_env as de
from domino_env.view.sound import RATE, REST, clicks, read_recording, write_wav


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
    samples, rate = read_recording(tmp_path / "w.wav")
    assert rate == 8000
    np.testing.assert_allclose(samples, written, atol=1e-12)


@pytest.mark.parametrize("suffix", [".m4a", ".mp3", ".ogg", ".mov"])
def test_other_recordings_are_decoded(suffix, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    write_wav(clicks(de.simulate(de.Layout([0.02] * 3, 0.0075))), tmp_path / "w.wav")
    path = tmp_path / f"w{suffix}"
    command = [ffmpeg, "-v", "error", "-i", str(tmp_path / "w.wav"), str(path)]
    if subprocess.run(command, check=False).returncode:
        pytest.skip("this ffmpeg cannot write the format")
    samples, rate = read_recording(path)
    plain, plain_rate = read_recording(tmp_path / "w.wav")
    assert len(samples) / rate == pytest.approx(len(plain) / plain_rate, abs=0.1)
    assert 0.3 < np.abs(samples).max() < 1.2


def test_a_file_without_sound_is_rejected(tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    (tmp_path / "w.mp3").write_bytes(b"no sound")
    with pytest.raises(ValueError, match=r"w\.mp3: no sound can be decoded"):
        read_recording(tmp_path / "w.mp3")
