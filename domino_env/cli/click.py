"""Write the sound of a wave: a click a hit, in true time."""

from __future__ import annotations

import argparse

from domino_env.cli.physics_options import add_physics_options, asked_physics

SUMMARY = "the sound of a row, as a WAV file"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino click`."""
    parser.add_argument("layout", metavar="LAYOUT", help="a .csv or .json file")
    add_physics_options(parser, "a scene's physics, by name or .toml file")
    parser.add_argument("--wav", metavar="FILE", help="where to (beside the layout)")


def run(arguments: argparse.Namespace) -> int:
    """Simulate, write."""
    from pathlib import Path

    from domino_env.physics.wave import simulate
    from domino_env.view.sound import clicks, write_wav

    source = Path(arguments.layout)
    asked = asked_physics(arguments, source)
    wave = simulate(asked.read(source), asked.physics)
    target = Path(arguments.wav) if arguments.wav else source.with_suffix(".wav")
    write_wav(clicks(wave), target)
    print(asked.line)
    print(f"{target}: {wave.hit - 1} clicks in {wave.arrival_times[wave.hit - 1]:.3f} s")
    return 0
