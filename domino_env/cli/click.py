"""Write the sound of a layout as a WAV file, one click per hit."""

from __future__ import annotations

import argparse

from domino_env.cli import options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino click`."""
    options.add_layout(parser)
    options.add_physics_options(parser)
    sound = "output file (LAYOUT with the ending .wav)"
    options.add_options(parser, ("wav", options.output(".wav"), "FILE", None, sound))


def run(arguments: argparse.Namespace) -> int:
    """Simulate the layout and write its sound."""
    from domino_env.core.files import amount
    from domino_env.physics.wave import simulate
    from domino_env.view.sound import clicks, write_wav

    source = arguments.layout
    chosen = options.chosen_physics(arguments, source)
    wave = simulate(chosen.row(chosen.read(source)), chosen.physics)
    if wave.hit < 2:
        reason = wave.explanation if wave.layout.count > 1 else "a chain needs two dominoes or more"
        raise ValueError(f"{source}: no domino hits another, so there is no sound: {reason}")
    target = arguments.wav or options.beside(source, ".wav")
    write_wav(clicks(wave), target)
    print(chosen.line)
    print(f"{target}: {amount(wave.hit - 1, 'click')} in {wave.arrival_times[wave.hit - 1]:.3f} s")
    return 0
