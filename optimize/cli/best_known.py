"""List the best known layouts, or write one.

The last column of the list is the largest difference of an arrival time in the reference simulator,
in which closed contacts may open, on fixed pivots.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from domino_env.cli.options import LAYOUT_FILE, add_options

if TYPE_CHECKING:
    from optimize.experiments.best_known import BestKnown


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino best-known`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="name of a scene (all scenes)")
    target = "write the layout of one scene to a .csv or .json file"
    add_options(parser, ("layout", LAYOUT_FILE, "FILE", None, target))


def run(arguments: argparse.Namespace) -> int:
    """List the layouts, or write one."""
    from domino_env.core.checks import require_choice
    from domino_env.scenes.io.reading import load_scene, write_layout
    from optimize.experiments.best_known import best_known

    known = best_known()
    for name in arguments.scenes:
        require_choice("SCENE", name, known)
    if arguments.layout is None:
        print("\n".join(_table({name: known[name] for name in arguments.scenes or known})))
        return 0
    if len(arguments.scenes) != 1:
        raise ValueError(f"--layout writes one layout, not {len(arguments.scenes)}: give one SCENE")
    (name,) = arguments.scenes
    scene_file = write_layout(known[name].layout, arguments.layout, load_scene(name))
    print(f"written to {arguments.layout}, the scene to {scene_file}")
    return 0


def _table(known: dict[str, BestKnown]) -> list[str]:
    """Return the lines of a table of the best known layouts."""
    from domino_env.core.tables import text_table
    from domino_env.rigid.known import known_verification
    from domino_env.scenes.io.reading import load_scene

    lines = []
    for name, best in known.items():
        scene = load_scene(name)
        score = scene.format_score(best.score, scene.simulate(best.layout))
        verification = known_verification(best.layout, scene.physics)
        difference = "not verified"
        if verification is not None:
            difference = f"at most {verification.checks[0].largest:.3%} apart"
        lines.append((name, score, best.method, difference))
    return text_table(("scene", "best known", "method", "reference simulator"), lines)
