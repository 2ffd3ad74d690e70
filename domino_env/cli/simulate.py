"""Simulate one layout: when each domino is hit, how fast the wave is, and how it ends.

LAYOUT is a .csv file with a header and one line per domino (spacing_mm and thickness_mm, or spacing
and thickness in metres; height and density where they differ), or a .json file.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from domino_env.cli.options import add_physics_options, chosen_physics

if TYPE_CHECKING:
    from domino_env.physics.wave import Wave
    from domino_env.rigid.simulation import RigidWave
    from domino_env.scenes.scene import Scene

SUMMARY = "simulate one layout: arrival times, speed and outcome"
CSV_NAMES = (
    "number", "position", "arrival_time", "release_velocity", "impact_velocity", "stall_margin",
)  # fmt: skip
WAVE = (
    "outcome explanation mean_speed hit toppled reach error_estimate converged flushes releases "
    "largest_flush_loss"
)
DOMINOES = "arrival_times release_velocity impact_velocity stall_margin"
STANDING = (
    "floor_friction mean_speed hit toppled error_estimate converged arrival_times slid opened "
    "opened_at"
)
MOST_LINES = 60  # of a table that is printed whole unasked
ENDS = 10  # lines at both ends of a longer one
OPEN = 1e-5  # [m] contacts that open by less are not worth a line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino simulate`."""
    parser.add_argument("layout", metavar="LAYOUT", help="layout file, .csv or .json")
    add_physics_options(parser)
    parser.add_argument(
        "--rtol", type=float, default=1e-8, help="relative error of the arrival times (1e-8)"
    )
    parser.add_argument("--csv", metavar="FILE", help="write the table in SI units")
    parser.add_argument("--json", action="store_true", help="print the result as JSON, SI units")
    parser.add_argument(
        "--all", action="store_true", help=f"print every line of more than {MOST_LINES} dominoes"
    )
    parser.add_argument(
        "--floor", type=float, metavar="FRICTION",
        help="simulate free-standing dominoes on a floor of this friction too",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Simulate, print, and write the table if chosen to."""
    import json
    from pathlib import Path

    from domino_env.core.results import document
    from domino_env.core.tables import write_csv
    from domino_env.physics.wave import simulate
    from domino_env.rigid.simulation import simulate_standing

    chosen = chosen_physics(arguments, arguments.layout)
    scene = chosen.scene
    wave = simulate(chosen.read(arguments.layout), chosen.physics, rtol=arguments.rtol)
    judged = _judged(wave, scene) if scene else {}
    if arguments.csv:
        write_csv(Path(arguments.csv), CSV_NAMES, _csv_rows(wave))
    standing = None
    if arguments.floor is not None:
        standing = simulate_standing(wave.layout, wave.physics, arguments.floor, progress=None)
    if arguments.json:
        told = document(wave, WAVE) | document(wave.physics, "friction gravity push")
        told |= document(wave.layout, "positions") | document(wave, DOMINOES)
        told |= {"physics_from": chosen.origin} | judged
        if standing:
            told["standing"] = document(standing, STANDING)
        print(json.dumps(told, indent=1, allow_nan=False))
        return 0
    print("\n".join(_table(wave, whole=arguments.all) + _verdict(wave) + [chosen.line]))
    if scene:
        print("\n".join(_judgement(judged)))
    if standing:
        print("\n".join(_standing(standing, wave)))
    if arguments.csv:
        print(f"table written to {arguments.csv}")
    return 0


def _table(wave: Wave, *, whole: bool) -> list[str]:
    """A line a domino, up to the last one that was struck; of a long row its two ends."""
    from domino_env.core.tables import text_table

    layout = wave.layout
    columns = {
        "domino": [str(i) for i in range(wave.hit)],
        "gap in front [mm]": [*(f"{1e3 * gap:.3f}" for gap in layout.spacing), ""],
        "thickness [mm]": [f"{1e3 * thick:.3f}" for thick in layout.thickness],
        "arrival [s]": [f"{t:.6f}" for t in wave.arrival_times],
        "wave speed [m/s]": ["", *(f"{speed:.4f}" for speed in wave.local_speed)],
        "hit with [rad/s]": [
            f"push {wave.physics.push:g}", *(f"{v:.3f}" for v in wave.impact_velocity)
        ],
    }  # fmt: skip
    lines = text_table([*columns], zip(*columns.values(), strict=False), right=columns)
    if not whole and wave.hit > MOST_LINES:
        left_out = f"{wave.hit - 2 * ENDS:,} lines left out: --all prints, --csv writes them"
        lines[1 + ENDS : -ENDS] = [f"   ...  {left_out}"]
    return lines


def _verdict(wave: Wave) -> list[str]:
    lines = ["", f"{wave.outcome.name}: {wave.explanation}"]
    if wave.mean_speed > 0.0:
        lines.append(
            f"mean speed {wave.mean_speed:.6f} m/s over {wave.layout.length:.4f} m, "
            f"last domino hit after {wave.arrival_times[-1]:.6f} s"
        )
    lines.append(_events(wave) + f"relative error of the times below {wave.error_estimate:.1e}")
    if not wave.converged:
        lines.append(
            f"the row is so close to a stall that rounding keeps the tolerance {wave.rtol:g} out "
            "of reach; the error estimate holds"
        )
    return lines


def _events(wave: Wave) -> str:
    """Say what else happened, where it did."""
    words = []
    if wave.flushes:
        number = "1 flush" if wave.flushes == 1 else f"{wave.flushes} flushes"
        words.append(f"{number} (largest loss of speed {wave.largest_flush_loss:.2%})")
    if wave.releases:
        words.append("1 release" if wave.releases == 1 else f"{wave.releases} releases")
    return ", ".join(words) + ("; " if words else "")


def _judged(wave: Wave, scene: Scene) -> dict[str, object]:
    """What the scene says of the wave: the rules it breaks, or its score and the mark's."""
    from domino_env.scenes.uniform import gain

    broken = scene.violations(wave.layout)
    if wave.physics != scene.physics:
        broken.append(f"friction, gravity or push differ: the scene has {scene.physics}")
    if broken:
        return {"scene": scene.name, "violations": broken}
    score, mark = scene.score(wave), scene.uniform().score
    lead = gain(score, mark)
    return {"scene": scene.name, "violations": [], "score": score, "uniform_score": mark} | (
        {} if lead is None else {"gain": lead}
    )


def _judgement(judged: dict[str, object]) -> list[str]:
    name, broken = judged["scene"], judged["violations"]
    if isinstance(broken, list) and broken:
        return [f"not a layout of scene '{name}': {sentence}" for sentence in broken]
    if "gain" in judged:
        against = f"{judged['gain']:+.2%} against the best uniform pitch"
    else:
        against = "below zero for a wave that dies; the best uniform pitch"
    return [f"score {judged['score']:.6f} on '{name}', {against} ({judged['uniform_score']:.6f})"]


def _standing(row: RigidWave, wave: Wave) -> list[str]:
    """What the same dominoes did as rigid bodies on a floor."""
    count = row.layout.count
    lines = ["", f"as rigid bodies that stand free on a floor of friction {row.floor_friction:g}:"]
    if row.mean_speed > 0.0:
        against = ""
        if wave.mean_speed > 0.0:
            against = f", {row.mean_speed / wave.mean_speed - 1.0:+.2%} against the model"
        lines.append(
            f"mean speed {row.mean_speed:.5f} m/s{against}, last domino hit after "
            f"{row.arrival_times[-1]:.5f} s"
        )
    else:
        lines.append(f"the wave ends after {row.hit} of {count} dominoes were struck")
    lines.append(
        f"{row.toppled} of {count} toppled; the foot of domino {row.slid.argmax()} slid furthest, "
        f"{row.slid.max() * 1e3:.2f} mm"
    )
    if count > 1 and row.opened.max() > OPEN:
        link = int(row.opened.argmax())
        lines.append(
            f"the contact of {link} and {link + 1} opened furthest, by {row.opened[link] * 1e3:.2f}"
            f" mm after {row.opened_at[link]:.4f} s"
        )
    lines.append(
        f"relative error of these times below {row.error_estimate:.1e}"
        + ("" if row.converged else f", though {row.rtol:g} was asked for: the row is too delicate")
    )
    return lines


def _csv_rows(wave: Wave) -> Iterator[list[float | None]]:
    """A line for each domino that was struck; an empty cell for what did not come."""
    columns = (
        wave.layout.positions, wave.arrival_times, wave.release_velocity,
        [*wave.impact_velocity, math.nan], wave.stall_margin,
    )  # fmt: skip
    for i in range(wave.hit):
        yield [i, *(float(c[i]) if math.isfinite(c[i]) else None for c in columns)]
