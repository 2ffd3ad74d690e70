"""Print the file of a scene for your own dominoes.

Lengths are in millimetres and slopes in degrees here, and in metres in the file:

domino scene --count 120 --thickness 8 --height 43 --length 2500 --slope 1 > mine.toml
domino optimize mine.toml
"""

from __future__ import annotations

import argparse

SUMMARY = "print a scene file for your own dominoes"
FREE_GAP = 0.8  # of the height: the largest gap, if --gaps does not give it


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino scene`."""
    for name, default, text in (
        ("thickness", None, "size of a domino along the chain [mm]"),
        ("height", 48.0, "height of a domino [mm] (48)"),
        ("width", 24.0, "size of a domino across the chain [mm] (24)"),
        ("length", None, "from the first pivot to the last [mm] (free)"),
        ("deviation", None, "standard deviation of the placement error of each gap [mm] (none)"),
        ("slope", None, "slope of the ground, positive downhill [degrees] (level)"),
        ("friction", 0.25, "Coulomb coefficient between dominoes (0.25)"),
        ("floor", None, "Coulomb coefficient of the floor on which they stand free (fixed pivots)"),
        ("push", 8.0, "angular velocity of the first domino [rad/s] (8)"),
    ):
        parser.add_argument(
            f"--{name}", type=float, help=text, default=default, required=name == "thickness"
        )
    parser.add_argument("--count", type=int, required=True, help="number of dominoes")
    parser.add_argument(
        "--gaps", type=float, nargs=2, metavar=("MIN", "MAX"),
        help="smallest and largest free gap [mm] (2 and 0.8 times the height)",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Print the scene."""
    from domino_env.scenes.io.reading import parse_scene

    text = scene_text(arguments)
    parse_scene(text, "mine", "domino scene")
    print(text, end="")
    return 0


def scene_text(box: argparse.Namespace) -> str:
    """Return the commented TOML text of a scene."""
    low, high = box.gaps or (2.0, FREE_GAP * box.height)
    robust = box.deviation is not None
    lines = [
        "# A scene of domino-chains. Lengths are in metres: 18 mm is 0.018.",
        "# `domino optimize FILE` searches the best layout; docs/files.md explains all keys.",
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
        lines.append(f"floor_friction = {box.floor:<7g} # the dominoes stand free on this floor")
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
