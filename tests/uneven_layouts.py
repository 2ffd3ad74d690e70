"""Layouts and a scene on uneven ground."""

import numpy as np

import domino_env as de

POINTS = [[-0.1, 0.002], [0.05, 0.0], [0.12, 0.006], [0.2, 0.001], [0.28, 0.008], [0.36, 0.003]]
UNEVEN_SCENE = de.Scene(
    count=9, spacing=(0.008, 0.03), thickness=(0.007, 0.012), first_thickness=0.008,
    physics=de.Physics(push=14.0), ground=de.Ground(profile=POINTS),
)  # fmt: skip


def uneven_layout(seed: int, count: int, unequal: bool = False) -> de.Layout:
    """Return a layout over crests, hollows and small steps, with thin dominoes for odd seeds."""
    rng = np.random.default_rng(seed)
    while True:
        thick = rng.uniform(*((0.006, 0.011) if seed % 2 else (0.003, 0.01)), count)
        height = np.sort(rng.uniform(0.046, 0.05, count)) if unequal else np.full(count, 0.048)
        density = rng.uniform(500.0, 2000.0, count) if unequal else np.full(count, 1040.0)
        tilt = np.cumsum(rng.uniform(-0.05, 0.05, count))
        tilt = np.clip(tilt, -0.9 * thick / height, 0.9 * thick / height)
        gaps = rng.uniform(0.006, 0.04, count - 1)
        rise = -(gaps + thick[1:]) * np.sin(0.5 * (tilt[1:] + tilt[:-1]))
        rise += rng.uniform(-0.0005, 0.002, count - 1)
        try:
            return de.Layout(gaps, thick, height, density=density, rise=rise, tilt=tilt)
        except ValueError:
            continue
