"""What an agent builds, beside the best uniform row and the best row known.

RUN is the folder of a training, the name of a policy that ships (sprint, family), or a scripted
builder: uniform, greedy, ramp. A .zip archive of stable-baselines3 runs code when it is loaded and
asks for --trust. `family` designs a row for a new --scene in milliseconds; with --scenes it is
evaluated on many that were not in its training.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agents.conditioned.policy import Designer
    from agents.single.evaluation import Built

SUMMARY = "what a trained agent, or a scripted builder, builds"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino evaluate`."""
    parser.add_argument(
        "agent",
        metavar="RUN",
        help="a training's folder; sprint or family, which ship; uniform, greedy or ramp",
    )
    parser.add_argument("--scene", help="another scene than it was trained on")
    parser.add_argument("--trust", action="store_true", help="load an archive that may run code")
    parser.add_argument("--layout", metavar="FILE", help="write the row, .csv or .json")
    many = parser.add_argument_group("a policy taught over a family of scenes")
    many.add_argument("--scenes", type=int, metavar="N", help="judge it on N random scenes")
    many.add_argument("--seed", type=int, default=1, help="that these are drawn with (1)")
    many.add_argument("--search", type=int, metavar="E", help="search each too, E evaluations")
    many.add_argument("--csv", metavar="FILE", help="write a line for each scene")


def run(arguments: argparse.Namespace) -> int:
    """Build, and say what came of it."""
    from pathlib import Path

    from agents.conditioned.evaluation import designer_of
    from agents.single.evaluation import evaluate
    from agents.single.scripted import BUILDERS
    from domino_env.scenes.files.reading import load_scene

    designer = None if arguments.agent in BUILDERS else designer_of(arguments.agent)
    if designer is not None and arguments.scenes is not None:
        return _judge(designer, arguments)
    if arguments.scenes is not None:
        raise ValueError(
            f"--scenes judges a policy taught over a family: {arguments.agent} is none"
        )
    if designer is not None:
        built = _designed(designer, arguments.scene)
    elif arguments.agent in BUILDERS:
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


def _judge(designer: Designer, arguments: argparse.Namespace) -> int:
    """Its rows in many random scenes, as a table."""
    import sys
    from pathlib import Path

    from agents.conditioned.evaluation import judge

    judged = judge(
        arguments.scenes,
        arguments.seed,
        designer,
        evaluations=arguments.search,
        progress=sys.stderr.isatty(),
    )
    print(judged.table())
    if arguments.csv:
        judged.save(Path(arguments.csv))
        print(f"scenes written to {arguments.csv}")
    return 0


def _designed(designer: Designer, name: str | None) -> Built:
    """Its row for one scene."""
    from agents.conditioned.policy import design
    from agents.single.evaluation import Built
    from domino_env.scenes.files.reading import load_scene

    scene = load_scene(name or "sprint")
    design(scene, designer=designer)  # compiles what is not compiled yet
    found = design(scene, designer=designer)
    for sentence in found.outside:
        print(f"beyond what was taught: {sentence}")
    return Built(scene, found.layout, found.wave, found.score, scene.uniform(), found.seconds)


def sentence(built: Built) -> str:
    """Say score, gain over uniform, gap to the best known."""
    from domino_env.scenes.baseline import gain
    from optimize.records.shipped import best_known

    words = f"{built.scene.name}: score {built.score:.6f} ({built.wave.outcome.name})"
    if built.gain is not None:
        words += f", {built.gain:+.2%} over the best uniform row ({built.uniform.score:.6f})"
    known = best_known().get(built.scene.name)
    gap = None if known is None else gain(built.score, known.score)
    if known is not None and gap is not None:
        words += f", {gap:+.3%} from the best known ({known.score:.6f})"
    return f"{words}; built in {built.seconds * 1e3:.1f} ms"
