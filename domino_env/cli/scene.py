"""Write a scene file for your own dominoes.

Options take lengths in millimetres and the slope in degrees. Lengths in the file are in metres.

domino scene --count 120 --thickness 8 --height 43 --length 2500 --slope 1 -o mine.toml
domino optimize mine.toml
"""

from __future__ import annotations

import argparse

from domino_env.cli import options

HEADER = "# Lengths are in metres: 18 mm is 0.018. docs/scenes/index.md describes all keys.\n"
COMMENTS = {
    "objective": "mean_speed: length over time",
    "slope": "[degrees], positive downhill",
    "height": "[m]",
    "width": "[m] across the chain",
    "density": "[kg/m³]; times of equal dominoes do not depend on it",
    "first_thickness": "[m] thickness of the first domino",
    "length": "[m] from the first pivot to the last",
    "min": "[m] smallest free gap",
    "max": "[m] largest free gap",
    "friction": "Coulomb coefficient between dominoes",
    "floor_friction": "Coulomb coefficient between dominoes and floor",
    "gravity": "[m/s²]",
    "push": "[rad/s] angular velocity of the first domino",
    "fixed": "[m]; for free values write min and max, or values = [...]",
    "deviation": "[m] standard deviation of the error of each gap",
    "quantile": "fraction of the draws that may be slower than the score",
    "draws": "number of draws that are simulated for each score",
    "seed": "seed of the draws",
}
SUMMARY = "write a scene file for your own dominoes"
MIN_GAP, MAX_GAP = 2.0, 0.8  # [mm], [heights of a domino] bounds of the gaps without --gaps
DRAWS, FLOOR_DRAWS = 256, 8  # draws for each score, with fixed pivots and on a floor
QUANTILE = 0.05  # share of the draws that may be slower than the score


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino scene`."""
    # bounds as `scenes.rules.MAX_DOMINOES` and `physics.ground.MAX_SLOPE`, whose modules need NumPy
    for name, read, text in (
        ("count", options.number(whole=True, low=2, high=100_000), "number of dominoes"),
        ("thickness", options.SIZE, "size of a domino along the chain [mm]"),
    ):
        parser.add_argument(f"--{name}", type=read, required=True, help=text)
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
        ("push", options.PUSH, "RAD/S", 8.0, "angular velocity of the first domino [rad/s]"),
    )
    gaps = "smallest and largest free gap [mm] (2, and 0.8 times the height)"
    parser.add_argument("--gaps", type=options.SIZE, nargs=2, metavar=("MIN", "MAX"), help=gaps)
    read, text = options.output(".toml"), "write to a .toml file (standard output)"
    parser.add_argument("-o", "--out", type=read, metavar="FILE", help=text)


def run(arguments: argparse.Namespace) -> int:
    """Print the scene as TOML, or write it to the file of `--out`."""
    from pathlib import Path

    from domino_env.core.checks import require
    from domino_env.core.files import write_text
    from domino_env.physics.ground import Ground
    from domino_env.physics.physics import Physics
    from domino_env.scenes.placement import Placement
    from domino_env.scenes.scene import Scene

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
        name=Path(arguments.out).stem if arguments.out else "mine",
        title=f"{arguments.count} dominoes of {sizes} mm{slope}",
        placement=placement,
        count=arguments.count,
        height=_metres(arguments.height),
        width=_metres(arguments.width),
        length=None if arguments.length is None else _metres(arguments.length),
        spacing=(_metres(low), _metres(high)),
        thickness=(_metres(arguments.thickness), _metres(arguments.thickness)),
        physics=Physics(arguments.friction, push=arguments.push),
        floor_friction=arguments.floor,
        ground=None if arguments.slope is None else Ground(slope=arguments.slope),
    )
    text = HEADER + "".join(map(_add_comment, scene.to_toml().splitlines()))
    if arguments.out is None:
        print(text, end="")
        return 0
    verb = "replaced" if Path(arguments.out).exists() else "written to"
    write_text(Path(arguments.out), text)
    print(f"{verb} {arguments.out}: search for a layout with domino optimize {arguments.out}")
    return 0


def _add_comment(line: str) -> str:
    """Return a line of a scene file, with a comment if there is one for its key."""
    comment = COMMENTS.get(line.partition(" =")[0])
    return f"{line:<26} # {comment}\n" if comment else f"{line}\n"


def _metres(millimetres: float) -> float:
    """Return a length in metres, rounded to 12 decimals for a legible file."""
    return round(millimetres / 1000.0, 12)
