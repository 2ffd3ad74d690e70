"""Write the sound of a wave: a click a hit, in true time."""

from __future__ import annotations

import argparse

SUMMARY = "the sound of a row, as a WAV file"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `domino click`."""
    parser.add_argument("layout", metavar="LAYOUT", help="a .csv or .json file")
    parser.add_argument("--scene", help="a scene's physics, by name or .toml file")
    parser.add_argument("--friction", type=float, help="between dominoes (0.25)")
    parser.add_argument("--gravity", type=float, help="[m/s²] (9.81)")
    parser.add_argument("--push", type=float, help="angular velocity of the first [rad/s] (8)")
    parser.add_argument("--wav", metavar="FILE", help="where to (beside the layout)")


def run(arguments: argparse.Namespace) -> int:
    """Simulate, write."""
    from dataclasses import replace
    from pathlib import Path

    from domino_env.layout import Layout
    from domino_env.look.sound import clicks, write_wav
    from domino_env.physics import Physics
    from domino_env.scene import load_scene
    from domino_env.wave import simulate

    physics = load_scene(arguments.scene).physics if arguments.scene else Physics()
    given = {k: getattr(arguments, k) for k in ("friction", "gravity", "push")}
    physics = replace(physics, **{k: v for k, v in given.items() if v is not None})
    source = Path(arguments.layout)
    wave = simulate(Layout.read(source), physics)
    target = Path(arguments.wav) if arguments.wav else source.with_suffix(".wav")
    write_wav(clicks(wave), target)
    print(f"{target}: {wave.hit - 1} clicks in {wave.arrival_times[wave.hit - 1]:.3f} s")
    return 0
