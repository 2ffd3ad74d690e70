"""Estimate the hit frequency of a recording, by autocorrelation."""

from __future__ import annotations

import argparse
from pathlib import Path

from domino_env.cli.options import SIZE, add_options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino listen`."""
    chain = "recording of a uniform chain"
    parser.add_argument("files", metavar="FILE.wav", type=Path, nargs="+", help=chain)
    pitch = "distance from pivot to pivot [mm], to print the speed too"
    add_options(parser, ("pitch", SIZE, "MM", None, pitch))


def run(arguments: argparse.Namespace) -> int:
    """Estimate and print the hit frequency of each recording."""
    from domino_env.core.files import errors_with_path
    from domino_env.view.sound import listen, read_wav

    for name in arguments.files:
        samples, rate = read_wav(name)
        with errors_with_path(name):
            hits = listen(samples, rate)
        line = f"{name}: {hits.frequency:.2f} ± {hits.uncertainty:.2f} hits per second"
        if arguments.pitch:
            metres = arguments.pitch * 1e-3
            line += f", {hits.frequency * metres:.4f} ± {hits.uncertainty * metres:.4f} m/s"
        print(f"{line} (autocorrelation {hits.clarity:.2f}, {hits.seconds:.2f} s evaluated)")
        if hits.clarity < 0.3:  # autocorrelations of periodic hits are larger
            print("  the hits are not periodic: record a chain with equal gaps, without noise")
    return 0
