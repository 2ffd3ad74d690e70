"""List, write and verify the best known layouts.

--verify simulates each layout and the uniform baseline of its scene with the reference simulator,
in which closed contacts may open, on fixed pivots and free-standing on floors. --engine adds a
third-party engine (extra 'verify'). Only the first hundred dominoes of longer layouts are
simulated.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING

from domino_env.cli.options import LAYOUT_FILE, add_flags, add_json_option, add_options, write_json
from domino_env.cli.verify import FLOORS, add_simulator_options, read_floors

if TYPE_CHECKING:
    from domino_env.scenes.scene import Scene
    from optimize.experiments.best_known import BestKnown


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino best-known`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="name of a scene (all scenes)")
    target = "write the layout of one scene to a .csv or .json file"
    add_options(parser, ("layout", LAYOUT_FILE, "FILE", None, target))
    add_flags(parser, verify="simulate the layouts as rigid bodies")
    add_simulator_options(parser, engine=False, note="minutes per layout")
    add_json_option(parser)
    add_flags(parser, update="store the results of --verify in the package")


def run(arguments: argparse.Namespace) -> int:
    """List, write or verify the layouts; return 1 if a simulator contradicts the model, else 0."""
    from domino_env.core.checks import require_choice
    from domino_env.scenes.io.reading import load_scene, write_layout
    from optimize.experiments.best_known import best_known

    known = best_known()
    for name in arguments.scenes:
        require_choice("SCENE", name, known)
    selection = {name: known[name] for name in arguments.scenes or known}
    has_floors = arguments.floor != read_floors(FLOORS)
    own = arguments.update, arguments.json, arguments.engine, has_floors
    if any(own) and not arguments.verify:
        raise ValueError("--engine, --floor, --json and --update need --verify: add it")
    if arguments.layout and len(arguments.scenes) != 1:
        raise ValueError(f"--layout writes one layout, not {len(arguments.scenes)}: give one SCENE")
    scenes = {name: load_scene(name) for name in selection}
    if arguments.layout:
        ((name, best),) = selection.items()
        scene_file = write_layout(best.layout, arguments.layout, scenes[name])
        print(f"written to {arguments.layout}, the scene to {scene_file}")
        return 0
    if arguments.verify:
        return _verify(selection, scenes, arguments)
    print("\n".join(_table(selection, scenes)))
    return 0


def _table(known: dict[str, BestKnown], scenes: dict[str, Scene]) -> list[str]:
    """Return the lines of a table of the best known layouts."""
    from domino_env.core.tables import text_table
    from domino_env.rigid.known import known_verification

    lines = []
    for name, best in known.items():
        scene = scenes[name]
        score = scene.format_score(best.score, scene.simulate(best.layout))
        verification = known_verification(best.layout, scene.physics)
        difference = "not verified"
        if verification is not None:
            difference = f"at most {verification.checks[0].largest:.3%} apart"
        lines.append((name, score, best.method, difference))
    return text_table(("scene", "best known", "method", "reference simulator"), lines)


def _verify(
    known: dict[str, BestKnown], scenes: dict[str, Scene], arguments: argparse.Namespace
) -> int:
    """Verify layouts and print a table; return 1 if a simulator contradicts the model."""
    from domino_env.rigid.engine import engine_name
    from domino_env.rigid.known import known_table, read_verified, write_verified
    from optimize.experiments.verification import verify_best_known

    if arguments.engine:
        engine_name()  # raises at once if the engine is not installed
    report = partial(print, file=sys.stderr if arguments.json == "-" else sys.stdout)
    verifications = verify_best_known(known, scenes, arguments.floor, arguments.engine, report)
    if arguments.json:
        write_json({name: asdict(checks) for name, checks in verifications.items()}, arguments.json)
    if arguments.update:
        write_verified(read_verified() | verifications)
    verdicts = Counter(checks.verdict.partition(":")[0] for checks in verifications.values())
    if arguments.json != "-":
        counts = ", ".join(f"{n} {verdict.lower()}" for verdict, n in sorted(verdicts.items()))
        print("\n" + "\n".join(known_table(verifications)))
        print(f"\nlayouts on fixed pivots: {counts}")
    return int(verdicts["DIFFERS"] > 0)
