"""What an agent builds, beside the best uniform row and the best row known.

RUN is the folder of a training, the name of a policy that ships (sprint), or a scripted builder:
uniform, greedy, ramp.  A .zip archive of
stable-baselines3 runs code when it is loaded and asks for --trust.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agents.evaluation import Built

SUMMARY = "what a trained agent, or a scripted builder, builds"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `domino evaluate`."""
    parser.add_argument(
        "agent",
        metavar="RUN",
        help="a training's folder; sprint, which ships; uniform, greedy or ramp",
    )
    parser.add_argument("--scene", help="another scene than it was trained on")
    parser.add_argument("--trust", action="store_true", help="load an archive that may run code")
    parser.add_argument("--layout", metavar="FILE", help="write the row, .csv or .json")


def run(arguments: argparse.Namespace) -> int:
    """Build, and say what came of it."""
    from pathlib import Path

    from agents.builders import BUILDERS
    from agents.evaluation import evaluate
    from domino_env.scene import load_scene

    if arguments.agent in BUILDERS:
        built = BUILDERS[arguments.agent](load_scene(arguments.scene or "sprint"))
    else:
        built = evaluate(arguments.agent, arguments.scene, trust=arguments.trust)
    print(sentence(built))
    if arguments.layout:
        path = Path(arguments.layout)
        if path.suffix not in (".csv", ".json"):
            raise ValueError(f"{path}: a layout's file ends in .csv or .json")
        (built.layout.to_csv if path.suffix == ".csv" else built.layout.to_json)(path)
        print(f"row written to {path}")
    return 0


def sentence(built: Built) -> str:
    """Score, gain over uniform, gap to the best known."""
    from optimize.best_known import best_known

    words = f"{built.scene.name}: score {built.score:.6f} ({built.wave.outcome.name})"
    if built.gain is not None:
        words += f", {built.gain:+.2%} over the best uniform row ({built.uniform.score:.6f})"
    known = best_known().get(built.scene.name)
    if known is not None and known.score > 0.0 < built.score:
        words += f", {built.score / known.score - 1.0:+.3%} from the best known ({known.score:.6f})"
    return f"{words}; built in {built.seconds * 1e3:.1f} ms"
