"""Check rows by other means than the model: hinged, and standing free on floors.

The simulator of standing rows that comes with the package looks first: it takes a second or so.
Where the extra 'verify' (pymunk) is installed, somebody else's rigid-body engine looks too, with
ever more sweeps of its solver and ever smaller steps until its arrival times stand still: seconds
for a tame row, minutes for a wild one.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

from domino_env.cli.physics_options import add_physics_options, asked_physics

if TYPE_CHECKING:
    from domino_env.rigid.comparison import Verification
    from domino_env.rigid.converging import Engine
    from domino_env.scenes.scene import Scene

SUMMARY = "the same row hinged and on floors, by a second simulator and by another's engine"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino verify`."""
    parser.add_argument("layouts", metavar="LAYOUT", nargs="+", help="a .csv or .json file")
    add_physics_options(parser, "a scene's physics, by name or .toml file")
    add_floor_option(parser)
    add_engine_options(parser, default=None, told="where pymunk is installed")
    parser.add_argument(
        "--json", metavar="FILE", help="write the times (one layout only), for domino report"
    )
    parser.add_argument("--plot", metavar="FILE", help="draw the differences (PNG)")


def add_floor_option(parser: argparse.ArgumentParser) -> None:
    """Add --floor."""
    parser.add_argument(
        "--floor",
        type=floors_of,
        default="0.3,0.5,1",
        metavar="MU,...",
        help="friction of the floors to stand on, 'free' for 1 (0.3,0.5,1)",
    )


def add_engine_options(parser: argparse.ArgumentParser, default: bool | None, told: str) -> None:
    """Add --engine and how closely it looks."""
    parser.add_argument(
        "--engine",
        action=argparse.BooleanOptionalAction,
        default=default,
        help=f"ask the rigid-body engine too ({told})",
    )
    parser.add_argument(
        "--share",
        type=float,
        metavar="PART",
        help="of an arrival time that the engine may leave in doubt (0.0005)",
    )
    parser.add_argument(
        "--steps", type=float, nargs="+", metavar="US", help="of its time [µs] (80 40 20)"
    )
    parser.add_argument(
        "--sweeps", type=int, metavar="N", help="of its solver in a step, at most (1920)"
    )


def floors_of(text: str) -> tuple[float, ...]:
    """Read '0.3,0.5,1'; 'free' is a floor of friction 1."""
    try:
        return tuple(1.0 if word == "free" else float(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"'{text}': give coefficients of friction with commas between, as in 0.3,0.5,1"
        ) from None


def asked_engine(arguments: argparse.Namespace, quiet: bool = False) -> Engine | None:
    """Return the engine as the options ask for it; None where it is not to be asked."""
    import sys
    from importlib.util import find_spec

    from domino_env.rigid.converging import Engine

    given = {
        "share": arguments.share,
        "steps": tuple(h * 1e-6 for h in arguments.steps) if arguments.steps else None,
        "most_sweeps": arguments.sweeps,
    }
    given = {name: value for name, value in given.items() if value is not None}
    wanted = arguments.engine
    if wanted is None:
        wanted = bool(given) or find_spec("pymunk") is not None
    if not wanted:
        if given:
            raise ValueError("--share, --steps and --sweeps are the engine's: give no --no-engine")
        return None

    def progress(line: str) -> None:
        if not quiet and sys.stderr.isatty():
            print(f"\r\x1b[Kengine: {line}", end="", file=sys.stderr, flush=True)

    found = Engine(**given, progress=progress)
    found.name  # noqa: B018  # says what to install before time is spent
    return found


def run(arguments: argparse.Namespace) -> int:
    """Check each row; 1 if any differs by more than 0.3 per cent, or topples in one only."""
    from pathlib import Path

    from domino_env.rigid.comparison import verify, write_verification

    if len(arguments.layouts) > 1 and (arguments.json or arguments.plot):
        raise ValueError("--json and --plot name one file: give one layout with them")
    engine = asked_engine(arguments)
    differs = False
    for name in arguments.layouts:
        asked = asked_physics(arguments, name)
        layout = asked.read(name)
        print(f"{name}\n{asked.line}")
        checked = verify(layout, asked.physics, floors=arguments.floor)
        _print(checked)
        if asked.scene is not None:
            print("\n".join(_beside_uniform(asked.scene, checked)), flush=True)
        second = None
        if engine is not None:
            second = verify(layout, asked.physics, floors=arguments.floor, judge=engine)
            _print(second, beside=checked)
        differs |= any(one and one.verdict.startswith("DIFFERS") for one in (checked, second))
        if arguments.json:
            write_verification(checked, Path(arguments.json), second)
        if arguments.plot:
            from domino_env.rigid.picture import write_picture

            write_picture(checked, Path(arguments.plot), Path(name).stem, second)
    if engine is None and arguments.engine is None:
        print("(a second opinion, of another's engine: pip install 'domino-chains[verify]')")
    return 1 if differs else 0


def _print(checked: Verification, beside: Verification | None = None) -> None:
    from domino_env.rigid.comparison import between, table

    lines = table(checked) + (between(beside, checked) if beside else [])
    print("\n".join(lines), flush=True)


def _beside_uniform(scene: Scene, checked: Verification) -> Iterator[str]:
    """How much faster the row is than the best uniform one on the same floor."""
    from domino_env.rigid.built_in import Standing
    from domino_env.rigid.judges import in_words
    from domino_env.rigid.uniform import best_uniform_on

    mark, physics = scene.uniform().layout, checked.wave.physics
    if scene.unit != "m/s" or scene.violations(checked.wave.layout) or physics != scene.physics:
        return
    for fall in checked.falls:
        row = best_uniform_on(scene, mark, fall.floor, Standing())
        uniform = Standing().fall(row, physics, fall.floor)
        speeds = [
            one.length / float(seen.arrivals[-1])
            for one, seen in ((checked.wave.layout, fall), (row, uniform))
        ]
        lead = f"{speeds[0] / speeds[1] - 1.0:+.2%}" if min(speeds) > 0.0 else "a wave dies"
        yield (
            f"{in_words(fall.floor)}: {speeds[0]:.4f} m/s; best uniform row there {speeds[1]:.4f} "
            f"m/s (gap {1e3 * row.spacing.mean():.2f} mm): {lead}"
        )
