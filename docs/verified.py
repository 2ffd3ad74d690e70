"""Write verified.csv and verified-random.csv: ``python docs/verified.py``.

Verifies twenty-four random layouts on fixed pivots and writes them into a table, beside that of the
stored verifications of the best known layouts. ``--stored`` leaves the random layouts as they are.
``--best`` verifies the best known layouts anew, those of some scenes or of all, and stores the
results in the package; ``--engine`` adds the third-party engine (extra 'verify', minutes for each
layout).
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.tables import csv_table, write_csv
from domino_env.core.threads import allowed_threads
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, simulate
from domino_env.rigid import known
from domino_env.rigid.engine import engine_name, simulate_in_engine
from domino_env.rigid.known import Check, StoredVerification, not_toppled
from domino_env.rigid.simulation import RigidWave, floor_name, simulate_standing
from domino_env.rigid.verification import (
    FLOORS,
    Verification,
    common_difference,
    last_difference,
    verify,
)
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import best_uniform_on
from optimize.experiments.best_known import best_known

SEED, LAYOUTS = 18, 6
SCENES = ("sprint", "ideal", "gentle", "sprint-thickness")
RANDOM_RTOL = 1e-4  # relative tolerance of the arrival times
KNOWN = Path(__file__).with_suffix(".csv")
RANDOM = KNOWN.with_name("verified-random.csv")
RANDOM_COLUMNS = (
    "scene", "number", "last hit over model", "largest of any hit", "uncertainty", "verdict",
    "reason",
)  # fmt: skip
LONG_COUNT = 200  # dominoes of a row from which on only the first ones are simulated
FIRST_COUNT = 100  # their number
RTOL = 2e-4  # relative tolerance of the arrival times
COLUMNS = (
    "scene", "dominoes simulated", "of", "on", "best known", "uniform baseline", "gain",
    "last hit over model", "uncertainty", "engine over reference",
)  # fmt: skip


def random_layouts(scene: Scene, rng: np.random.Generator) -> Iterator[Layout]:
    """Yield random layouts within a scene's bounds whose waves complete."""
    while True:
        thickness = rng.uniform(*scene.thickness, scene.count)
        thickness[0] = scene.first_thickness
        spacing = rng.uniform(*scene.spacing, scene.count - 1)
        layout = Layout(spacing, thickness, scene.height, scene.width, scene.density)
        if simulate(layout, scene.physics).outcome == Outcome.PROPAGATED:
            yield layout


def random_verifications() -> dict[tuple[str, int], Verification]:
    """Verify random layouts of `SCENES`, `LAYOUTS` of each, on fixed pivots and all cores."""
    with ThreadPoolExecutor(allowed_threads()) as pool:
        jobs = {}
        for scene in map(load_scene, SCENES):
            layouts = random_layouts(scene, np.random.default_rng(SEED))
            for k in range(LAYOUTS):
                job = pool.submit(verify, next(layouts), scene.physics, floors=(), rtol=RANDOM_RTOL)
                jobs[scene.name, k + 1] = job
        return {name: job.result() for name, job in jobs.items()}


def random_lines(verifications: dict[tuple[str, int], Verification]) -> list[tuple[object, ...]]:
    """Return the lines of `RANDOM_COLUMNS`: differences from the model and their reasons."""
    lines: list[tuple[object, ...]] = []
    for layout, verification in verifications.items():
        word, _, rest = verification.verdict.partition(":")
        reason = rest.partition("Why: ")[2].rstrip(".")
        lines.append((
            *layout, percent(verification.difference), percent(verification.largest_difference),
            percent(verification.fixed.error_estimate, sign=""), word.lower(), reason,
        ))  # fmt: skip
    return lines


def verify_best_known(names: list[str], engine: bool = False) -> dict[str, StoredVerification]:
    """Simulate best known layouts and uniform baselines on fixed pivots and floors, on all cores.

    Parameters
    ----------
    names
        Names of their scenes.
    engine
        True to simulate the best known layouts with the third-party engine too.

    Returns
    -------
    dict
        Verifications, by the names of the scenes.
    """
    entries = {name: best_known()[name] for name in names}
    scenes = {name: load_scene(name) for name in names}
    all_floors = (None, *FLOORS)
    with ThreadPoolExecutor(allowed_threads()) as pool:
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
                digest=known.digest(entry.layout, scene.physics), count=scene.row_count,
                first=fixed.layout.count, verdict=verification.verdict,
                checks=tuple(check for group in waves for check in _checks(scene, group)),
            )  # fmt: skip
            print(f"{name}: {verifications[name].verdict}", flush=True)
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
        in_speed, error = scene.criterion.is_mean_speed, None
        if not rigid.mean_speed:
            score = f"stops after {rigid.hit} dominoes"
        elif in_speed:  # also if the score is a mean over placement errors
            score = f"{rigid.mean_speed:.4f} m/s"
        else:
            arrivals = wave.arrivals.copy()
            arrivals["time"] = rigid.arrival_times
            rigid_wave = replace(wave, arrivals=arrivals)
            placed = scene.as_placed  # the layout as simulated, without further placement errors
            number = placed.score(rigid_wave)
            score = placed.format_score(number, rigid_wave)
            if scene.tempo:
                error = float(scene.criterion.displayed(number))
        # a layout has a gain only if all of its dominoes topple
        is_compared = in_speed and k == 0 and rigid.propagated and waves[1].propagated
        own_gain = rigid.mean_speed / waves[1].mean_speed - 1.0 if is_compared else None
        checks.append(Check(
            layout="uniform" if k == 1 else "best", simulator=rigid.simulator,
            floor=rigid.floor_friction, last=last if np.isfinite(last) else None,
            largest=common_difference(wave, rigid),
            uncertainty=uncertainty if np.isfinite(uncertainty) else None,
            staying_up=rigid.staying_up, score=score, gain=own_gain, error=error,
        ))  # fmt: skip
    return checks


def known_table(verified_by_scene: dict[str, StoredVerification]) -> str:
    """Return a table of best known layouts and baselines on every floor as CSV."""
    lines = []
    for name, verified in verified_by_scene.items():
        for best in verified.floors:
            on_floor = [check for check in verified.checks if check.floor == best.floor]
            uniform = next(check for check in on_floor if check.layout == "uniform")
            engine = next((check for check in on_floor if check.simulator != best.simulator), None)
            lines.append((
                name, verified.first, verified.count, floor_name(best.floor), _score(best),
                _score(uniform), "" if best.gain is None else f"{best.gain:+.2%}",
                percent(best.last),
                percent(best.uncertainty, sign=""), _difference(best, engine),
            ))  # fmt: skip
    return csv_table(COLUMNS, lines)


def _score(check: Check) -> str:
    """Return the score, with the number of dominoes that do not topple."""
    return check.score + (f" ({not_toppled(check.staying_up)})" if check.staying_up else "")


def _difference(reference: Check, engine: Check | None) -> str:
    """Return the difference of the engine from the reference simulator at the last hit."""
    if engine is None or engine.last is None or reference.last is None:
        return ""
    difference = (1.0 + engine.last) / (1.0 + reference.last) - 1.0
    if engine.uncertainty is None or reference.uncertainty is None:
        return f"{difference:+.3%} (not converged)"
    return f"{difference:+.3%} ± {engine.uncertainty + reference.uncertainty:.2%}"


def percent(value: float | None, sign: str = "+") -> str:
    """Return a fraction in per cent; nothing for None."""
    return "" if value is None else f"{value:{sign}.3%}"


def store(verifications: dict[str, StoredVerification]) -> None:
    """Write verifications beside the stored ones, in the order of the scenes' names."""
    stored = known.read_verified() | verifications
    document = {name: asdict(stored[name]) for name in sorted(stored)}
    write_text(known.PATH, json.dumps(document, indent=1, allow_nan=False) + "\n")


def main() -> None:
    """Simulate the layouts and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stored", action="store_true", help="write the stored verifications only")
    scenes = "verify the best known layouts of these scenes (all) and store the results"
    parser.add_argument("--best", nargs="*", choices=best_known(), metavar="SCENE", help=scenes)
    parser.add_argument("--engine", action="store_true", help="use the third-party engine too")
    arguments = parser.parse_args()
    if arguments.best is not None:
        if arguments.engine:
            engine_name()  # raises at once if the engine is not installed
        store(verify_best_known(arguments.best or list(best_known()), arguments.engine))
    write_text(KNOWN, known_table(known.read_verified()))
    if not arguments.stored and arguments.best is None:
        write_csv(RANDOM, RANDOM_COLUMNS, random_lines(random_verifications()))


if __name__ == "__main__":
    main()
