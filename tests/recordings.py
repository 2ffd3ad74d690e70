"""Synthetic recordings of toppling chains, with the truth; shares no code with the detection."""

import numpy as np
from scipy import signal

LOUDNESS = {
    "even": lambda k, rng: 1.0,
    "random": lambda k, rng: rng.uniform(0.2, 1.0),
    "alternating": lambda k, rng: 0.4 if k % 2 else 1.0,
    "decreasing": lambda k, rng: 0.3 + 0.7 * np.exp(-k / 15.0),
}


def record(
    times, seed=0, *, rate=44100, loudness="random", missing=0.15, double=0.3, thuds=0.7, hum=0.0,
    noise=0.01, room=0.05, jitter=3e-4, lead=0.3, rest=0.7, late=(0.002, 0.012),
):  # fmt: skip
    """Return the samples of a recording of hits at `times` [s]; it begins `lead` before time 0.

    A hit is damped noise; `double` of the hits are followed by a second one after a time in
    `late`, and `thuds` by a dull one on the table. `room` is the loudness of the reverberation.
    """
    rng = np.random.default_rng(seed)
    length = int((lead + times[-1] + rest) * rate)
    sound = rng.normal(0.0, noise, length)

    def click(at, level, decay, low, high):
        first, count = int((lead + at) * rate), int(8 * decay * rate)
        since = np.arange(count) / rate
        burst = np.exp(-since / decay) * np.sin(
            2 * np.pi * rng.uniform(low, min(high, 0.4 * rate)) * since + rng.uniform(0, 6)
        )
        burst += 0.3 * np.exp(-since / decay) * rng.normal(size=count)
        piece = sound[max(first, 0) : first + count]
        piece += level * burst[count - len(piece) :] if first < 0 else level * burst[: len(piece)]

    for k, t in enumerate(times):
        level = LOUDNESS[loudness](k, rng)
        if rng.random() >= missing:
            click(t + rng.normal(0.0, jitter), level, 0.0015, 2000.0, 6000.0)
        if rng.random() < double:
            click(t + rng.uniform(*late), 0.7 * level, 0.0015, 2000.0, 6000.0)
        if rng.random() < thuds:
            click(t + rng.uniform(0.12, 0.2), 0.5 * level, 0.006, 100.0, 700.0)
    if room:
        echo = np.exp(-np.arange(int(0.25 * rate)) / (0.04 * rate))
        echo *= rng.normal(0.0, room, len(echo))
        echo[0] = 1.0
        sound = signal.fftconvolve(sound, echo)[:length]
    return sound + hum * np.sin(2 * np.pi * 50.0 * np.arange(length) / rate)
