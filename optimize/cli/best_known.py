"""The best layouts known of the scenes that ship: list them, write one down, verify them.

--verify topples each, and the best uniform row beside it, hinged and on floors, in the simulator
of standing rows, which keeps no contact closed; with --engine in somebody else's rigid-body engine
(extra 'verify') too.  Of a row of more than a hundred dominoes the first hundred are looked at.
With --update what was found is kept in the package.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from domino_env.cli.verify import add_engine_options, add_floor_option, asked_engine

if TYPE_CHECKING:
    from optimize.experiments.best_known import BestKnown

SUMMARY = "the best layouts known: list, write, verify"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino best-known`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="names (all)")
    parser.add_argument(
        "--layout", metavar="FILE", help="write the row of one scene, .csv or .json"
    )
    parser.add_argument(
        "--verify", action="store_true", help="topple them hinged and on floors; a table"
    )
    add_floor_option(parser)
    add_engine_options(parser, default=False, told="minutes a row")
    parser.add_argument("--json", metavar="FILE", help="write the verifications there")
    parser.add_argument(
        "--update", action="store_true", help="write them into the package, for docs and reports"
    )


def run(arguments: argparse.Namespace) -> int:
    """List, write or verify; 1 if a verified row differs in earnest."""
    from pathlib import Path

    from optimize.experiments.best_known import best_known

    records = best_known()
    unknown = [name for name in arguments.scenes if name not in records]
    if unknown:
        raise ValueError(f"no row is known of '{unknown[0]}'; known are {', '.join(records)}")
    wanted = {name: records[name] for name in arguments.scenes or records}
    asked = (arguments.update, arguments.json, arguments.engine, arguments.steps)
    if any(asked) and not arguments.verify:
        raise ValueError("--engine, --steps, --json and --update go with --verify")
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
    from domino_env.core.tables import text_table
    from domino_env.rigid.known import known_verification
    from domino_env.scenes.io.reading import load_scene

    rows = []
    for name, record in records.items():
        scene = load_scene(name)
        told = scene.in_words(record.score, scene.simulate(record.layout))
        one = known_verification(record.layout, scene.physics)
        checked = "not verified" if one is None else f"at most {one.hinged.best.largest:.3%} off"
        rows.append((name, told, record.method, checked))
    print("\n".join(text_table(("scene", "best known", "by", "hinged, without the model"), rows)))


def _verify(records: dict[str, BestKnown], arguments: argparse.Namespace) -> int:
    """Check, keep and tabulate; 1 if a row differs in earnest."""
    from pathlib import Path

    from domino_env.rigid.known import read_verified, write_verified
    from domino_env.rigid.tables import engine_table, floors_table, hinged_table
    from domino_env.scenes.io.reading import load_scene
    from optimize.records.verification import verify_records

    if arguments.steps or arguments.share or arguments.sweeps:
        arguments.engine = True
    engine = asked_engine(arguments, quiet=True)
    scenes = {name: load_scene(name) for name in records}
    found = verify_records(records, scenes, arguments.floor, engine)
    if arguments.json:
        write_verified(found, Path(arguments.json))
    if arguments.update:
        write_verified(read_verified() | found)
    for lines in (floors_table(found), hinged_table(found), engine_table(found)):
        print("\n" + "\n".join(lines))
    words = [one.verdict.partition(":")[0] for one in found.values()]
    counted = ", ".join(f"{words.count(word)} {word.lower()}" for word in sorted(set(words)))
    differ = [name for name, word in zip(found, words, strict=True) if word == "DIFFERS"]
    print(f"\nhinged, of {len(found)} rows: {counted}")
    if differ:
        print(f"differ from the model in earnest (exit code 1): {', '.join(differ)}")
    return 1 if differ else 0
