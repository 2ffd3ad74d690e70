"""Measurements of synthetic recordings with known truth: accuracy, coverage and refusals.

python tests/measurements.py random 0 40      # accuracy; coverage with 0 200, in several minutes
python tests/measurements.py refused unusual  # recordings to refuse; rates, noise, long chains

The recordings share no code with the detection.  This is no test: the suite has a few of them.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path[:] = [str(HERE.parent), *sys.path[1:], str(HERE)]
from recordings import LOUDNESS, record  # noqa: E402

import domino_env as de  # noqa: E402
from optimize.experiments.best_known import best_known  # noqa: E402

RATES = 44100, 8000, 48000, 22050
CLOCK = 5e-5  # relative standard deviation of the clock of a recorder
FRICTION, SPEED = 0.02, 0.005  # errors to keep
SPRINT = {"best": best_known()["sprint"].layout, "equal": de.load_scene("sprint").uniform().layout}


def random_case(seed):
    """Return a layout's name, its wave and a recording of it: samples and rate."""
    rng = np.random.default_rng([seed, 61])
    name, rate = list(SPRINT)[seed % 2], RATES[seed // 4 % 4]
    physics = de.Physics(friction=rng.uniform(0.1, 0.35), push=rng.uniform(5.0, 12.0))
    wave = de.simulate(SPRINT[name], physics)
    times = wave.arrival_times * (1.0 + rng.normal(0.0, CLOCK))
    loudness, hum = list(LOUDNESS)[seed // 2 % 4], 0.3 * (seed % 3 == 0)
    return name, wave, record(times, seed, rate=rate, loudness=loudness, hum=hum), rate


def check(name, wave, sound, rate):
    """Measure a recording and print errors; return those in standard errors, and if kept."""
    began = time.process_time()
    try:
        m = de.measure(sound, rate, wave.layout)
    except ValueError as error:
        print(f"{name:28}refused: {error}", flush=True)
        return [np.inf] * 3 + [0.0, 0.0]
    seconds = time.process_time() - began
    truth = wave.physics.friction, wave.physics.push, wave.mean_speed
    names = "friction", "push", "mean_speed"
    errors = np.array([getattr(m, key) for key in names]) - truth
    scaled = errors / [getattr(m, f"{key}_error") for key in names]
    relative = errors[2] / wave.mean_speed
    print(
        f"{name:28}friction {errors[0]:+.4f} ({scaled[0]:+.1f}), push {errors[1]:+.3f} "
        f"({scaled[1]:+.1f}), speed {relative:+.2%} ({scaled[2]:+.1f}), {m.heard} heard, "
        f"{m.misfit_rms * 1e3:.2f} ms{', rejected' * m.model_rejected}, {seconds:.1f} s",
        flush=True,
    )
    return [*abs(scaled), abs(errors[0]) < FRICTION, abs(relative) < SPEED]


def random(first, last):
    """Measure random recordings; print their number within the bounds, and the coverage."""
    results = np.array([check(str(s), *random_case(s)[1:]) for s in range(first, last)])
    kept, covered = results[:, 3:].sum(0), (results[:, :3] < 1.96).sum(0)
    print(f"of {len(results)}: friction within {FRICTION}: {kept[0]:.0f}, mean speed within "
          f"{SPEED:.1%}: {kept[1]:.0f}; in the 95 % interval: friction {covered[0]}, push "
          f"{covered[1]}, mean speed {covered[2]}")  # fmt: skip


def pair(times, seconds):
    """Return the sound of two chains, the second some seconds later."""
    first, second = record(times, 50), record(times, 70)
    late = int(44100 * seconds)
    both = np.zeros(max(late + len(second), len(first)))
    both[: len(first)] += first
    both[late : late + len(second)] += second
    return both


def speech(seconds, rate=44100, seed=3):
    """Return noise in syllables."""
    rng, count = np.random.default_rng(seed), int(seconds * rate)
    syllables = np.interp(np.arange(count) / rate, np.arange(0, seconds, 0.1),
                          rng.random(len(np.arange(0, seconds, 0.1))) ** 2)  # fmt: skip
    return syllables * rng.normal(size=count) * np.sin(np.arange(count) * 14.0 / rate) ** 2


def refused():
    """Measure recordings that must be refused, ten for each of two layouts."""
    results = []
    for seed, (name, layout) in enumerate(SPRINT.items()):
        wave = random_case(seed)[1]
        times, sound = wave.arrival_times, record(wave.arrival_times, seed)
        other = SPRINT["equal" if name == "best" else "best"]
        turned = de.Layout(layout.spacing[::-1].copy(), 0.0075)
        cut = int(44100 * (0.3 + times[19]))
        noise = np.random.default_rng(seed).normal(size=132_300)
        cases = {
            "another layout": (sound, other), "noise": (noise, layout),
            # equal gaps are equal backwards
            "backwards" if name == "best" else "another pitch": (
                sound, turned if name == "best" else de.Layout.uniform(40, pitch=0.03)),
            "stopped": (record(times[:23], seed), layout), "first half": (sound[:cut], layout),
            "second half": (sound[cut:], layout), "two at once": (pair(times, 0.37), layout),
            "two in turn": (pair(times, 2.5), layout), "speech": (speech(3.0), layout),
            "hum": (np.sin(np.arange(132_300) / 50.0), layout),
        }  # fmt: skip
        for what, (samples, given) in cases.items():
            try:
                text, is_refused = de.measure(samples, 44100, given).verdict, False
            except ValueError as error:
                text, is_refused = str(error), True
            results.append(is_refused)
            print(f"{name}, {what:16}{'' if is_refused else 'NOT '}refused: {text}", flush=True)
    print(f"of {len(results)}: {sum(results)} refused")


def unusual():
    """Measure octave cases, other rates, noise, clipping, and long or uneven chains."""
    equal = de.simulate(de.Layout.uniform(60, pitch=0.0225), de.Physics(friction=0.2, push=9.0))
    doubles = {"double": 1.0, "late": (0.0124, 0.0126), "missing": 0.0, "loudness": "even"}
    softer = {"loudness": "alternating", "missing": 0.0, "double": 0.0}
    results = [
        check("every second softer", equal, record(equal.arrival_times, 1, **softer), 44100),
        check("clacks half a period late", equal, record(equal.arrival_times, 1, **doubles), 44100),
    ]
    wave = random_case(0)[1]
    sound = record(wave.arrival_times, 4)
    talk, silence = 0.5 * speech(8.0), np.random.default_rng(0).normal(0.0, 0.002, 300_000)
    fast = wave.arrival_times * (1.0 + 5e-5)
    for name, samples, rate in (
        ("96 kHz", record(wave.arrival_times, 5, rate=96000), 96000),
        ("clipping", np.clip(6.0 * sound, -1.0, 1.0), 44100),
        ("silence around", np.concatenate([silence, sound, silence]), 44100),
        ("talk around", np.concatenate([talk, sound, talk]), 44100),
        ("clock 50 ppm off", record(fast, 6), 44100),
    ):
        results.append(check(name, wave, samples, rate))
    for name in "relay", "hills", "table", "course", "marathon":
        scene, layout = de.load_scene(name), best_known()[name].layout
        wave = de.simulate(scene.row(layout), scene.physics)
        results.append(check(name, wave, record(wave.arrival_times, 7), 44100))
    kept = np.array(results)[:, 3:].all(1).sum()
    print(f"of {len(results)}: {kept} within the bounds")


if __name__ == "__main__":
    words = sys.argv[1:]
    with de.compiled():
        if words[:1] == ["random"]:
            random(int(words[1]), int(words[2]))
        for word in words:
            if word in ("refused", "unusual"):
                {"refused": refused, "unusual": unusual}[word]()
