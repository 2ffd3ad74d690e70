"""Verify layouts by simulators that keep no contact closed: on fixed pivots, and free-standing.

The reference simulator that comes with the package takes a second or so. Where the extra 'verify'
(pymunk) is installed a third-party rigid-body engine simulates them too, with ever more sweeps of
its solver and ever smaller steps until its arrival times converge, or it says that they did not:
seconds to minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from domino_env.cli.physics_options import add_physics_options, asked_physics

if TYPE_CHECKING:
    from domino_env.rigid.verification import Verification
    from domino_env.scenes.scene import Scene

SUMMARY = "the same layout by a reference simulator and a third-party engine"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino verify`."""
    parser.add_argument("layouts", metavar="LAYOUT", nargs="+", help="a .csv or .json file")
    add_physics_options(parser, "a scene's physics, by name or .toml file")
    add_simulator_options(parser, default=None, told="where pymunk is installed")
    parser.add_argument(
        "--json", metavar="FILE", help="write the times (one layout only), for domino report"
    )
    parser.add_argument("--plot", metavar="FILE", help="draw the differences (PNG)")


def add_simulator_options(parser: argparse.ArgumentParser, default: bool | None, told: str) -> None:
    """Add --floor and --engine."""
    parser.add_argument(
        "--floor",
        type=floors_of,
        default="0.3,0.5,1",
        metavar="MU,...",
        help="friction of the floors to stand on, 'free' for 1 (0.3,0.5,1)",
    )
    parser.add_argument(
        "--engine",
        action=argparse.BooleanOptionalAction,
        default=default,
        help=f"simulate in the third-party engine too ({told})",
    )


def floors_of(text: str) -> tuple[float, ...]:
    """Read '0.3,0.5,1'; 'free' is a floor of friction 1."""
    try:
        return tuple(1.0 if word == "free" else float(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"'{text}': give coefficients of friction with commas between, as in 0.3,0.5,1"
        ) from None


def run(arguments: argparse.Namespace) -> int:
    """Verify each layout; 1 if any differs by more than 0.3 per cent, or topples in one only."""
    import sys
    from importlib.util import find_spec
    from pathlib import Path

    from domino_env.rigid import verification

    if len(arguments.layouts) > 1 and (arguments.json or arguments.plot):
        raise ValueError("--json and --plot name one file: give one layout with them")
    engine = arguments.engine
    if engine is None:
        engine = find_spec("pymunk") is not None

    def progress(line: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\x1b[Kengine: {line}", end="", file=sys.stderr, flush=True)

    differs = False
    for name in arguments.layouts:
        asked = asked_physics(arguments, name)
        layout = asked.read(name)
        print(f"{name}\n{asked.line}", flush=True)
        checked = verification.verify(
            layout, asked.physics, floors=arguments.floor, engine=engine, progress=progress
        )
        print("\n".join(verification.verification_table(checked)))
        if asked.scene is not None:
            print("\n".join(_beside_uniform(asked.scene, checked)), flush=True)
        differs |= any(verdict.startswith("DIFFERS") for verdict in checked.verdicts)
        if arguments.json:
            verification.write_verification(checked, Path(arguments.json))
        if arguments.plot:
            verification.write_plot(checked, Path(arguments.plot), Path(name).stem)
    if not engine and arguments.engine is None:
        print("(for a third-party engine besides: pip install 'domino-chains[verify]')")
    return 1 if differs else 0


def _beside_uniform(scene: Scene, checked: Verification) -> Iterator[str]:
    """Yield how much faster the layout is than the best uniform one on the same floor."""
    from domino_env.rigid.simulation import floor_name, simulate_standing
    from domino_env.scenes.uniform import best_uniform_on

    baseline, physics = scene.uniform().layout, checked.wave.physics
    if scene.unit != "m/s" or scene.violations(checked.wave.layout) or physics != scene.physics:
        return
    for rigid in checked.reference:
        floor = rigid.floor_friction
        uniform = simulate_standing(best_uniform_on(scene, baseline, floor), physics, floor)
        speeds = rigid.mean_speed, uniform.mean_speed
        lead = f"{speeds[0] / speeds[1] - 1.0:+.2%}" if min(speeds) > 0.0 else "a wave stops"
        yield (
            f"{floor_name(floor)}: {speeds[0]:.4f} m/s; best uniform layout there {speeds[1]:.4f} "
            f"m/s (gap {1e3 * uniform.layout.spacing.mean():.2f} mm): {lead}"
        )
