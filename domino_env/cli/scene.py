"""Write a scene file for your own dominoes.

Options take lengths in millimetres and the slope in degrees. Lengths in the file are in metres.

domino scene --count 120 --thickness 8 --height 43 --length 2500 --slope 1 -o mine.toml
domino optimize mine.toml
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Iterator
from typing import Any

from domino_env.cli import options

HEADER = "# Lengths are in metres: 18 mm is 0.018. docs/scenes/index.md describes all keys.\n"
MIN_GAP, MAX_GAP = 2.0, 0.8  # [mm], [heights of a domino] bounds of the gaps without --gaps
DRAWS, FLOOR_DRAWS = 256, 8  # draws for each score, with fixed pivots and on a floor
QUANTILE = 0.05  # share of the draws that may be slower than the score


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino scene`."""
    # bounds as `scenes.rules.MAX_DOMINOES` and `physics.ground.MAX_SLOPE`, whose modules need NumPy
    count, thickness = options.number(whole=True, low=2, high=100_000), options.SIZE
    along = "size of a domino along the chain [mm]"
    parser.add_argument("--count", type=count, required=True, help="number of dominoes")
    parser.add_argument("--thickness", type=thickness, required=True, help=along)
    slope = "slope of the ground, positive downhill [degrees] (level)"
    noise = "standard deviation of the placement error of each gap [mm] (none)"
    standing = "coefficient of friction of the floor of free-standing dominoes (fixed pivots)"
    options.add_options(
        parser,
        ("height", options.SIZE, "MM", 48.0, "height of a domino [mm]"),
        ("width", options.SIZE, "MM", 24.0, "size of a domino across the chain [mm]"),
        ("length", options.number("mm", above=0.0), "MM", None, "first to last pivot [mm] (free)"),
        ("deviation", options.DEVIATION, "MM", None, noise),
        ("slope", options.number("degrees", low=-45.0, high=45.0), "DEGREES", None, slope),
        ("friction", options.COEFFICIENT, "MU", 0.25, "coefficient of friction between dominoes"),
        ("floor", options.floor, "FRICTION", None, standing),
        (
            "push",
            options.push,
            "RAD/S",
            8.0,
            "angular velocity of the first domino [rad/s], or 'released'",
        ),
    )
    gaps = "smallest and largest free gap [mm] (2, and 0.8 times the height)"
    parser.add_argument("--gaps", type=options.SIZE, nargs=2, metavar=("MIN", "MAX"), help=gaps)
    read, text = options.output(".toml"), "write to a .toml file (standard output)"
    parser.add_argument("-o", "--out", type=read, metavar="FILE", help=text)


def run(arguments: argparse.Namespace) -> int:
    """Print the scene as TOML, or write it to the file of `--out`."""
    from domino_env.core.checks import require
    from domino_env.core.files import write_text
    from domino_env.physics.ground import Ground
    from domino_env.physics.physics import Physics
    from domino_env.scenes.placement import Placement
    from domino_env.scenes.scene import Scene
    from domino_env.scenes.tables import format_toml

    low, high = arguments.gaps or (MIN_GAP, MAX_GAP * arguments.height)
    require("--thickness", arguments.thickness, below=arguments.height, unit="mm", hint="height")
    require("--gaps", high, low, below=arguments.height, unit="mm", hint="MIN, then MAX < height")
    placement = None
    if arguments.deviation is not None:
        options.require_deviation(arguments.deviation, high)
        draws = DRAWS if arguments.floor is None else FLOOR_DRAWS
        placement = Placement(_metres(arguments.deviation), draws, quantile=QUANTILE)
    slope = "" if arguments.slope is None else f" on a slope of {arguments.slope:g}°"
    sizes = f"{arguments.thickness:g} x {arguments.width:g} x {arguments.height:g}"
    scene = Scene(
        name=arguments.out.stem if arguments.out else "mine",
        title=f"{arguments.count} dominoes of {sizes} mm{slope}",
        placement=placement,
        count=arguments.count,
        **{name: _metres(getattr(arguments, name)) for name in ("height", "width", "length")},
        spacing=(_metres(low), _metres(high)),
        thickness=(_metres(arguments.thickness), _metres(arguments.thickness)),
        physics=Physics(arguments.friction),
        floor_friction=arguments.floor,
        ground=None if arguments.slope is None else Ground(slope=arguments.slope),
    )
    tables = scene.document()
    tables["physics"]["push"] = arguments.push
    text = HEADER + "".join(_with_comments(format_toml(tables)))
    if arguments.out is None:
        if not sys.stdout.isatty() and isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(encoding="utf-8")  # as files of scenes are read
        print(text, end="")
        return 0
    verb = "replaced" if arguments.out.exists() else "written to"
    write_text(arguments.out, text)
    print(f"{verb} {arguments.out}: search for a layout with domino optimize {arguments.out}")
    return 0


def _with_comments(text: str) -> Iterator[str]:
    """Yield the lines of a scene file, each key of a table with its description."""
    from domino_env.scenes.io.reading import schema_fields

    descriptions = {(table, key): field["description"] for table, key, field in schema_fields()}
    table = ""
    for line in text.splitlines():
        table = line[1:-1] if line.startswith("[") else table
        description = descriptions.get((table, line.partition(" =")[0])) if table else None
        yield f"{line:<26} # {description}\n" if description else f"{line}\n"


def _metres(millimetres: Any) -> Any:
    """Return a length in metres, rounded to 12 decimals for a legible file; None for None."""
    return None if millimetres is None else round(millimetres / 1000.0, 12)
