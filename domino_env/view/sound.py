"""Sound: clicks of a wave as a recording, and the hit frequency of a recording."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domino_env.core.checks import numbers, require
from domino_env.core.files import errors_with_path, read_bytes, write_bytes
from domino_env.core.types import Floats
from domino_env.physics.wave import Wave, require_wave

RATE = 44100  # [1/s] samples
MAX_SAMPLES = 30_000_000  # eleven minutes at that rate; 1 GB of memory for the analysis
SLOWEST_RATE, FASTEST_RATE = 1000, 1_000_000  # [1/s] samples of a recording per second
REST = 0.1  # [s] of silence before and after the clicks
CLICK_PITCH, DECAY = 3200.0, 0.0012  # [Hz], [s] of a click
HOP = 0.0005  # [s] between two values of the loudness
SLOWEST, FASTEST = 5.0, 250.0  # [1/s] range of hit frequencies
QUIET = 0.1  # of the 95th percentile of the loudness: below it nothing topples
RUN_UP = 0.25  # part of the recording in which the wave still accelerates
PARTS = 5  # parts of a recording, estimated separately for the uncertainty
LEAST_HITS = 8  # least number of hits in a part


def clicks(wave: Wave) -> Floats:
    """Return the sound of a wave: a short click at every hit, louder the faster the tip.

    Parameters
    ----------
    wave
        The wave.

    Returns
    -------
    ndarray
        Samples in -1 … 1, 44 100 per second.

    Raises
    ------
    ValueError
        For a wave of more than 30 million samples.
    """
    require_wave("wave", wave)
    times = wave.arrival_times[1 : wave.hit]
    end = float(times[-1]) if len(times) else 0.0
    samples = int((end + 2.0 * REST) * RATE) + 1
    _require_samples(samples, f"a wave of {end:.4g} s has")
    sound = np.zeros(samples)
    length = int(8.0 * DECAY * RATE)
    levels = np.abs(wave.impact_velocity[: len(times)])
    levels /= max(float(levels.max(initial=0.0)), 1e-12)
    for t, level in zip(times, levels, strict=True):
        first = int(np.ceil((t + REST) * RATE))
        since = np.arange(first, first + length) / RATE - (t + REST)
        sound[first : first + length] += (
            level * np.exp(-since / DECAY) * np.sin(2.0 * np.pi * CLICK_PITCH * since)
        )[: len(sound) - first]
    top = float(np.abs(sound).max())
    return sound / top * 0.9 if top > 0.0 else sound


def write_wav(samples: Floats, path: Path) -> None:
    """Write samples in -1 … 1 to a WAV file of 16 bits and one channel."""
    from scipy.io import wavfile

    whole = np.round(np.clip(samples, -1.0, 1.0) * 32767.0).astype("<i2")
    write_bytes(path, lambda file: wavfile.write(file, RATE, whole))


def read_wav(path: Path) -> tuple[Floats, int]:
    """Read a recording.

    Returns
    -------
    samples : ndarray
        Samples in -1 … 1, averaged over the channels.
    rate : int
        Samples per second.

    Raises
    ------
    ValueError
        For a file that is not a WAV of plain or floating-point samples, and for more than 30
        million samples.
    """
    from scipy.io import wavfile

    with errors_with_path(path):
        data = read_bytes(path)
        try:
            with warnings.catch_warnings():
                # chunks other than the sound, or missing behind it, do not matter here
                warnings.simplefilter("ignore", wavfile.WavFileWarning)
                rate, whole = wavfile.read(io.BytesIO(data))
        except Exception as error:  # SciPy fails in many ways on a wrong header
            reason = str(error) if isinstance(error, ValueError) else "it ends early or is broken"
            raise ValueError(
                f"not a plain WAV file, or cut off amid a sample ({reason}); convert it to PCM WAV"
            ) from None
        require("rate", rate, SLOWEST_RATE, FASTEST_RATE, "samples a second")
        _require_samples(whole.size, "it holds")
        return _scale_samples(whole).reshape(len(whole), -1).mean(1), rate


def _scale_samples(whole: NDArray[np.generic]) -> Floats:
    """Return samples of a file in -1 … 1; below 9 bits they are unsigned."""
    samples = whole.astype(np.float64)
    if whole.dtype.kind == "f":
        return samples
    half = 2.0 ** (8 * whole.dtype.itemsize - 1)
    return samples / half - (1.0 if whole.dtype.kind == "u" else 0.0)


def _require_samples(number: int, subject: str) -> None:
    if number > MAX_SAMPLES:
        raise ValueError(f"{subject} {number:,} samples: give at most {MAX_SAMPLES:,}")


@dataclass(frozen=True)
class HitFrequency:
    """Hit frequency of a recording.

    Attributes
    ----------
    frequency
        Hits per second [1/s].
    uncertainty
        Standard error of the frequency, from the parts of the recording [1/s].
    clarity
        Autocorrelation at that period: 1 for a perfect repeat, about 0 for noise.
    seconds
        Duration of the toppling that was analysed [s].
    """

    frequency: float
    uncertainty: float
    clarity: float
    seconds: float


def listen(samples: Floats, rate: int) -> HitFrequency:
    """Find the hit frequency of a recording by autocorrelation of its loudness.

    The first quarter of the part that is not quiet is left out, as the wave accelerates there.

    Parameters
    ----------
    samples
        Samples in -1 … 1.
    rate
        Samples per second.

    Returns
    -------
    HitFrequency
        Frequency, uncertainty and clarity.

    Raises
    ------
    ValueError
        For a recording that is silent, too short, or has samples that are not finite.
    """
    require("samples", samples := numbers("samples", samples, None, ("S",)), array=True)
    require("rate", rate, SLOWEST_RATE, FASTEST_RATE, "samples a second")
    if not samples.any():
        raise ValueError("the recording is silent: record it again")
    loudness = _onsets(samples, rate)
    if not loudness.any():
        raise ValueError("the recording has no sound that begins or ends: record it again")
    busy = np.flatnonzero(loudness > QUIET * float(np.quantile(loudness[loudness > 0.0], 0.95)))
    first, last = int(busy[0]), int(busy[-1]) + 1
    steady = loudness[first + int(RUN_UP * (last - first)) : last]
    seconds = len(steady) * HOP
    if seconds < 2.0 * LEAST_HITS / FASTEST:
        raise ValueError(f"only {seconds:.2f} s of toppling are recorded: record a longer chain")
    frequency, clarity = _strongest_repeat(steady, SLOWEST, FASTEST)
    size = max(len(steady) // PARTS, int(LEAST_HITS / frequency / HOP))
    count = len(steady) // size
    parts = [
        _strongest_repeat(steady[k * size : (k + 1) * size], 0.75 * frequency, 1.33 * frequency)[0]
        for k in range(count)
    ]
    # half a hop in the whole duration is the smallest uncertainty
    least = frequency * 0.5 * HOP / seconds
    spread = float(np.std(parts, ddof=1) / np.sqrt(count)) if count > 1 else 0.1 * frequency
    return HitFrequency(frequency, max(spread, least), clarity, seconds)


def _onsets(samples: Floats, rate: int) -> Floats:
    """Return the rise of the loudness, one value per HOP, which is large at hits."""
    edges = np.round(np.arange(0.0, len(samples) / rate, HOP) * rate).astype(np.int64)
    power = np.add.reduceat(np.diff(samples, prepend=samples[0]) ** 2, edges[edges < len(samples)])
    level = np.sqrt(power)
    rise = np.maximum(np.diff(level, prepend=level[0]), 0.0)
    # hits are spread, so that a maximum between two values can be interpolated
    kernel = np.hanning(9)
    return np.convolve(rise, kernel / kernel.sum(), mode="same")


def _strongest_repeat(loudness: Floats, slowest: float, fastest: float) -> tuple[float, float]:
    """Return frequency and height of the strongest repeat between two frequencies."""
    from scipy import signal

    centred = loudness - loudness.mean()
    raw = signal.correlate(centred, centred, method="fft")[len(centred) - 1 :]
    same = raw / max(float(raw[0]), 1e-300) * len(centred) / np.arange(len(centred), 0, -1)
    low = max(int(1.0 / fastest / HOP), 1)
    high = min(int(1.0 / slowest / HOP) + 2, 2 * len(centred) // 3)
    if high - low < 3:
        raise ValueError("the recording is too short for this frequency: record a longer chain")
    inside = same[low:high]
    best = float(inside.max())
    # the multiples of the period repeat as well: take the shortest
    peaks, _ = signal.find_peaks(inside, height=0.8 * best)
    lag = low + int(peaks[0] if len(peaks) else inside.argmax())
    # a multiple of the period, as far as the signal still repeats clearly, gives a finer value
    period = _parabola_peak(same, lag)
    times = 1
    while True:
        guess = round((times + 1) * period)
        reach = max(round(0.12 * period), 2)
        if guess + reach >= high or guess + reach >= len(same) - 1:
            break
        near = guess - reach + int(same[guess - reach : guess + reach + 1].argmax())
        if same[near] < 0.5 * best or near in (guess - reach, guess + reach):
            break
        times += 1
        period = _parabola_peak(same, near) / times
    return 1.0 / (period * HOP), float(same[lag])


def _parabola_peak(values: Floats, k: int) -> float:
    """Return the position of the maximum of the parabola through values k-1, k and k+1."""
    a, b, c = values[k - 1 : k + 2]
    bend = a - 2.0 * b + c
    return k + (0.5 * (a - c) / bend if bend < 0.0 else 0.0)
