"""Sound: clicks of a wave as a recording, and recordings of chains from files."""

from __future__ import annotations

import io
import subprocess
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domino_env.core.checks import require, require_extra
from domino_env.core.files import errors_with_path, read_bytes, write_bytes
from domino_env.core.types import Floats
from domino_env.physics.wave import Wave, require_wave

RATE = 44100  # [1/s] samples per second of sounds that are written
MAX_SAMPLES = 30_000_000  # eleven minutes at that rate; 1 GB of memory for the analysis
MIN_RATE, MAX_RATE = 1000, 1_000_000  # [1/s] samples per second of a recording
DECODED_RATE = 48000  # [1/s] samples per second of sounds that ffmpeg decodes
REST = 0.1  # [s] of silence before and after the clicks
CLICK_FREQUENCY, CLICK_DECAY = 3200.0, 0.0012  # [Hz], [s] of the damped sine that is a click


def clicks(wave: Wave) -> Floats:
    """Return the sound of a wave: a click at every hit, as loud as its impact is fast.

    Parameters
    ----------
    wave
        The wave.

    Returns
    -------
    ndarray
        Samples (S,) in -1 … 1, 44 100 per second, with 0.1 s of silence before and after the wave.

    Raises
    ------
    TypeError
        For anything else than a wave.
    ValueError
        For a wave of more than 30 million samples, which are eleven minutes.
    """
    require_wave("wave", wave)
    times = wave.arrival_times[1 : wave.hit]
    end = float(times[-1]) if len(times) else 0.0
    samples = int((end + 2.0 * REST) * RATE) + 1
    _require_samples(samples, f"a wave of {end:.4g} s has")
    sound = np.zeros(samples)
    length = int(8.0 * CLICK_DECAY * RATE)  # a click has then decayed to e^-8
    levels = np.abs(wave.impact_velocity[: len(times)])
    levels /= max(float(levels.max(initial=0.0)), 1e-12)  # never divided by 0
    for t, level in zip(times, levels, strict=True):
        first = int(np.ceil((t + REST) * RATE))
        since = np.arange(first, first + length) / RATE - (t + REST)
        sound[first : first + length] += (
            level * np.exp(-since / CLICK_DECAY) * np.sin(2.0 * np.pi * CLICK_FREQUENCY * since)
        )[: len(sound) - first]
    peak = float(np.abs(sound).max())
    return sound / peak * 0.9 if peak > 0.0 else sound  # headroom for players that resample


def write_wav(samples: Floats, path: Path) -> None:
    """Write a WAV file of 16 bits, one channel and 44 100 samples per second.

    Parameters
    ----------
    samples
        Samples (S,), clipped to -1 … 1.
    path
        Output file.
    """
    from scipy.io import wavfile

    raw = np.round(np.clip(samples, -1.0, 1.0) * 32767.0).astype("<i2")
    write_bytes(path, lambda file: wavfile.write(file, RATE, raw))


def read_recording(path: Path) -> tuple[Floats, int]:
    """Read a recording.

    Parameters
    ----------
    path
        WAV file of integer or floating-point samples; any other sound or film (.m4a, .mp3, .mp4,
        .mov, .ogg) is decoded by ffmpeg, which the extra `render` installs.

    Returns
    -------
    samples : ndarray
        Samples (S,), mean of the channels; integers are scaled to -1 … 1.
    rate : int
        Samples per second.

    Raises
    ------
    ValueError
        For a file without sound, a rate that is not from 1000 to 1 000 000, and more than 30
        million samples.
    ImportError
        If ffmpeg is needed and not installed.
    """
    with errors_with_path(path):
        data = read_bytes(path)
        if data[:4] not in (b"RIFF", b"RIFX", b"RF64") and path.suffix.lower() != ".wav":
            return _decode(path), DECODED_RATE
        return _read_wav(data)


def _read_wav(data: bytes) -> tuple[Floats, int]:
    """Return the samples of a WAV file, and their rate."""
    from scipy.io import wavfile

    try:
        with warnings.catch_warnings():
            # SciPy warns of chunks that it does not use, and of a cut after the samples
            warnings.simplefilter("ignore", wavfile.WavFileWarning)
            rate, raw = wavfile.read(io.BytesIO(data))
    except Exception as error:  # SciPy raises many types for a wrong header
        reason = str(error) if isinstance(error, ValueError) else "it ends early or is broken"
        raise ValueError(
            f"not a plain WAV file, or cut off amid a sample ({reason}); convert it to PCM WAV"
        ) from None
    require("rate", rate, MIN_RATE, MAX_RATE, "samples per second")
    _require_samples(raw.size, "it holds")
    return _scale_samples(raw).reshape(len(raw), -1).mean(1), rate


def _decode(path: Path) -> Floats:
    """Return the samples that ffmpeg decodes from a file."""
    require_extra("a recording that is not WAV", "render", "imageio_ffmpeg")
    import imageio_ffmpeg

    options = ["-vn", "-ac", "1", "-f", "f32le", "-ar"]
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-nostdin", "-i", str(path)]
    result = subprocess.run(
        [*command, *options, str(DECODED_RATE), "-"], capture_output=True, check=False
    )
    if result.returncode or not result.stdout:
        reason = result.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        raise ValueError(f"no sound can be decoded ({reason or 'it has none'}): record it again")
    samples = np.frombuffer(result.stdout, "<f4").astype(np.float64)
    _require_samples(len(samples), "it holds")
    return samples


def _scale_samples(raw: NDArray[np.generic]) -> Floats:
    """Return the samples of a file as floats; integers, unsigned up to 8 bits, become -1 … 1."""
    samples = raw.astype(np.float64)
    if raw.dtype.kind == "f":
        return samples
    half = 2.0 ** (8 * raw.dtype.itemsize - 1)
    return samples / half - (1.0 if raw.dtype.kind == "u" else 0.0)


def _require_samples(number: int, subject: str) -> None:
    """Raise ValueError for no or too many samples; subject: first words of the message."""
    if not 0 < number <= MAX_SAMPLES:
        raise ValueError(f"{subject} {number:,} samples: give 1 to {MAX_SAMPLES:,}")
