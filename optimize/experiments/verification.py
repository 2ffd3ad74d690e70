"""Verification of the best known layouts beside the uniform baselines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from domino_env.core.threads import allowed_threads
from domino_env.physics.layout import Layout
from domino_env.physics.wave import simulate
from domino_env.rigid.engine import simulate_in_engine
from domino_env.rigid.known import Check, Verified, digest
from domino_env.rigid.simulation import RigidWave, simulate_standing
from domino_env.rigid.verification import Verification, common_difference, last_difference
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import best_uniform_on, gain
from optimize.experiments.best_known import BestKnown

FIRST = 100  # dominoes of a long layout that are simulated
CLOSE = 2e-4  # relative tolerance of the arrival times


def verify_records(
    records: dict[str, BestKnown],
    scenes: dict[str, Scene],
    floors: Sequence[float],
    engine: bool = False,
    report: Callable[[str], object] = print,
) -> dict[str, Verified]:
    """Simulate every layout on fixed pivots and on every floor, side by side on all cores.

    Parameters
    ----------
    records
        The best known layouts, by the names of their scenes.
    scenes
        These scenes.
    floors
        Friction of each.
    engine
        Whether the third-party engine simulates the best known layouts too.
    report
        Called with a line when a layout is done.
    """
    places = (None, *floors)
    pool = ThreadPoolExecutor(allowed_threads())
    try:
        jobs = {
            (name, floor): pool.submit(_waves, scenes[name], record.layout, floor, engine)
            for name, record in records.items()
            for floor in places
        }
        found = {}
        for name, record in records.items():
            scene, waves = scenes[name], [jobs[name, floor].result() for floor in places]
            fixed = waves[0][0]
            checked = Verification(simulate(fixed.layout, scene.physics), (fixed,))
            found[name] = Verified(
                digest=digest(record.layout, scene.physics),
                count=record.layout.count,
                first=fixed.layout.count,
                verdict=checked.verdict,
                checks=tuple(check for group in waves for check in _checks(scene, group)),
            )
            report(f"{name}: {found[name].verdict}")
    finally:
        pool.shutdown(cancel_futures=True)
    return found


def first_of(layout: Layout, count: int = FIRST) -> Layout:
    """Return the first dominoes of a layout; the layout itself where it has no more."""
    if layout.count <= count:
        return layout
    return Layout(
        layout.spacing[: count - 1], layout.thickness[:count], layout.height[:count], layout.width,
        layout.density[:count], layout.rise[: count - 1], layout.tilt[:count],
    )  # fmt: skip


def _waves(scene: Scene, layout: Layout, floor: float | None, engine: bool) -> list[RigidWave]:
    """Best known and uniform on one floor, then the engine's of the best known."""
    physics, best, baseline = scene.physics, first_of(layout), first_of(scene.uniform().layout)
    chosen = best_uniform_on(scene, baseline, floor)
    # the search looked less closely
    uniform = [chosen] if chosen is baseline else [chosen, baseline]
    falls = [simulate_standing(one, physics, floor, CLOSE) for one in uniform]
    fastest = min(falls, key=lambda one: one.arrival_times[-1] / one.layout.length)
    waves = [simulate_standing(best, physics, floor, CLOSE), fastest]
    return [*waves, simulate_in_engine(best, physics, floor)] if engine else waves


def _checks(scene: Scene, waves: list[RigidWave]) -> list[Check]:
    checks = []
    for k, rigid in enumerate(waves):
        wave = simulate(rigid.layout, scene.physics)
        last, uncertainty = last_difference(wave, rigid), rigid.error_estimate
        in_speed = scene.unit == "m/s"
        if not rigid.mean_speed:
            score = f"stops after {rigid.hit} dominoes"
        elif in_speed:  # where drawn layouts count too, the speed of this one
            score = f"{rigid.mean_speed:.4f} m/s"
        else:
            seen = replace(wave, arrival_times=rigid.arrival_times)
            score = scene.in_words(scene.score(seen), seen)
        faster = gain(rigid.mean_speed, waves[1].mean_speed) if in_speed and k == 0 else None
        checks.append(Check(
            layout="uniform" if k == 1 else "best",
            simulator=rigid.simulator,
            floor=rigid.floor_friction,
            last=last if np.isfinite(last) else None,
            largest=common_difference(wave, rigid),
            uncertainty=uncertainty if np.isfinite(uncertainty) else None,
            staying_up=rigid.staying_up,
            gap=float(rigid.layout.spacing.mean()),
            score=score,
            gain=faster,
        ))  # fmt: skip
    return checks
