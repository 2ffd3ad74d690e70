"""Layouts and scenes for the golden digests: odd, usual, uniform and edge cases."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

import domino_env as de
from domino_env.validation.edge_cases import edge_cases

Block = tuple[str, de.Physics, list[de.Layout]]  # kind; layouts of one length and their physics

H, D = 0.048, 0.0075  # height and thickness of the standard domino [m]


def batched(layouts: list[de.Layout], physics: de.Physics, rtol: float, **given: bool) -> Any:
    """Simulate layouts of one length as a batch."""
    uneven = any(one.rise.any() or one.tilt.any() for one in layouts)
    names = "spacing", "thickness", "height", "density", *(("rise", "tilt") if uneven else ())
    arrays = {name: np.array([getattr(one, name) for one in layouts]) for name in names}
    return de.simulate_batch(**arrays, physics=physics, rtol=rtol, **given)


def powers(rng: np.random.Generator, low: float, high: float, size: int | None = None) -> Any:
    return 10.0 ** rng.uniform(low, high, size)


def odd_layouts(rng: np.random.Generator, batch: int, friction: float | None) -> Block:
    """Return layouts in units of the first height, each quantity over many powers of ten."""
    count, layouts = int(rng.integers(1, 15)), []
    if friction is None:
        friction = float(rng.choice([0.1, 0.25, 0.5, 1.0, 2.0, 5.0, rng.uniform(0.0, 10.0)]))
    for _ in range(batch):
        heights, gaps = [1.0], []
        for _ in range(count - 1):
            gaps.append(powers(rng, -7.0, 0.05) * heights[-1])
            lowest = math.sqrt(max(heights[-1] ** 2 - gaps[-1] ** 2, 0.0)) * (1.0 + 1e-9)
            factor = rng.choice([1.0, 1.0, 1.0, 1.0001, 0.999, 1.1, 0.9, 1.5, 0.5])
            heights.append(max(factor * heights[-1], lowest))
        if rng.random() < 0.3:
            heights = [1.0] * count
        if len(set(heights)) == 1 and rng.random() < 0.5:
            gaps = gaps[:1] * (count - 1)
        thick = powers(rng, -5.0, 0.3, count)
        if rng.random() < 0.5:
            thick[:] = powers(rng, -5.0, 0.0)
        density = powers(rng, -2.0, 2.0, count) if rng.random() < 0.5 else np.ones(count)
        layouts.append(de.Layout(gaps, thick, heights, 1.0, density))
    diagonal = math.hypot(1.0, layouts[0].thickness[0])
    tipping_speed = math.sqrt(3.0 / diagonal**2 * (diagonal - 1.0))
    push = max(tipping_speed * powers(rng, -0.5, 3.5), 1e-9)
    kind = "odd rows, friction" if friction else "odd rows, no friction"
    return kind, de.Physics(friction, 1.0, push), layouts


def usual_layouts(rng: np.random.Generator, batch: int, friction: float) -> Block:
    """Return layouts that could be built: gaps and thicknesses of millimetres to centimetres."""
    count, widest = int(rng.integers(10, 100)), float(rng.choice([0.02, 0.032, 0.046]))
    layouts = [
        de.Layout(rng.uniform(0.003, widest, count - 1), rng.uniform(0.004, 0.012, count))
        for _ in range(batch)
    ]
    return "usual rows", de.Physics(friction, 9.81, float(rng.uniform(6.0, 20.0))), layouts


def equal_layouts(rng: np.random.Generator, batch: int, friction: float) -> Block:
    count = int(rng.integers(2, 150))
    layouts = [
        de.Layout.uniform(
            count, spacing=rng.uniform(0.002, 0.045), thickness=rng.uniform(0.001, 0.015)
        )
        for _ in range(batch)
    ]
    return "equal dominoes", de.Physics(friction, 9.81, float(rng.uniform(3.0, 20.0))), layouts


def blocks() -> Iterator[Block]:
    """Yield about 3000 random layouts, and the edge cases of the package."""
    rng = np.random.default_rng(15)
    for _ in range(60):
        yield odd_layouts(rng, 20, None)
        yield odd_layouts(rng, 20, 0.0)
    for i in range(24):
        yield usual_layouts(rng, 10, (0.25, 0.0, 0.6, 0.1)[i % 4])
        yield equal_layouts(rng, 10, (0.25, 0.0, 0.6, 0.1)[i % 4])
    for case in edge_cases(10_000):
        yield f"edge, {case.group}", case.physics, [case.layout]


def scene_layout(rng: np.random.Generator, scene: de.Scene) -> de.Layout:
    """Return a random layout that is feasible in a shipped scene."""
    pairs = scene.count - 1
    low, high = (0.002, 0.025) if scene.name == "gentle" else (0.002, 0.040)
    low, high = (low, high) if scene.ground is None else scene.spacing
    width = rng.choice([0.02, 0.2, 1.0])
    gaps = low + (high - low) * np.clip(rng.uniform(0, 1) + width * rng.uniform(-1, 1, pairs), 0, 1)
    thickness: Any = None
    if scene.length is not None:  # 1.2 m in all
        gaps = 1.2 / pairs - D + 0.3 * (gaps - gaps.mean())
    elif scene.stock is not None:
        thickness = rng.permutation(scene.stock.without(scene.first_thickness).dominoes)
    elif scene.name in ("sprint-thickness", "ideal", "tempo", "tempo-noise", "gentle"):
        thickness = rng.uniform(0.005, 0.012, pairs)
    elif scene.name == "magnify":
        grown = H * np.cumprod(np.append(1.0, rng.uniform(1.0, 1.2 + 0.4 * width, pairs)))
        return scene.layout(rng.uniform(0.06, 0.89, pairs) * grown[:-1], None, grown[1:])
    return scene.layout(gaps, thickness)


def random_scene(rng: np.random.Generator, name: str, count: int) -> de.Scene:
    """Return a scene of equal dominoes."""
    spacing = float(rng.uniform(0.001, 0.009)), float(rng.uniform(0.02, 0.045))
    thickness = float(rng.uniform(0.004, 0.012))
    physics = de.Physics(rng.uniform(0.0, 0.5), 9.81, rng.uniform(3.0, 20.0))
    return de.Scene(
        name=name, physics=physics, count=count, first_thickness=thickness, spacing=spacing,
        thickness=(thickness, thickness),
    )  # fmt: skip
