"""Verification of the best known layouts and of the uniform baselines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from domino_env.core.threads import allowed_threads
from domino_env.physics.layout import Layout
from domino_env.physics.wave import simulate
from domino_env.rigid.engine import simulate_in_engine
from domino_env.rigid.known import Check, StoredVerification, digest
from domino_env.rigid.simulation import RigidWave, simulate_standing
from domino_env.rigid.verification import Verification, common_difference, last_difference
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import best_uniform_on, gain
from optimize.experiments.best_known import BestKnown

LONG_COUNT = 200  # dominoes of a row from which on only the first ones are simulated
FIRST_COUNT = 100  # their number
RTOL = 2e-4  # relative tolerance of the arrival times


def verify_best_known(
    entries: dict[str, BestKnown],
    scenes: dict[str, Scene],
    floors: Sequence[float],
    engine: bool = False,
    report: Callable[[str], object] = print,
) -> dict[str, StoredVerification]:
    """Simulate best known layouts and uniform baselines on fixed pivots and floors, on all cores.

    Parameters
    ----------
    entries
        Best known layouts, by the names of their scenes.
    scenes
        These scenes, by name.
    floors
        Coulomb coefficient of each floor.
    engine
        True to simulate the best known layouts with the third-party engine too.
    report
        Function that is called with a line of text for each finished scene.

    Returns
    -------
    dict
        Verifications, by the names of the scenes.
    """
    all_floors = (None, *floors)
    pool = ThreadPoolExecutor(allowed_threads())
    try:
        jobs = {
            (name, floor): pool.submit(_simulate, scenes[name], entry.layout, floor, engine)
            for name, entry in entries.items()
            for floor in all_floors
        }
        verifications = {}
        for name, entry in entries.items():
            scene, waves = scenes[name], [jobs[name, floor].result() for floor in all_floors]
            fixed = waves[0][0]
            verification = Verification(simulate(fixed.layout, scene.physics), (fixed,))
            verifications[name] = StoredVerification(
                digest=digest(entry.layout, scene.physics), count=scene.row_count,
                first=fixed.layout.count, verdict=verification.verdict,
                checks=tuple(check for group in waves for check in _checks(scene, group)),
            )  # fmt: skip
            report(f"{name}: {verifications[name].verdict}")
    finally:
        pool.shutdown(cancel_futures=True)
    return verifications


def _shorten(layout: Layout) -> Layout:
    """Return the first `FIRST_COUNT` dominoes of a layout of `LONG_COUNT` or more."""
    if layout.count < LONG_COUNT:
        return layout
    dominoes, pairs = slice(FIRST_COUNT), slice(FIRST_COUNT - 1)
    return Layout(
        layout.spacing[pairs], layout.thickness[dominoes], layout.height[dominoes], layout.width,
        layout.density[dominoes], layout.rise[pairs], layout.tilt[dominoes],
    )  # fmt: skip


def _simulate(scene: Scene, layout: Layout, floor: float | None, engine: bool) -> list[RigidWave]:
    """Return the waves of the best known layout and of the uniform baseline on a floor.

    floor: Coulomb coefficient; None for fixed pivots. engine: if True, a third wave is that of the
    best known layout in the third-party engine.
    """
    physics, best = scene.physics, _shorten(scene.row(layout))
    baseline = _shorten(scene.uniform().layout)
    # the baseline of fixed pivots may be faster, as the search on the floor is less accurate
    layouts = {id(layout): layout for layout in (best_uniform_on(scene, baseline, floor), baseline)}
    waves = [simulate_standing(scene.row(x), physics, floor, RTOL) for x in layouts.values()]
    fastest = min(waves, key=lambda wave: wave.arrival_times[-1] / wave.layout.length)
    waves = [simulate_standing(best, physics, floor, RTOL), fastest]
    return [*waves, simulate_in_engine(best, physics, floor)] if engine else waves


def _checks(scene: Scene, waves: list[RigidWave]) -> list[Check]:
    """Return the checks of the waves of `_simulate`, in their order."""
    checks = []
    for k, rigid in enumerate(waves):
        wave = simulate(rigid.layout, scene.physics)
        last, uncertainty = last_difference(wave, rigid), rigid.error_estimate
        in_speed, error = scene.unit == "m/s", None
        if not rigid.mean_speed:
            score = f"stops after {rigid.hit} dominoes"
        elif in_speed:  # also if the score is a mean over placement errors
            score = f"{rigid.mean_speed:.4f} m/s"
        else:
            rigid_wave = replace(wave, arrival_times=rigid.arrival_times)
            placed = scene.as_placed  # the layout as simulated, without further placement errors
            number = placed.score(rigid_wave)
            score = placed.format_score(number, rigid_wave)
            if scene.tempo:
                error = float(scene.criterion.displayed(number))
        # a layout has a gain only if all of its dominoes topple
        is_compared = in_speed and k == 0 and rigid.propagated and waves[1].propagated
        own_gain = gain(rigid.mean_speed, waves[1].mean_speed) if is_compared else None
        checks.append(Check(
            layout="uniform" if k == 1 else "best", simulator=rigid.simulator,
            floor=rigid.floor_friction, last=last if np.isfinite(last) else None,
            largest=common_difference(wave, rigid),
            uncertainty=uncertainty if np.isfinite(uncertainty) else None,
            staying_up=rigid.staying_up, gap=float(rigid.layout.spacing.mean()),
            score=score, gain=own_gain, error=error,
        ))  # fmt: skip
    return checks
