"""Small rows that between them walk every line of the kernels, compiled or not.

Run as a script, prints their results as JSON: with NUMBA_DISABLE_JIT=1 in plain Python, which is
also how the coverage of the kernels is measured (`make coverage`).
"""

import json
from dataclasses import replace
from unittest.mock import patch

import numpy as np

import domino_env as de
from domino_env import DominoChainVector, DominoLayout
from domino_env.physics.motion import Motion
from domino_env.scenes.stock import Stock

H = 0.048
HILLS = de.Ground(profile=[[-0.05, 0.0], [0.03, 0.001], [0.11, 0.0], [0.2, 0.0015]])


def over_hills(gaps, thickness):
    """A row over waves in the ground."""
    tilt = 0.06 * np.cos(1.0 + 0.7 * np.arange(len(gaps) + 1))
    rise = -(np.asarray(gaps) + thickness) * np.sin(0.5 * (tilt[1:] + tilt[:-1]))
    return de.Layout(gaps, thickness, rise=rise, tilt=tilt)


def results():
    """Outcome, counts and times of every case, by name."""
    rng = np.random.default_rng(7)
    found = {}

    def add(name, layout, physics, rtol=1e-7):
        wave = de.simulate(layout, physics, rtol=rtol)
        times = [float(t) for t in wave.arrival_times if np.isfinite(t)]
        counts = [wave.hit, wave.toppled, wave.flushes, wave.releases]
        found[name] = [int(wave.outcome), *counts, wave.reach, wave.largest_flush_loss, *times]

    def add_gradient(name, layout, physics, rtol=1e-7):
        wave = de.simulate(layout, physics, rtol=rtol, gradient=True)
        pulled = wave.pullback(np.isfinite(wave.arrival_times).astype(float))
        ground = () if layout.is_flat else (*pulled.rise, *pulled.tilt)
        found[f"{name}: gradient"] = [*pulled.spacing, *pulled.thickness, pulled.push, *ground]

    random = rng.uniform(0.002, 0.034, 11)
    spacing = [0.044, 0.012, 0.045, 0.030, 0.045, 0.002, 0.046, 0.020]
    for friction in (0.0, 0.3):
        name = f"friction {friction}"
        physics = de.Physics(friction, 9.81, 12.0)
        add(f"{name}: random", de.Layout(random, 0.0075), physics)
        add_gradient(f"{name}: random", de.Layout(random, 0.0075), physics)
        add(f"{name}: tight tolerance", de.Layout(random[:5], 0.0075), physics, 1e-13)
        add(f"{name}: uniform", de.Layout.uniform(12, pitch=0.03), physics, 1e-4)
        add(f"{name}: uniform, dies", de.Layout.uniform(8, spacing=0.002), de.Physics(friction))
        add_gradient(f"{name}: uniform", de.Layout.uniform(12, pitch=0.03), physics)
        add_gradient(
            f"{name}: falls share a stack", de.Layout.uniform(40, pitch=0.03), physics, 1e-3
        )
        push = de.Physics(friction, 9.81, 24.0)
        add_gradient(f"{name}: releases", de.Layout(spacing, 0.0075), push)
        add(f"{name}: releases", de.Layout(spacing, 0.0075), push)
        runs = np.r_[np.full(4, 0.005), np.full(3, 0.02)]
        add(f"{name}: flush together", de.Layout(runs, 0.0075), push)
        add(f"{name}: out of reach", de.Layout([0.02, 0.05, 0.02], 0.0075), physics)
        near = de.Layout([0.01, H * (1 - 1e-7), 0.02], 0.0075)
        add(f"{name}: nearly out of reach", near, push)
        row = de.Layout(rng.uniform(0.004, 0.012, 7), 0.0075)
        least = de.smallest_push(row, physics, rtol=1e-9)
        found[f"{name}: smallest push"] = [least]
        for excess in (-1e-6, 1e-9, 1e-4):
            push = de.Physics(friction, 9.81, least * (1.0 + excess))
            add(f"{name}: {excess} from a stall", row, push)
            add_gradient(f"{name}: {excess} from a stall", row, push)
        steady = de.steady_wave([0.02, 0.03], 0.0075, physics=physics, rtol=1e-5)
        found[f"{name}: steady"] = [steady.speed, *steady.omega_release]
        for kind, row in (
            ("flushes", over_hills(random[:9] + 0.008, 0.0075)),
            ("releases", over_hills(spacing, 0.0075)),
        ):
            add(f"{name}: hills, {kind}", row, push)
            add_gradient(f"{name}: hills, {kind}", row, push)
        slope = de.Layout.uniform(12, pitch=0.03, slope=0.05)
        add(f"{name}: slope", slope, physics, 1e-4)
        add(f"{name}: slope, tight tolerance", slope, physics, 1e-13)
        add_gradient(f"{name}: slope", slope, physics, 1e-4)
        found[f"{name}: push over hills"] = [de.smallest_push(row, physics, rtol=1e-9)]
        seen = de.diagnose(row, push)
        found[f"{name}: diagnosis over hills"] = [float(np.nanmin(seen.least_load))]
    thick = [0.0075, 0.0075, 0.05, 0.05, 0.0075]
    add("jams", de.Layout(np.full(4, 0.02), thick), de.Physics(1.0))
    flush = de.Layout(
        [0.00312, 0.03171, 0.00059],
        [0.00761, 0.00966, 0.04176, 0.00073],
        density=[1953.55, 45.87, 2085.53, 1.096],
    )
    add("jams in a flush", flush, de.Physics(1.095, 9.81, 4.54))
    heavy = de.Layout(
        [0.00078, 0.0021, 0.00753, 0.00185],
        [0.05316, 0.00037, 0.08296, 0.01271, 0.03667],
        density=[492.9, 1.765, 3.108, 7835.0, 1.913],
    )
    add("no rigid answer", heavy, de.Physics(0.48656, 9.81, 80.93))
    large = de.Layout(2.0 ** np.arange(-6, -1), 2.0 ** np.arange(-7, -1), 2.0 ** np.arange(-3, 3))
    add("growing", large, de.Physics(0.1, 9.81, 20.0))
    for name, layout, push in (
        ("stall", de.Layout.uniform(5, spacing=0.003), 4.0),
        ("runs through", de.Layout(random, 0.0075), 12.0),
    ):
        motion = Motion(layout, de.Physics(0.25, 9.81, push))
        found[f"motion: {name}"] = [motion.end, *motion.angles([0.5 * motion.end])[0]]
    for name, layout, push in (
        ("flushes", de.Layout(random, 0.0075), 12.0),
        ("stall", de.Layout.uniform(5, spacing=0.003), 4.0),
        ("out of reach", de.Layout([0.02, 0.05], 0.0075), 8.0),
    ):
        seen = de.diagnose(layout, de.Physics(0.25, 9.81, push))
        found[f"diagnosis: {name}"] = [float(np.nanmin(seen.least_load)), len(seen.opened)]
    near = np.linspace(0.006, 0.03, 8)
    add("every link goes flush", de.Layout(near, 0.0075), de.Physics(0.25, 9.81, 12.0), 1e-3)
    add("hardly moves", de.Layout.uniform(4, spacing=0.001), de.Physics(0.25, 9.81, 2.7))
    batch = de.simulate_batch(
        np.stack([random, random[::-1]]), np.full(12, 0.0075), de.Physics(), record=False
    )
    found["batch"] = [float(t) for t in batch.mean_speed]
    batch = de.simulate_batch(
        np.stack([random, 0.0 * random + 0.003]), 0.0075, de.Physics(), gradient=True
    )
    found["batch: gradient"] = [float(x) for x in batch.gradient.spacing.ravel()]
    gaps = np.stack([0.01 + 0.5 * random[:5], 0.02 - 0.3 * random[:5]])
    slopes = scenes()["hills"].score_batch_gradient(gaps, 0.0 * gaps + 0.0075)
    found["hills: gradient"] = np.concatenate(slopes[1:3]).ravel().tolist()
    found |= {f"environment: {name}": episodes(scene) for name, scene in scenes().items()}
    return found


def scenes():
    """Short scenes with all that the environment has rules for."""
    gentle = replace(de.load_scene("gentle"), count=6)
    box = Stock((0.005, 0.0075, 0.01), (2, 3, 3))
    return {
        "gentle": gentle,
        "reach": replace(gentle, spacing=(0.04, 0.05)),
        "course": replace(gentle, length=0.1, spacing=(0.008, 0.02)),
        "box": replace(gentle, stock=box, thickness=(0.005, 0.01), largest_change=0.004,
                       spacing_values=(0.002, 0.008, 0.011, 0.0135, 0.0175)),
        "hills": replace(gentle, ground=HILLS),
        "growing": replace(de.load_scene("magnify"), count=6, in_heights=True),
    }  # fmt: skip


def episodes(scene):
    """Rewards and observations of a few short episodes, two at a time."""
    tall = scene.height if scene.growth is None else scene.height * 1.1 ** np.arange(1, 6)
    least = tall if scene.in_heights else 1.0
    layout = scene.layout(sum(scene.spacing) / 2 * least, scene.thickness[0] * least, tall)
    wave = scene.simulate(layout)
    mark = de.UniformMark(layout, wave, scene.score_wave(wave))
    with patch.object(de.Scene, "uniform", lambda scene: mark):  # the search would take long
        env = DominoChainVector(2, scene, window=3, rtol=1e-7)
        whole = DominoLayout(scene)
    rng = np.random.default_rng(3)
    whole.reset()
    found = [whole.step(rng.uniform(-1.0, 1.0, whole.action_space.shape))[1]]
    start = None
    if not scene.in_heights:
        row = [0.0175 if scene.spacing_values else scene.spacing[1] * 0.8], 0.0075
        start = de.Layout(*row) if scene.ground is None else scene.ground.layout(*row)
    env.reset(options={"layout": [start, None]})
    for _ in range(14):
        seen, rewards, ended, *_ = env.step(rng.uniform(-1.5, 1.5, env.action_space.shape))
        found += [*env.bounds_ahead(0)["spacing"], *env.bounds_ahead(1)["thickness"]]
        found += [*seen.ravel().tolist(), *rewards.tolist(), *ended.tolist()]
    return found


if __name__ == "__main__":
    print(json.dumps(results()))
