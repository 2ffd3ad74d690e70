"""Check rows in an independent rigid-body engine (pymunk), hinged and free on a rough floor.

The engine runs at two or more time steps; its times are extrapolated to steps of zero and put
beside the model's.  Needs the extra 'verify'.
"""

from __future__ import annotations

import argparse

from domino_env.cli.physics_options import add_physics_options, asked_physics

SUMMARY = "the same row in an independent physics engine, times side by side"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino verify`."""
    parser.add_argument("layouts", metavar="LAYOUT", nargs="+", help="a .csv or .json file")
    add_physics_options(parser, "a scene's physics, by name or .toml file")
    parser.add_argument(
        "--steps", type=float, nargs="+", metavar="US", help="of the engine's time [µs] (40 20)"
    )
    parser.add_argument(
        "--json", metavar="FILE", help="write the times (one layout only), for domino report"
    )
    parser.add_argument("--plot", metavar="FILE", help="draw the differences (PNG)")


def run(arguments: argparse.Namespace) -> int:
    """Check each row; 1 if any differs by more than 0.3 per cent, or topples in one only."""
    from pathlib import Path

    from domino_env.rigid.comparison import STEPS, table, verify, write_verification

    if len(arguments.layouts) > 1 and (arguments.json or arguments.plot):
        raise ValueError("--json and --plot name one file: give one layout with them")
    steps = [h * 1e-6 for h in arguments.steps] if arguments.steps else STEPS
    differs = False
    for name in arguments.layouts:
        asked = asked_physics(arguments, name)
        checked = verify(asked.read(name), asked.physics, steps)
        print(f"{name}\n{asked.line}\n" + "\n".join(table(checked)))
        differs |= checked.verdict.startswith("DIFFERS")
        if arguments.json:
            write_verification(checked, Path(arguments.json))
        if arguments.plot:
            from domino_env.rigid.picture import write_picture

            write_picture(checked, Path(arguments.plot), Path(name).stem)
    return 1 if differs else 0
