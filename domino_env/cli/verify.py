"""Verify layouts with simulators in which closed contacts may open.

The reference simulator simulates each layout with fixed pivots and free-standing on floors, in
about a second, and with a scene also its uniform baseline on each floor, in some seconds. If the
extra 'verify' (pymunk) is installed, a third-party rigid-body engine simulates it too, in seconds
to minutes: it repeats the simulation with more solver iterations and smaller steps until the
arrival times converge or its limits are reached.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from domino_env.cli import options

if TYPE_CHECKING:
    from domino_env.physics.layout import Layout
    from domino_env.rigid.verification import Verification
    from domino_env.scenes.scene import Scene

FLOORS = "0.3,0.5,1"  # coefficients of friction by default


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino verify`."""
    options.add_layout(parser, "layouts", nargs="+")
    options.add_physics_options(parser)
    floors = "coefficients of friction of the floors; 'free' means 1"
    options.add_options(parser, ("floor", read_floors, "FRICTION,...", FLOORS, floors))
    parser.add_argument(
        "--engine", action=argparse.BooleanOptionalAction, default=None,
        help="also simulate with the third-party engine (default: if pymunk is installed)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the result as JSON in SI units")


def read_floors(text: str) -> tuple[float, ...]:
    """Return the coefficients of friction in a text such as '0.3,0.5,1'."""
    return tuple(options.floor(word, options.POSITIVE_COEFFICIENT) for word in text.split(","))


def run(arguments: argparse.Namespace) -> int:
    """Verify each layout; return 1 if a verdict is DIFFERS, else 0."""
    from importlib.util import find_spec

    from domino_env.core.checks import install_command
    from domino_env.core.files import one_line
    from domino_env.rigid import verification
    from domino_env.rigid.engine import engine_name

    if len(arguments.layouts) > 1 and arguments.json:
        raise ValueError(f"--json takes one layout, not {len(arguments.layouts)}: give one LAYOUT")
    engine = arguments.engine
    if engine:
        engine_name()  # raises an ImportError before any simulation if it is not installed
    elif engine is None:  # neither --engine nor --no-engine
        engine = find_spec("pymunk") is not None

    differs = False
    choices = {name: options.chosen_physics(arguments, name) for name in arguments.layouts}
    layouts = [chosen.read(name) for name, chosen in choices.items()]
    for (name, chosen), layout in zip(choices.items(), layouts, strict=True):
        if not arguments.json:
            print(f"{one_line(str(name))}\n{chosen.line}", flush=True)
        result = verification.verify(
            chosen.row(layout), chosen.physics, floors=arguments.floor, engine=engine,
            progress=None,
        )  # fmt: skip
        differs |= any(verdict.startswith("DIFFERS") for verdict in result.verdicts)
        if arguments.json:
            options.print_json(verification.as_document(result))
            continue
        print("\n".join(verification.verification_table(result)))
        if chosen.scene is not None:
            print("\n".join(_gains_on_floors(chosen.scene, layout, result)), flush=True)
    if not engine and arguments.engine is None and not arguments.json:
        print(f"(to verify with a third-party engine too: {install_command('verify')})")
    return 1 if differs else 0


def _gains_on_floors(scene: Scene, layout: Layout, result: Verification) -> Iterator[str]:
    """Yield a line with the gain over the uniform baseline for each floor and fixed pivots.

    Nothing is yielded if scores are no speeds, or if layout or physics are not those of the scene.
    """
    from domino_env.rigid.simulation import floor_name, simulate_standing
    from domino_env.scenes.uniform import best_uniform_on

    physics = result.wave.physics
    if not scene.criterion.is_mean_speed or scene.violations(layout) or physics != scene.physics:
        return
    baseline = scene.uniform().layout
    for rigid in result.reference:
        friction = rigid.floor_friction
        row = scene.row(best_uniform_on(scene, baseline, friction))
        uniform = simulate_standing(row, physics, friction)
        speed, uniform_speed = rigid.mean_speed, uniform.mean_speed
        both_complete = min(speed, uniform_speed) > 0.0
        gain = f"{speed / uniform_speed - 1.0:+.2%}" if both_complete else "a wave stops"
        yield (
            f"{floor_name(friction)}: {speed:.4f} m/s; uniform baseline {uniform_speed:.4f} m/s "
            f"(gap {1e3 * uniform.layout.spacing.mean():.2f} mm): {gain}"
        )
