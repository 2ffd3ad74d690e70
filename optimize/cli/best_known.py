"""List the best known layouts of the scenes that ship, write one of them, or verify them.

--verify simulates each, and the best uniform layout beside it, on fixed pivots and on floors with
the reference simulator, which keeps no contact closed; with --engine a third-party engine (extra
'verify') does so too. Of a layout of more than a hundred dominoes the first hundred are simulated.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

from domino_env.cli.options import add_json_option, write_json
from domino_env.cli.verify import add_simulator_options
from optimize.cli.options import write_layout

if TYPE_CHECKING:
    from optimize.experiments.best_known import BestKnown

SUMMARY = "list, write and verify the best known layouts"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino best-known`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="name of a scene (all)")
    parser.add_argument(
        "--layout", metavar="FILE", help="write the layout of one scene, .csv or .json"
    )
    parser.add_argument(
        "--verify", action="store_true", help="simulate the layouts without the model"
    )
    add_simulator_options(parser, engine=False, when="minutes per layout")
    add_json_option(parser)
    parser.add_argument(
        "--update", action="store_true", help="keep the verifications in the package"
    )


def run(arguments: argparse.Namespace) -> int:
    """List, write or verify; 1 if a verified row differs in earnest."""
    from optimize.experiments.best_known import best_known

    records = best_known()
    unknown = [name for name in arguments.scenes if name not in records]
    if unknown:
        raise ValueError(f"no layout is known of '{unknown[0]}'; known are {', '.join(records)}")
    wanted = {name: records[name] for name in arguments.scenes or records}
    if any((arguments.update, arguments.json, arguments.engine)) and not arguments.verify:
        raise ValueError("--engine, --json and --update go with --verify")
    if arguments.layout:
        if len(arguments.scenes) != 1:
            raise ValueError("--layout writes one row: name one scene")
        (record,) = wanted.values()
        write_layout(record.layout, arguments.layout)
        print(f"written to {arguments.layout}")
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
        checked = "not verified" if one is None else f"at most {one.checks[0].largest:.3%} apart"
        rows.append((name, told, record.method, checked))
    print("\n".join(text_table(("scene", "best known", "by", "without the model"), rows)))


def _verify(records: dict[str, BestKnown], arguments: argparse.Namespace) -> int:
    """Check, keep and tabulate; 1 if a row differs in earnest."""
    from domino_env.rigid.engine import engine_name
    from domino_env.rigid.known import known_table, read_verified, write_verified
    from domino_env.scenes.io.reading import load_scene
    from optimize.experiments.verification import verify_records

    if arguments.engine:
        engine_name()  # says what to install before time is spent
    scenes = {name: load_scene(name) for name in records}
    report = partial(print, file=sys.stderr if arguments.json == "-" else sys.stdout)
    found = verify_records(records, scenes, arguments.floor, arguments.engine, report)
    if arguments.json:
        write_json({name: asdict(one) for name, one in found.items()}, arguments.json)
    if arguments.update:
        write_verified(read_verified() | found)
    if arguments.json == "-":
        return int(any(one.verdict.startswith("DIFFERS") for one in found.values()))
    print("\n" + "\n".join(known_table(found)))
    words = [one.verdict.partition(":")[0] for one in found.values()]
    counted = ", ".join(f"{words.count(word)} {word.lower()}" for word in sorted(set(words)))
    differ = [name for name, word in zip(found, words, strict=True) if word == "DIFFERS"]
    print(f"\non fixed pivots, of {len(found)} layouts: {counted}")
    if differ:
        print(f"differ from the model in earnest (exit code 1): {', '.join(differ)}")
    return 1 if differ else 0
