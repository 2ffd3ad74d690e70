"""Write the file of a scene for your own dominoes.

Lengths are in millimetres and slopes in degrees here, and in metres in the file:

domino scene --count 120 --thickness 8 --height 43 --length 2500 --slope 1 -o mine.toml
domino optimize mine.toml
"""

from __future__ import annotations

import argparse
import math

from domino_env.cli.options import (
    COEFFICIENT,
    DEVIATION,
    PUSH,
    SIZE,
    floor,
    number,
    output,
    require_deviation,
)

SUMMARY = "write a scene file for your own dominoes"
LEAST_GAP, FREE_GAP = 2.0, 0.8  # [mm], of the height: bounds of the gaps without --gaps


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino scene`."""
    for name, kind, default, text in (
        ("thickness", SIZE, None, "size of a domino along the chain [mm]"),
        ("height", SIZE, 48.0, "height of a domino [mm] (48)"),
        ("width", SIZE, 24.0, "size of a domino across the chain [mm] (24)"),
        ("length", number("mm", above=0.0), None, "from the first pivot to the last [mm] (free)"),
        ("deviation", DEVIATION, None,
         "standard deviation of the placement error of each gap [mm] (none)"),
        ("slope", number("degrees", low=-45.0, high=45.0), None,
         "slope of the ground, positive downhill [degrees] (level)"),
        ("friction", COEFFICIENT, 0.25, "coefficient of friction between dominoes (0.25)"),
        ("floor", floor, None,
         "coefficient of friction of the floor of free-standing dominoes (fixed pivots)"),
        ("push", PUSH, 8.0, "angular velocity of the first domino [rad/s] (8)"),
    ):  # fmt: skip
        parser.add_argument(
            f"--{name}", type=kind, help=text, default=default, required=name == "thickness"
        )
    parser.add_argument(
        "--count", type=number(whole=True, low=2, high=100_000), required=True,
        help="number of dominoes",
    )  # fmt: skip
    parser.add_argument(
        "--gaps", type=SIZE, nargs=2, metavar=("MIN", "MAX"),
        help="smallest and largest free gap [mm] (2 and 0.8 times the height)",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--out", type=output(".toml"), metavar="FILE", help="write to a .toml file (print)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print or write the scene."""
    from pathlib import Path

    from domino_env.core.checks import require
    from domino_env.core.files import write_text
    from domino_env.scenes.io.reading import parse_scene

    if arguments.gaps is None:
        arguments.gaps = LEAST_GAP, FREE_GAP * arguments.height
    (low, high), thickness = arguments.gaps, arguments.thickness
    require("--thickness", thickness, below=arguments.height, unit="mm", hint="the height")
    require("--gaps", low, high=high, unit="mm", hint="smallest gap first")
    require("--gaps", high, below=arguments.height, unit="mm", hint="the height")
    if arguments.deviation is not None:
        require_deviation(arguments.deviation, high)
    if arguments.length is not None:
        pairs, length = arguments.count - 1, arguments.length
        least, most = pairs * (low + thickness), pairs * (high + thickness)
        fitting = f"{math.ceil(length * pairs / most) + 1} to {int(length * pairs / least) + 1}"
        hint = f"gaps of {low:g} to {high:g} mm; or --count {fitting}"
        require("--length", length, least, most, unit="mm", hint=hint)
    text = scene_text(arguments)
    parse_scene(text, "mine", "domino scene")
    if arguments.out:
        write_text(Path(arguments.out), text)
        print(
            f"written to {arguments.out}: domino optimize {arguments.out} searches its best layout"
        )
    else:
        print(text, end="")
    return 0


def scene_text(box: argparse.Namespace) -> str:
    """Return the commented TOML text of a scene."""
    low, high = box.gaps
    robust = box.deviation is not None
    lines = [
        "# A scene of domino-chains. Lengths are in metres: 18 mm is 0.018.",
        "# `domino optimize FILE` searches the best layout; docs/scenes/index.md has all keys.",
        f'title = "{box.count} dominoes of {box.thickness:g} x {box.width:g} x {box.height:g} mm"',
        'objective = "robust"     # the speed that 95 % of the layouts as placed reach'
        if robust
        else 'objective = "mean_speed" # length over the time of the last hit',
        "\n[row]",
        f"count = {box.count}",
        _metres("height", box.height),
        _metres("width", box.width),
        *([] if box.length is None else [_metres("length", box.length, "first to last pivot")]),
        "\n[spacing]               # free gaps: the design variables",
        _metres("min", low),
        _metres("max", high),
        "\n[thickness]",
        _metres("fixed", box.thickness, "or min and max, or values = [...]"),
        "\n[physics]",
        f"friction = {box.friction:<13g} # Coulomb coefficient between dominoes",
        "gravity = 9.81           # [m/s²]",
        f"push = {box.push:<17g} # [rad/s] angular velocity of the first domino",
    ]
    if box.floor is not None:
        lines.append(f"floor_friction = {box.floor:<7g} # coefficient of friction of the floor")
    if box.slope is not None:
        lines += ["\n[ground]", f"slope = {box.slope:<16g} # [degrees], positive downhill"]
    if robust:
        draws = f"draws = {256 if box.floor is None else 8:<16}"
        lines += ["\n[robust]", _metres("deviation", box.deviation, "error of each gap")]
        lines += ["quantile = 0.05          # share of the draws that may be slower"]
        lines += [f"{draws} # random layouts that are simulated for each score"]
    return "\n".join(lines) + "\n"


def _metres(key: str, millimetres: float, about: str = "") -> str:
    """Return a line of the file with a length in metres."""
    return f"{f'{key} = {millimetres / 1000.0:.9g}':<24} # [m] {about}".rstrip()
