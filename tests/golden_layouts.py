"""Layouts and scenes for the golden digests: odd, usual, uniform, and edge cases."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

import domino_env as de

Block = tuple[str, de.Physics, list[de.Layout]]  # kind; layouts of one length and their physics

H, D = 0.048, 0.0075  # height and thickness of the standard domino [m]


def powers(rng: np.random.Generator, low: float, high: float, size: int | None = None) -> Any:
    return 10.0 ** rng.uniform(low, high, size)


def tipping_speed(thickness: float, height: float = 1.0, gravity: float = 1.0) -> float:
    """Angular velocity that just lifts the first domino over its edge [rad/s]."""
    diagonal = math.hypot(height, thickness)
    return math.sqrt(3.0 * gravity / diagonal**2 * (diagonal - height))


def odd_layouts(rng: np.random.Generator, batch: int, friction: float | None) -> Block:
    """Layouts in units of the first height, each quantity over many powers of ten."""
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
    push = max(tipping_speed(layouts[0].thickness[0]) * powers(rng, -0.5, 3.5), 1e-9)
    kind = "odd rows, friction" if friction else "odd rows, no friction"
    return kind, de.Physics(friction, 1.0, push), layouts


def usual_layouts(rng: np.random.Generator, batch: int, friction: float) -> Block:
    """Layouts that could be built: gaps and thicknesses of a few millimetres to centimetres."""
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


def layout_case(
    gaps: list[float], thickness: Any, density: Any = 1.0, *, push: float, friction: float = 0.0
) -> tuple[de.Layout, de.Physics]:
    return de.Layout(gaps, thickness, 1.0, 1.0, density), de.Physics(friction, 1.0, push)


# cases in which searches found an error above its estimate
OPTIMISTIC_CASES = {
    "ends at its tipping angle, hardly moving": layout_case(
        [1.0] * 10, 0.00036485, push=0.0004468513023334257
    ),
    "estimates 1e-7, errs by 2e-6 at 1e-3": layout_case(
        [0.1, 1e-5, 0.316227766, 1.0, 1.0, 1.0], [1.0, 0.1, *[1.0] * 5],
        [1.0, 1.0, 10.0, *[1.0] * 4], push=7.882387605032138,
    ),
    "both ends agree by chance": (
        de.Layout.uniform(40, spacing=0.030911384993333128, thickness=0.00924701313940406),
        de.Physics(0.0, push=15.0),
    ),
    "a long swing after a short one": (
        de.Layout(
            [
                0.0003998121950933414, 0.0024307203265825175, 0.00027056174440934574,
                2.981996535611405e-05, 0.040442350690182254, 7.831118266524827e-05,
            ],
            [
                0.008497527102326187, 0.00013887970175246816, 0.004195647167169866,
                0.000557115619964209, 0.012071447579553545, 0.0009131604587606111,
                7.54051973757832e-05,
            ],
        ),
        de.Physics(0.0, push=40.0),
    ),
    "a sharp corner before a long calm": layout_case(
        [7.49894209e-07, 7.49894210e-02, 1.0, 1.0], 1.0, push=7.882387605032138
    ),
    "friction of next to nothing": layout_case(
        [1.0, 0.1, 1.0, 1.0, 1.0], 1.0, push=7.882387605032138, friction=4.2840694269053945e-60
    ),
}  # fmt: skip


def edge_layouts() -> Iterator[tuple[str, de.Layout, de.Physics]]:
    """Edge cases, with and without an answer."""
    hesitant = de.Layout([0.02, 0.012, 0.004, 0.015], D)  # its tight third gap all but stops it
    least = 2.694811458008909  # [rad/s] the smallest push that topples it, with friction or without
    dips = (2.8405806906757, 2.6961598751351, 2.6948128054156, 2.6948114593563, 2.69481145801025)
    both = (0.25, 0.0)
    for friction in both:
        for push in (*dips, 2.6948114580089155, 2.694811458008909, 2.6948114580088967):
            yield "near stall", hesitant, de.Physics(friction, push=push)
        for power, sign in product((3.0, 6.0, 9.0, 12.0), (1, -1)):
            physics = de.Physics(friction, push=least * (1.0 + sign * 10.0**-power))
            yield "smallest push", hesitant, physics
    gaps = np.full(19, 0.015)
    for power in (2.0, 4.0, 6.0, 8.0):
        gaps[9] = 10.0**-power * H
        for friction in both:
            yield "near touching", de.Layout(gaps, D), de.Physics(friction, push=30.0)
        for thickness, physics in (
            (0.001 * H, de.Physics(0.1, push=1e3)), (D, de.Physics(0.0, push=1e4)),
        ):  # fmt: skip
            layout = de.Layout.uniform(20, spacing=gaps[9], thickness=thickness)
            yield "near touching", layout, physics
    wide = np.full(11, 0.015)
    for gap in (*(H * (1.0 - 10.0**-p) for p in range(2, 13, 2)), H, np.nextafter(H, 1), 2 * H):
        wide[5] = gap
        for friction in both:
            yield "out of reach", de.Layout(wide, D), de.Physics(friction)
            yield "out of reach", de.Layout.uniform(12, spacing=gap), de.Physics(friction)
    for a, friction, part in product((1e-6, 1e-4, 1e-2, 0.1, 0.3, 0.6, 1.0), both, (0.3, 0.8)):
        layout = de.Layout.uniform(20, spacing=part * H, thickness=a * H)
        yield "slenderness", layout, de.Physics(friction, push=60.0)
    for many, friction in product((10.0, 100.0, 1000.0), both):
        for start in (0, 1):
            thick = np.full(20, D / 100.0)
            thick[start::2] *= many
            layout = de.Layout(np.full(19, 0.02), thick)
            yield "unequal neighbours", layout, de.Physics(friction, push=200.0)
        layout = de.Layout(np.full(19, 0.02), D, density=np.tile([1040.0, 1040.0 * many], 10))
        yield "unequal neighbours", layout, de.Physics(friction, push=50.0)
    for friction in (0.5, 1.0, 2.0, 4.0, 6.0, 6.19, 6.2, 6.3, 8.0, 20.0, 1e3, 1e6):
        yield "friction", de.Layout.uniform(20, spacing=0.012), de.Physics(friction, push=100.0)
    jam = math.sqrt(H * H - 0.012**2) / D  # the first hit no longer drives the next domino
    for off in (-1e-3, -1e-6, -1e-9, -1e-12, 0.0, 1e-12, 1e-6):
        physics = de.Physics(jam * (1.0 + off), push=100.0)
        yield "friction", de.Layout.uniform(5, spacing=0.012), physics
    for times, friction in product((1.0 + 1e-9, 1.001, 1.5, 10.0, 100.0, 1000.0), both):
        physics = de.Physics(friction, push=times * tipping_speed(D, H, 9.81))
        yield "push", de.Layout.uniform(30, spacing=0.016), physics
    for factor in (1.05, 1.2, 1.4, 1.5, 1.53, 1.54, 1.55, 1.6, 2.0, 1 / 1.05):
        scale = factor ** np.arange(16)
        layout = de.Layout(0.6 * H * scale[:-1], D * scale, height=H * scale)
        yield "growing heights", layout, de.Physics(push=30.0)
    opening = np.linspace(0.004, 0.036, 30)
    narrow_first = np.repeat([0.005, 0.030], [12, 8])
    for gaps in (opening, narrow_first, np.tile([0.003, 0.003, 0.003, 0.034], 8)):
        for friction in (0.25, 0.6, 0.0):
            yield "flushes", de.Layout(gaps, D), de.Physics(friction, push=12.0)
    for power, sign in product((4.0, 6.0, 7.0, 8.0, 8.5, 9.0, 10.0, 12.0, 15.0), (1, -1)):
        graded = 0.005 * (1.0 + sign * 10.0**-power * np.arange(12))
        layout = de.Layout(np.concatenate([graded, np.full(8, 0.030)]), D)
        yield "flushes close together", layout, de.Physics()
    drawn = np.random.default_rng(1).uniform(0.010, 0.025, 9_999)
    for layout in (de.Layout.uniform(10_000, pitch=0.016), de.Layout(drawn, D)):
        yield "long rows", layout, de.Physics()
    layout = de.Layout([0.008, 0.021], [0.068, 0.045, D], density=[2600.0, 1000.0, 1000.0])
    yield "no rigid answer", layout, de.Physics(1.0, push=40.0)
    for layout, physics in OPTIMISTIC_CASES.values():
        yield "found by a search", layout, physics


def blocks() -> Iterator[Block]:
    """About 3000 layouts."""
    rng = np.random.default_rng(15)
    for _ in range(60):
        yield odd_layouts(rng, 20, None)
        yield odd_layouts(rng, 20, 0.0)
    for i in range(24):
        yield usual_layouts(rng, 10, (0.25, 0.0, 0.6, 0.1)[i % 4])
        yield equal_layouts(rng, 10, (0.25, 0.0, 0.6, 0.1)[i % 4])
    for kind, layout, physics in edge_layouts():
        yield kind, physics, [layout]


def scene_layout(rng: np.random.Generator, scene: de.Scene) -> de.Layout:
    """A random layout that is feasible in a shipped scene."""
    pairs = scene.count - 1
    low, high = (0.002, 0.025) if scene.name == "gentle" else (0.002, 0.040)
    low, high = (low, high) if scene.ground is None else scene.spacing
    width = rng.choice([0.02, 0.2, 1.0])
    gaps = low + (high - low) * np.clip(rng.uniform(0, 1) + width * rng.uniform(-1, 1, pairs), 0, 1)
    thickness: Any = None
    if scene.name == "course":  # 1.2 m in all
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
    """A scene of equal dominoes."""
    spacing = float(rng.uniform(0.001, 0.009)), float(rng.uniform(0.02, 0.045))
    thickness = float(rng.uniform(0.004, 0.012))
    physics = de.Physics(rng.uniform(0.0, 0.5), 9.81, rng.uniform(3.0, 20.0))
    return de.Scene(
        name=name, physics=physics, count=count, first_thickness=thickness, spacing=spacing,
        thickness=(thickness, thickness),
    )  # fmt: skip
