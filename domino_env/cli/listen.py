"""Estimate the hit frequency of recorded chains by autocorrelation, with its uncertainty."""

from __future__ import annotations

import argparse

SUMMARY = "estimate the hit frequency of a recording"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino listen`."""
    parser.add_argument("files", metavar="FILE.wav", nargs="+", help="recording of a uniform chain")
    parser.add_argument(
        "--pitch", type=float, metavar="MM", help="pitch [mm]; the speed is printed too"
    )


def run(arguments: argparse.Namespace) -> int:
    """Listen to each."""
    from pathlib import Path

    from domino_env.view.sound import listen, read_wav

    for name in arguments.files:
        samples, rate = read_wav(Path(name))
        try:
            heard = listen(samples, rate)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
        line = f"{name}: {heard.frequency:.2f} ± {heard.uncertainty:.2f} hits a second"
        if arguments.pitch:
            metres = arguments.pitch * 1e-3
            line += f", {heard.frequency * metres:.4f} ± {heard.uncertainty * metres:.4f} m/s"
        print(f"{line} (clarity {heard.clarity:.2f}, {heard.seconds:.2f} s listened to)")
        if heard.clarity < 0.3:
            print("  the hits hardly repeat: a row of unequal gaps, or a noisy recording")
    return 0
