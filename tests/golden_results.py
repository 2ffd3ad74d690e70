"""Groups of golden digests: results, computed with public names only."""

from __future__ import annotations

import hashlib
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from golden_layouts import Block, H, batched, blocks, random_scene, scene_layout

import domino_env as de

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-12)
EPISODES = 10


class Digests:
    """Digests by name; results of the same name go into the same digest, in order."""

    def __init__(self) -> None:
        self._open: defaultdict[str, Any] = defaultdict(hashlib.sha256)

    def add(self, name: str, *values: object) -> None:
        """Add results to the digest of that name: numbers, arrays, containers of them."""
        for value in values:
            self._feed(self._open[name], value)

    def _feed(self, digest: Any, value: Any) -> None:
        if isinstance(value, dict):
            for key in sorted(value):
                digest.update(key.encode())
                self._feed(digest, value[key])
        elif isinstance(value, list | tuple) or getattr(value, "dtype", None) is np.dtype(object):
            digest.update(f"{len(value)} of:".encode())
            for part in value:
                self._feed(digest, part)
        elif value is None:
            digest.update(b"none")
        else:
            # other types raise; a nan has many bit patterns and one meaning
            array = np.array(value).astype(np.float64, casting="same_kind")
            array[np.isnan(array)] = np.nan
            digest.update(f"{array.shape}".encode() + array.tobytes())

    def finished(self) -> dict[str, str]:
        """Return all digests, as 16 hexadecimal digits each."""
        return {name: digest.hexdigest()[:16] for name, digest in self._open.items()}


# fields of each kind of result ------------------------------------------------------------------

WAVE = (
    "outcome", "hit", "toppled", "reach", "arrival_times", "release_velocity", "impact_velocity",
    "stall_margin", "error_estimate", "converged", "flushes", "releases", "largest_flush_loss",
    "mean_speed",
)  # fmt: skip
BATCH = (*WAVE, "total_time", "lowest_stall_margin")
GRADIENT = ("spacing", "thickness", "height", "density", "friction", "gravity", "push")
LAYOUT = ("spacing", "thickness", "height", "density", "width")
STEADY = ("exists", "speed", "frequency", "omega_release", "omega_impact", "fall_times")
DIAGNOSIS = (
    "outcome", "least_contact_force", "least_hit_impulse", "least_flush_impulse", "floor_friction",
    "least_load", "flush_loss", "stall_margin",
)  # fmt: skip


def select(result: object, names: tuple[str, ...]) -> list[Any]:
    """Return the named fields of a result."""
    return [getattr(result, name) for name in names]


# groups -------------------------------------------------------------------------------------------


def waves(digests: Digests) -> None:
    """Single simulations, at four tolerances."""
    for kind, physics, layouts in blocks():
        for rtol, layout in product(TOLERANCES, layouts):
            wave = de.simulate(layout, physics, rtol=rtol)
            digests.add(f"{rtol:g}, {kind}", *select(wave, WAVE))


def batches(digests: Digests) -> None:
    """Batches of the same layouts, with and without records."""
    for (kind, physics, layouts), rtol in product(blocks(), TOLERANCES):
        for record, words in ((True, ""), (False, ", no record")):
            batch = batched(layouts, physics, rtol, record=record)
            digests.add(f"{rtol:g}, {kind}{words}", *select(batch, BATCH))


def gradients(digests: Digests) -> None:
    """Gradients of every edge case and of a third of the others, single and in batches."""
    rng = np.random.default_rng(16)
    for i, (kind, physics, layouts) in enumerate(blocks()):
        if len(layouts) > 1 and i % 3:
            continue
        for rtol in (1e-5, 1e-9):
            for layout in layouts:
                wave = de.simulate(layout, physics, rtol=rtol, gradient=True)
                bar = rng.standard_normal(layout.count)
                bar[~np.isfinite(wave.arrival_times)] = 0.0
                pulled = select(wave.pullback(bar), GRADIENT)
                digests.add(f"{rtol:g}, {kind}", *select(wave, WAVE), pulled)
                if layout.count > 1 and wave.outcome == de.Outcome.PROPAGATED:
                    for of in ("time", "speed"):
                        digests.add(f"{rtol:g}, {kind}, {of}", select(wave.gradient(of), GRADIENT))
            batch = batched(layouts, physics, rtol, gradient=True)
            pulled = select(batch.gradient, GRADIENT)
            digests.add(f"{rtol:g}, {kind}, batch", select(batch, BATCH), pulled)


def few_blocks(each: int) -> Iterator[Block]:
    """Yield every block with layouts of at most 150 dominoes, of at most `each` layouts."""
    for kind, physics, layouts in blocks():
        if layouts[0].count <= 150:
            yield kind, physics, layouts[:each]


def steady(digests: Digests) -> None:
    """Steady waves of equal dominoes and of patterns, and closed forms."""
    rng = np.random.default_rng(17)
    for i in range(300):
        physics = de.Physics(0.0 if i % 3 == 0 else float(rng.uniform(0.0, 0.8)))
        thick = float(rng.uniform(0.0005, 0.02))
        pitch = thick + float(rng.uniform(0.0005, 0.05))
        kind = "no friction" if i % 3 == 0 else "friction"
        digests.add(f"equal, {kind}", select(de.steady_wave(pitch, thick, H, physics), STEADY))
        if thick < 0.9 * pitch:
            digests.add("limits", de.existence_limit(thick, H))
            try:
                digests.add("limits", de.speed_estimate(pitch, thick, H, physics))
            except ValueError:
                digests.add("limits", None)
        period = int(rng.integers(2, 9))
        thicks, gaps = rng.uniform(0.003, 0.012, period), rng.uniform(0.008, 0.032, period)
        density = rng.uniform(500.0, 2000.0, period)
        wave = de.steady_pattern(gaps + np.roll(thicks, -1), thicks, H, physics, density=density)
        digests.add(f"pattern, {kind}", select(wave, STEADY))


def pushes(digests: Digests) -> None:
    """Smallest pushes."""
    for kind, physics, layouts in few_blocks(5):
        for layout in layouts:
            digests.add(kind, de.smallest_push(layout, physics))


def weak_places(diagnosis: de.Diagnosis) -> list[Any]:
    """Return the indices of contacts that would separate, and of pivots that would lift off."""
    impulse = np.fmin(diagnosis.least_hit_impulse, diagnosis.least_flush_impulse)
    least = np.fmin(diagnosis.least_contact_force, impulse)
    opened = np.flatnonzero(least < -1e-9 * np.nanmax(np.abs(least), initial=0.0))
    return [opened, np.flatnonzero(diagnosis.least_load < 0.0)]


def diagnoses(digests: Digests) -> None:
    """Forces between dominoes."""
    for kind, physics, layouts in few_blocks(3):
        for layout in layouts:
            diagnosis = de.diagnose(layout, physics)
            digests.add(kind, [*select(diagnosis, DIAGNOSIS), *weak_places(diagnosis)])


def motions(digests: Digests) -> None:
    """Angles of all dominoes over time."""
    for kind, physics, layouts in few_blocks(1):
        moving = de.Motion(layouts[0], physics)
        times = np.linspace(0.0, 1.1 * moving.end, 60)
        digests.add(kind, moving.end, moving.leader(times), moving.angles(times))


def info_results(info: dict[str, Any]) -> dict[str, Any]:
    """Return the results in an info, of a single environment or of several."""
    numbers: dict[str, Any] = {}
    for key, value in info.items():
        if key == "final_info":
            numbers[key] = info_results(value)
        elif names := {"layout": LAYOUT, "wave": WAVE}.get(key):
            results = value if isinstance(value, np.ndarray) else [value]
            numbers[key] = [None if one is None else select(one, names) for one in results]
        elif key.lstrip("_") in ("score", "gain", "outcome", "final_obs") or key[:1] == "_":
            numbers[key] = value
    return numbers


def random_actions(seed: int, layouts: int, size: int) -> Iterator[Any]:
    """Yield actions, for every environment about its own middle and with its own spread."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-0.9, 0.6, (layouts, size))
    spread = rng.choice([0.05, 0.3, 1.2], (layouts, 1))
    while True:
        yield (middle + spread * rng.uniform(-1.0, 1.0, middle.shape)).astype(np.float32)


def episodes(digests: Digests) -> None:
    """Ten random episodes of every scene in a vector environment, with every autoreset mode."""
    for scene, mode in product(de.scene_names(), ("NextStep", "SameStep", "Disabled")):
        env = de.DominoChainVector(EPISODES, scene, autoreset_mode=mode)
        actions = random_actions(20, EPISODES, env.single_action_space.shape[0])  # type: ignore[index]
        name = f"{scene}, vector, {mode}"
        digests.add(name, env.reset(seed=0)[0])
        for _ in range(de.load_scene(scene).count + 5):
            observation, rewards, ended, cut, infos = env.step(next(actions))
            digests.add(name, observation, rewards, ended, cut)
            digests.add(f"{name}, info", info_results(infos))
            if mode == "Disabled" and ended.any():
                digests.add(name, env.reset(options={"reset_mask": ended})[0])


def scores(digests: Digests) -> None:
    """Scores of random layouts."""
    for name in de.scene_names():
        scene, rng = de.load_scene(name), np.random.default_rng(18)
        for _ in range(20):
            digests.add(name, scene.score(scene_layout(rng, scene)))


def uniform(digests: Digests) -> None:
    """The uniform baseline of every scene."""
    for name in de.scene_names():
        baseline = de.load_scene(name).uniform()
        layout, wave = select(baseline.layout, LAYOUT), select(baseline.wave, WAVE)
        digests.add(name, baseline.score, layout, wave)


BY_DEFAULT = {"sprint": 150, "course": 100}  # evaluations on each scene
SEARCHED = {
    "auto": {"sprint": 600, "course": 600, "stock": 300, "tempo": 150, "magnify": 150},
    "gauss-newton": {"tempo": 60},
    "assign": {"stock": 300},
}


def searches(digests: Digests) -> None:
    """Short searches with every method."""
    from optimize import METHODS, search

    for method in METHODS:
        for scene, budget in SEARCHED.get(method, BY_DEFAULT).items():
            result = search(scene, method=method, budget=budget, seed=0, progress=False)
            name = f"{method}, {scene}"
            digests.add(name, select(result.layout, LAYOUT), result.score, result.evaluations)


def designs(digests: Digests) -> None:
    """Layouts designed for fifty scenes."""
    from agents import design

    rng = np.random.default_rng(19)
    for i in range(50):
        scene = random_scene(rng, f"drawn-{i}", int(rng.integers(15, 81)))
        name = f"scenes {i - i % 5} to {i - i % 5 + 4}"
        for tries in (13, 1):
            result = design(scene, tries=tries)
            layout, wave = select(result.layout, LAYOUT), select(result.wave, WAVE)
            digests.add(name, layout, result.score, wave)


TRAINED = {"apg": 3_000, "ppo": 7_000, "ars": 4_000}  # steps


def tensors(state: Any) -> Iterator[Any]:
    """Yield all real tensors in nested containers."""
    if hasattr(state, "detach"):
        if state.is_floating_point():
            yield state.detach().numpy()
    elif isinstance(state, dict | list | tuple):
        for one in state.values() if isinstance(state, dict) else state:
            yield from tensors(one)


def trainings(digests: Digests) -> None:
    """Tiny trainings: the best policy, its layout, and the last state of the learner."""
    import torch

    from agents import train

    with tempfile.TemporaryDirectory() as folder:
        scene = random_scene(np.random.default_rng(20), "small", 9)
        for algorithm, steps in TRAINED.items():
            folder_of = Path(folder) / algorithm
            run = train(scene, algorithm, steps=steps, seed=0, folder=folder_of)
            digests.add(f"{algorithm}, row", select(run.rollout.layout, LAYOUT), run.rollout.score)
            with np.load(folder_of / "policy.npz") as weights:
                digests.add(f"{algorithm}, best weights", dict(weights))
            state = torch.load(folder_of / "checkpoint.pt", weights_only=True)
            # by content, so that other names for the same tensors make no difference
            words = sorted(hashlib.sha256(t.tobytes()).hexdigest() for t in tensors(state))
            numbers = [[int(word[i : i + 8], 16) for i in range(0, 64, 8)] for word in words]
            digests.add(f"{algorithm}, last state", numbers)


GROUPS: dict[str, Callable[[Digests], None]] = {
    group.__name__: group
    for group in (
        waves, batches, gradients, steady, pushes, diagnoses, motions, episodes, scores, uniform,
        searches, designs, trainings,
    )
}  # fmt: skip
