"""Sound: the clicks of a row as a recording, and the hits a second of a recording."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domino_env.core.checks import require
from domino_env.core.files import naming, read_bytes, write_bytes
from domino_env.core.types import Floats
from domino_env.physics.wave import Wave

RATE = 44100  # samples a second
MOST_SAMPLES = 30_000_000  # eleven minutes at that rate; 1 GB to listen to
SLOWEST_RATE, FASTEST_RATE = 1000, 1_000_000  # samples a second that are listened to
REST = 0.1  # [s] of silence before and after
PITCH_OF_CLICK, DECAY = 3200.0, 0.0012  # [Hz], [s]
HOP = 0.0005  # [s] a loudness
SLOWEST, FASTEST = 5.0, 250.0  # hits a second that are looked for
QUIET = 0.1  # of the loudest tenth: below it nothing is toppling
RUN_UP = 0.25  # of the recording: the wave is still gathering speed
PARTS = 5  # estimated one by one, for the uncertainty
ENOUGH = 8  # hits a part at least


def clicks(wave: Wave) -> Floats:
    """Play a wave: a short click at every hit, louder the faster the tip.

    Parameters
    ----------
    wave
        The wave.

    Returns
    -------
    NDArray
        Samples in -1 … 1, `RATE` of them a second.

    Raises
    ------
    ValueError
        For a wave that lasts for more than `MOST_SAMPLES`.
    """
    times = wave.arrival_times[1 : wave.hit]
    end = float(times[-1]) if len(times) else 0.0
    samples = int((end + 2.0 * REST) * RATE) + 1
    _require_samples(samples, f"a wave of {end:.4g} s sounds for")
    sound = np.zeros(samples)
    length = int(8.0 * DECAY * RATE)
    loud = np.abs(wave.impact_velocity[: len(times)])
    for t, level in zip(times, loud / max(float(loud.max(initial=0.0)), 1e-12), strict=True):
        first = int(np.ceil((t + REST) * RATE))
        # the click begins between two samples
        since = np.arange(first, first + length) / RATE - (t + REST)
        sound[first : first + length] += (
            level * np.exp(-since / DECAY) * np.sin(2.0 * np.pi * PITCH_OF_CLICK * since)
        )[: len(sound) - first]
    top = float(np.abs(sound).max())
    return sound / top * 0.9 if top > 0.0 else sound


def write_wav(samples: Floats, path: Path) -> None:
    """Write 16-bit mono sound whole."""
    from scipy.io import wavfile

    whole = np.round(np.clip(samples, -1.0, 1.0) * 32767.0).astype("<i2")
    write_bytes(path, lambda file: wavfile.write(file, RATE, whole))


def read_wav(path: Path) -> tuple[Floats, int]:
    """Read a recording: samples in -1 … 1, channels averaged, and samples a second.

    Raises
    ------
    ValueError
        For a file that is no WAV of plain or floating-point samples, and for more than
        `MOST_SAMPLES`.
    """
    from scipy.io import wavfile

    with naming(path):
        data = read_bytes(path)
        try:
            with warnings.catch_warnings():
                # parts that are no sound, or are missing behind it, do not matter here
                warnings.simplefilter("ignore", wavfile.WavFileWarning)
                rate, whole = wavfile.read(io.BytesIO(data))
        except Exception as error:  # a header that lies has SciPy fail in many ways
            why = str(error) if isinstance(error, ValueError) else "it ends early or is broken"
            raise ValueError(
                f"not a plain WAV file, or cut off amid a sample ({why}); convert it to PCM WAV"
            ) from None
        require("rate", rate, SLOWEST_RATE, FASTEST_RATE, "samples a second")
        _require_samples(whole.size, "it holds")
        return _in_unit(whole).reshape(len(whole), -1).mean(1), rate


def _in_unit(whole: NDArray[np.generic]) -> Floats:
    """Samples as a file has them, in -1 … 1; below 9 bits they are unsigned."""
    samples = whole.astype(np.float64)
    if whole.dtype.kind == "f":
        return samples
    half = 2.0 ** (8 * whole.dtype.itemsize - 1)
    return samples / half - (1.0 if whole.dtype.kind == "u" else 0.0)


def _require_samples(number: int, what: str) -> None:
    if number > MOST_SAMPLES:
        raise ValueError(f"{what} {number:,} samples, where at most {MOST_SAMPLES:,} are handled")


@dataclass(frozen=True)
class HitFrequency:
    """What a recording tells.

    Attributes
    ----------
    frequency
        Hits a second.
    uncertainty
        Standard error of the frequency, from the parts of the recording.
    clarity
        Of the autocorrelation at that period, 1 for a perfect repeat, about 0 for noise.
    seconds
        Of toppling that were listened to.
    """

    frequency: float
    uncertainty: float
    clarity: float
    seconds: float


def listen(samples: Floats, rate: int) -> HitFrequency:
    """Find the hit frequency of a recording, by autocorrelation of its loudness.

    The stretch that is not quiet is found, its first quarter left out as the wave gathers speed.

    Parameters
    ----------
    samples
        In -1 … 1, as of `read_wav`.
    rate
        Samples a second.

    Raises
    ------
    ValueError
        Where there is too little to hear.
    """
    if not np.isfinite(samples).all():
        raise ValueError("the recording has samples that are no finite numbers: export it anew")
    if not samples.any():
        raise ValueError("the recording is silent: nothing to listen to")
    loud = _onsets(samples, rate)
    if not loud.any():
        raise ValueError("nothing begins or ends in the recording: nothing to listen to")
    busy = np.flatnonzero(loud > QUIET * float(np.quantile(loud[loud > 0.0], 0.95)))
    first, last = int(busy[0]), int(busy[-1]) + 1
    steady = loud[first + int(RUN_UP * (last - first)) : last]
    seconds = len(steady) * HOP
    if seconds < 2.0 * ENOUGH / FASTEST:
        raise ValueError(f"only {seconds:.2f} s of toppling to hear: record a longer row")
    frequency, clarity = _repeat(steady, SLOWEST, FASTEST)
    size = max(len(steady) // PARTS, int(ENOUGH / frequency / HOP))
    count = len(steady) // size
    parts = [
        _repeat(steady[k * size : (k + 1) * size], 0.75 * frequency, 1.33 * frequency)[0]
        for k in range(count)
    ]
    # half a loudness in the time of the whole is the least doubt
    least = frequency * 0.5 * HOP / seconds
    spread = float(np.std(parts, ddof=1) / np.sqrt(count)) if count > 1 else 0.1 * frequency
    return HitFrequency(frequency, max(spread, least), clarity, seconds)


def _onsets(samples: Floats, rate: int) -> Floats:
    """Rise of the loudness, one value a HOP: hits are what begins suddenly."""
    edges = np.round(np.arange(0.0, len(samples) / rate, HOP) * rate).astype(np.int64)
    power = np.add.reduceat(np.diff(samples, prepend=samples[0]) ** 2, edges[edges < len(samples)])
    level = np.sqrt(power)
    rise = np.maximum(np.diff(level, prepend=level[0]), 0.0)
    # a hit falls between two values: spread it, so that the maximum can be found between them
    kernel = np.hanning(9)
    return np.convolve(rise, kernel / kernel.sum(), mode="same")


def _repeat(loud: Floats, slowest: float, fastest: float) -> tuple[float, float]:
    """Frequency and height of the strongest repeat between two frequencies."""
    centred = loud - loud.mean()
    size = 1 << (2 * len(centred) - 1).bit_length()
    spectrum = np.fft.rfft(centred, size)
    raw = np.fft.irfft(np.abs(spectrum) ** 2, size)[: len(centred)]
    same = raw / max(float(raw[0]), 1e-300) * len(centred) / np.arange(len(centred), 0, -1)
    low = max(int(1.0 / fastest / HOP), 1)
    high = min(int(1.0 / slowest / HOP) + 2, 2 * len(centred) // 3)
    if high - low < 3:
        raise ValueError("the recording is too short for this frequency")
    inside = same[low:high]
    best = float(inside.max())
    # of the period and its multiples, which repeat as well, the shortest
    peaks = [
        k
        for k in range(1, len(inside) - 1)
        if inside[k - 1] <= inside[k] >= inside[k + 1] and inside[k] > 0.8 * best
    ]
    lag = low + (peaks[0] if peaks else int(inside.argmax()))
    # then as many periods further as still repeat clearly, for a finer answer
    period = _between(same, lag)
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
        period = _between(same, near) / times
    return 1.0 / (period * HOP), float(same[lag])


def _between(values: Floats, k: int) -> float:
    """Where a parabola through three neighbours is highest."""
    a, b, c = values[k - 1 : k + 2]
    bend = a - 2.0 * b + c
    return k + (0.5 * (a - c) / bend if bend < 0.0 else 0.0)
