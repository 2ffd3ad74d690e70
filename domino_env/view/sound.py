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

RATE = 44100  # [1/s] samples per second of sounds that are written
MAX_SAMPLES = 30_000_000  # eleven minutes at that rate; 1 GB of memory for the analysis
MIN_RATE, MAX_RATE = 1000, 1_000_000  # [1/s] samples per second of a recording
REST = 0.1  # [s] of silence before and after the clicks
CLICK_FREQUENCY, CLICK_DECAY = 3200.0, 0.0012  # [Hz], [s] of the damped sine that is a click
HOP = 0.0005  # [s] between two values of the loudness
MIN_FREQUENCY, MAX_FREQUENCY = 5.0, 250.0  # [1/s] range of hit frequencies
QUIET = 0.1  # of the 95th percentile of the loudness; hits are louder
RUN_UP = 0.25  # fraction of the toppling that is left out, as the wave accelerates there
PARTS = 5  # parts of a recording, estimated separately for the uncertainty
MIN_HITS = 8  # in a part


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


def read_wav(path: Path) -> tuple[Floats, int]:
    """Read a recording.

    Parameters
    ----------
    path
        WAV file of integer or floating-point samples.

    Returns
    -------
    samples : ndarray
        Samples (S,), mean of the channels; integers are scaled to -1 … 1.
    rate : int
        Samples per second.

    Raises
    ------
    ValueError
        For a file of another kind, a rate that is not from 1000 to 1 000 000, and more than 30
        million samples.
    """
    from scipy.io import wavfile

    with errors_with_path(path):
        data = read_bytes(path)
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


@dataclass(frozen=True)
class HitFrequency:
    """Hit frequency of a recording.

    Attributes
    ----------
    frequency
        Hits per second [1/s].
    uncertainty
        Standard error of the frequency [1/s] from parts of the recording, at least that of half an
        interval of 0.5 ms in the duration; a tenth of the frequency if there is only one part.
    clarity
        Autocorrelation at the period of the hits: 1 for perfect periodicity, about 0 for noise.
    seconds
        Duration of the toppling that was analysed [s].
    """

    frequency: float
    uncertainty: float
    clarity: float
    seconds: float


def listen(samples: Floats, rate: int) -> HitFrequency:
    """Find the hit frequency of a recording by autocorrelation of its loudness.

    The part from the first hit to the last is analysed without its first quarter, in which the wave
    accelerates.

    Parameters
    ----------
    samples
        Samples (S,) of any scale.
    rate
        Samples per second, from 1000 to 1 000 000.

    Returns
    -------
    HitFrequency
        Frequency, uncertainty and clarity.

    Raises
    ------
    ValueError
        For a recording that is silent or too short, samples that are not finite, and a rate out of
        range.
    """
    require("samples", samples := numbers("samples", samples, None, ("S",)), array=True)
    require("rate", rate, MIN_RATE, MAX_RATE, "samples per second")
    if not samples.any():
        raise ValueError("the recording is silent: record it again")
    loudness = _onsets(samples, rate)
    if not loudness.any():
        raise ValueError("the recording has no sound that begins or ends: record it again")
    loud = np.flatnonzero(loudness > QUIET * float(np.quantile(loudness[loudness > 0.0], 0.95)))
    first, last = int(loud[0]), int(loud[-1]) + 1
    steady = loudness[first + int(RUN_UP * (last - first)) : last]
    seconds = len(steady) * HOP
    if seconds < 2.0 * MIN_HITS / MAX_FREQUENCY:
        raise ValueError(f"only {seconds:.2f} s of toppling are recorded: record a longer chain")
    frequency, clarity = _find_period(steady, MIN_FREQUENCY, MAX_FREQUENCY)
    size = max(len(steady) // PARTS, int(MIN_HITS / frequency / HOP))
    count = len(steady) // size
    # each part is searched near the frequency of the whole
    frequencies = [
        _find_period(steady[k * size : (k + 1) * size], 0.75 * frequency, 1.33 * frequency)[0]
        for k in range(count)
    ]
    # the least uncertainty is an error of half a hop in the whole duration
    least = frequency * 0.5 * HOP / seconds
    spread = float(np.std(frequencies, ddof=1) / np.sqrt(count)) if count > 1 else 0.1 * frequency
    return HitFrequency(frequency, max(spread, least), clarity, seconds)


def _onsets(samples: Floats, rate: int) -> Floats:
    """Return the rise of the loudness, one value per `HOP`, which is large at hits."""
    edges = np.round(np.arange(0.0, len(samples) / rate, HOP) * rate).astype(np.int64)
    power = np.add.reduceat(np.diff(samples, prepend=samples[0]) ** 2, edges[edges < len(samples)])
    level = np.sqrt(power)
    rise = np.maximum(np.diff(level, prepend=level[0]), 0.0)
    # each hit is smoothed over nine values, so that its maximum between two can be interpolated
    kernel = np.hanning(9)
    return np.convolve(rise, kernel / kernel.sum(), mode="same")


def _find_period(loudness: Floats, lowest: float, highest: float) -> tuple[float, float]:
    """Return the frequency of the loudness between two bounds [1/s], and its autocorrelation."""
    from scipy import signal

    centred = loudness - loudness.mean()
    sums = signal.correlate(centred, centred, method="fft")[len(centred) - 1 :]
    # values at larger lags are sums of fewer terms
    correlation = sums / max(float(sums[0]), 1e-300) * len(centred) / np.arange(len(centred), 0, -1)
    low = max(int(1.0 / highest / HOP), 1)
    # sums at lags over two thirds of the duration have too few terms
    high = min(int(1.0 / lowest / HOP) + 2, 2 * len(centred) // 3)
    if high - low < 3:
        raise ValueError("the recording is too short for this frequency: record a longer chain")
    inside = correlation[low:high]
    best = float(inside.max())
    # there are similar peaks at the multiples of the period: take the first
    peaks, _ = signal.find_peaks(inside, height=0.8 * best)
    lag = low + int(peaks[0] if len(peaks) else inside.argmax())
    # A multiple of the period gives a finer value. It grows while there is a clear peak within 12 %
    # of a period from the lag that it predicts.
    period = _parabola_peak(correlation, lag)
    multiple = 1
    while True:
        guess = round((multiple + 1) * period)
        reach = max(round(0.12 * period), 2)
        if guess + reach >= high or guess + reach >= len(correlation) - 1:
            break
        peak = guess - reach + int(correlation[guess - reach : guess + reach + 1].argmax())
        if correlation[peak] < 0.5 * best or peak in (guess - reach, guess + reach):
            break
        multiple += 1
        period = _parabola_peak(correlation, peak) / multiple
    return 1.0 / (period * HOP), float(correlation[lag])


def _parabola_peak(values: Floats, k: int) -> float:
    """Return the place of the maximum of the parabola through values k-1, k and k+1."""
    a, b, c = values[k - 1 : k + 2]
    curvature = a - 2.0 * b + c
    return k + (0.5 * (a - c) / curvature if curvature < 0.0 else 0.0)
