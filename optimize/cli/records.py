"""The best layouts known of the scenes that ship: list them, write one down, verify them.

--verify topples each in an independent rigid-body engine (extra 'verify'), hinged and free, at two
or more time steps; with --update the shipped table of verifications is written anew.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from domino_env.rigid.known import Verified
    from optimize.records.shipped import BestKnown

SUMMARY = "the best layouts known: list, write, verify"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino best-known`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="names (all)")
    parser.add_argument(
        "--layout", metavar="FILE", help="write the row of one scene, .csv or .json"
    )
    parser.add_argument(
        "--verify", action="store_true", help="topple them in a rigid-body engine; a table"
    )
    parser.add_argument(
        "--steps", type=float, nargs="+", metavar="US", help="of the engine's time [µs] (40 20)"
    )
    parser.add_argument("--json", metavar="FILE", help="write the verifications there")
    parser.add_argument(
        "--update", action="store_true", help="write them into the package, for docs and reports"
    )


def run(arguments: argparse.Namespace) -> int:
    """List, write or verify; 1 if a verified row differs in earnest."""
    from pathlib import Path

    from optimize.records.shipped import best_known

    records = best_known()
    unknown = [name for name in arguments.scenes if name not in records]
    if unknown:
        raise ValueError(f"no row is known of '{unknown[0]}'; known are {', '.join(records)}")
    wanted = {name: records[name] for name in arguments.scenes or records}
    if (arguments.update or arguments.json or arguments.steps) and not arguments.verify:
        raise ValueError("--steps, --json and --update go with --verify")
    if arguments.layout:
        if len(arguments.scenes) != 1:
            raise ValueError("--layout writes one row: name one scene")
        path = Path(arguments.layout)
        if path.suffix not in (".csv", ".json"):
            raise ValueError(f"{path}: a layout's file ends in .csv or .json")
        (row,) = wanted.values()
        (row.layout.to_csv if path.suffix == ".csv" else row.layout.to_json)(path)
        print(f"written to {path}")
        return 0
    if not arguments.verify:
        _list(wanted)
        return 0
    return _verify(wanted, arguments)


def _list(records: dict[str, BestKnown]) -> None:
    from domino_env.rigid.known import known_verification
    from domino_env.scenes.files.reading import load_scene
    from domino_env.support.tables import text_table

    rows = []
    for name, record in records.items():
        scene = load_scene(name)
        told = scene.in_words(record.score, scene.simulate(record.layout))
        one = known_verification(record.layout, scene.physics)
        checked = "not verified" if one is None else f"at most {one.largest:.3%} off"
        rows.append((name, told, record.method, checked))
    print("\n".join(text_table(("scene", "best known", "by", "hinged engine over ours"), rows)))


def _verify(records: dict[str, BestKnown], arguments: argparse.Namespace) -> int:
    from pathlib import Path

    from domino_env.rigid.comparison import AGREES, STEPS
    from domino_env.rigid.known import markdown, read_verified, write_verified

    steps = [h * 1e-6 for h in arguments.steps] if arguments.steps else STEPS
    found = verify_records(records, steps)
    print("\n".join(markdown(found)))
    close = sum(one.largest <= AGREES for one in found.values())
    print(f"\n{close} of {len(found)} rows agree within {AGREES:.1%} at every hit")
    if arguments.json:
        write_verified(found, Path(arguments.json))
    if arguments.update:
        write_verified(read_verified() | found)
    return 1 if any(one.verdict.startswith("DIFFERS") for one in found.values()) else 0


def verify_records(records: dict[str, BestKnown], steps: Sequence[float]) -> dict[str, Verified]:
    """Topple every row in the engine, and print a line when one is done."""
    from domino_env.rigid.comparison import verify
    from domino_env.rigid.known import summary
    from domino_env.scenes.files.reading import load_scene

    found = {}
    for name, record in records.items():
        found[name] = summary(verify(record.layout, load_scene(name).physics, steps))
        print(f"{name}: {found[name].verdict}", flush=True)
    return found
