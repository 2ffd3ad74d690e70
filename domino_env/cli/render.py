"""Let rows topple before your eyes: an animated picture or a film, slower than nature.

Several layouts race one below the other; --scene adds its best uniform row.
"""

from __future__ import annotations

import argparse

from domino_env.cli.physics_options import add_physics_options, asked_physics

SUMMARY = "rows that topple, as an animated GIF, a film or a picture"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino render`."""
    parser.add_argument("layouts", metavar="LAYOUT", nargs="+", help="a .csv or .json file")
    add_physics_options(parser, "its physics, and its best uniform row as a rival")
    parser.add_argument("--gif", metavar="FILE", help="write an animated picture")
    parser.add_argument("--mp4", metavar="FILE", help="write a film (needs the extra 'render')")
    parser.add_argument("--png", metavar="FILE", help="write one picture of a few moments")
    parser.add_argument("--moments", type=int, default=4, help="in that picture (4)")
    parser.add_argument("--slow", type=float, default=5.0, help="times slower than nature (5)")
    parser.add_argument("--rate", type=float, default=25.0, help="images a second (25)")
    parser.add_argument("--width", type=int, default=1000, help="[px] (1000)")


def run(arguments: argparse.Namespace) -> int:
    """Simulate, draw, write."""
    from pathlib import Path

    from domino_env.core.files import layout_name, one_line
    from domino_env.physics.wave import simulate
    from domino_env.view.animation import frames, poses, write_gif, write_mp4, write_png
    from domino_env.view.race import Racer

    wanted = [(arguments.gif, ".gif", write_gif), (arguments.mp4, ".mp4", write_mp4)]
    wanted = [one for one in wanted if one[0]]
    if not (wanted or arguments.png):
        raise ValueError("nothing to write: give --gif FILE, --mp4 FILE or --png FILE")
    for name, ending in [(name, ending) for name, ending, _ in wanted] + [(arguments.png, ".png")]:
        if name and Path(name).suffix.lower() != ending:
            raise ValueError(f"{name}: a file for --{ending[1:]} ends in {ending}")
    asked = asked_physics(arguments, *arguments.layouts)
    rows = [(layout_name(Path(name)), asked.read(name)) for name in arguments.layouts]
    if asked.scene:
        rows.append(("best uniform", asked.scene.uniform().layout))
    print(asked.line)
    if asked.scene:
        heading = f"{one_line(asked.scene.name, 40)}: {one_line(asked.scene.title, 100)}"
    else:
        physics = asked.physics
        heading = f"friction {physics.friction:g}, push {physics.push:g} rad/s"
    racers = [Racer(name, simulate(layout, asked.physics)) for name, layout in rows]
    for name, _, write in wanted:
        images = frames(racers, arguments.rate, arguments.slow, arguments.width, heading)
        number = write(images, Path(name), arguments.rate)
        print(f"{name}: {number} images, {number / arguments.rate:.1f} s")
    if arguments.png:
        picture = poses(racers, arguments.moments, arguments.width, heading)
        write_png(picture, Path(arguments.png))
        print(f"{arguments.png}: {picture.width} by {picture.height} px")
    return 0
