"""Draw toppling chains as an animated GIF, a film or a picture.

Several layouts are drawn one below the other, the last being the uniform baseline of the scene, if
it has as many dominoes.
"""

from __future__ import annotations

import argparse

from domino_env.cli import options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino render`."""
    options.add_layout(parser, "layouts", nargs="+")
    options.add_physics_options(parser, uniform=True)
    slow = "slow motion: seconds of the animation for each second of the wave"
    options.add_options(
        parser,
        ("gif", options.output(".gif"), "FILE", None, "write an animated GIF"),
        ("mp4", options.output(".mp4"), "FILE", None, "write a film (extra 'render')"),
        ("png", options.output(".png"), "FILE", None, "write a picture of several moments"),
        ("moments", options.NATURAL, "N", 4, "number of moments in the picture"),
        ("slow", options.number(above=0.0), "FACTOR", 5.0, slow),
        ("rate", options.number("Hz", above=0.0), "HZ", 25.0, "frames per second"),
        ("width", options.NATURAL, "PX", 1000, "width of a frame [px]"),
    )


def run(arguments: argparse.Namespace) -> int:
    """Simulate the layouts and write the animations and the picture."""
    from domino_env.core.files import one_line
    from domino_env.view.animation import frames, poses, write_gif, write_mp4, write_png
    from domino_env.view.compared import read_compared

    writers = ((arguments.gif, write_gif), (arguments.mp4, write_mp4))
    if not (arguments.gif or arguments.mp4 or arguments.png):
        raise ValueError("nothing to write: give --gif FILE, --mp4 FILE or --png FILE")
    chosen = options.chosen_physics(arguments, *arguments.layouts)
    heading = f"friction {chosen.physics.friction:g}, push {chosen.physics.push:g} rad/s"
    if chosen.scene:
        heading = f"{one_line(chosen.scene.name, 40)}: {one_line(chosen.scene.title, 100)}"
    compared = read_compared(arguments.layouts, chosen.scene, chosen.other_physics)
    print(chosen.line)
    for name, write in writers:
        if name:
            images = frames(compared, arguments.rate, arguments.slow, arguments.width, heading)
            print(f"{name}: {write(images, name, arguments.rate):.1f} s")
    if arguments.png:
        picture = poses(compared, arguments.moments, arguments.width, heading)
        write_png(picture, arguments.png)
        print(f"{arguments.png}: {picture.width} by {picture.height} px")
    return 0
