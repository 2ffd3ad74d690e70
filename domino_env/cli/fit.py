"""Find the friction that explains measured hit frequencies of uniform rows.

Each ROW is PITCH=FREQUENCY, in millimetres and hits a second: domino fit 16=64.4 24=42.3 32=28.1
"""

from __future__ import annotations

import argparse

SUMMARY = "the friction that explains measured frequencies"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino fit`."""
    parser.add_argument("rows", metavar="ROW", nargs="+", help="PITCH=FREQUENCY [mm]=[1/s]")
    parser.add_argument("--thickness", type=float, default=7.5, help="[mm] (7.5)")
    parser.add_argument("--height", type=float, default=48.0, help="[mm] (48)")
    parser.add_argument("--gravity", type=float, default=9.81, help="[m/s²] (9.81)")


def run(arguments: argparse.Namespace) -> int:
    """Fit, print a line a row."""
    import math

    from domino_env.lab.measured.fit import fit_friction

    pairs = []
    for row in arguments.rows:
        try:
            pitch, told = (float(part) for part in row.split("="))
        except ValueError:
            raise ValueError(f"'{row}': write PITCH=FREQUENCY, as in 16=64.4") from None
        pairs.append((pitch * 1e-3, told))
    pitches, frequencies = [p for p, _ in pairs], [f for _, f in pairs]
    found = fit_friction(
        pitches, frequencies, arguments.thickness * 1e-3, arguments.height * 1e-3,
        arguments.gravity,
    )  # fmt: skip
    print("pitch [mm]  measured [1/s]  explained [1/s]  difference  friction of this row alone")
    for p, f, e, m in zip(pitches, frequencies, found.explained, found.single, strict=True):
        alone = f"{m:.4f}" if math.isfinite(m) else "none explains it"
        print(f"{p * 1e3:10.2f}  {f:14.2f}  {e:15.2f}  {e / f - 1.0:+10.1%}  {alone}")
    doubt = f" ± {found.uncertainty:.4f}" if math.isfinite(found.uncertainty) else ""
    print(f"\nfriction {found.friction:.4f}{doubt}")
    return 0
