"""Compare the layout that an agent builds with the best uniform and the best known layout.

RUN is the folder of a training, the name of a policy that ships (sprint, designer), or a scripted
policy: uniform, greedy, ramp. A .zip archive of stable-baselines3 runs code when it is loaded and
needs --trust. `designer` designs a layout for a new --scene in milliseconds; --scenes evaluates it
on many scenes that it was not trained on, as it does policies trained on `varied`.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from optimize.cli.options import write_layout

if TYPE_CHECKING:
    from agents.designer.policy import ConditionedPolicy
    from agents.policy import ScenePolicy
    from agents.rollout import Rollout

SUMMARY = "evaluate a trained agent or a scripted policy"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino evaluate`."""
    parser.add_argument(
        "agent", metavar="RUN",
        help="folder of a training; sprint or designer, which ship; uniform, greedy or ramp",
    )  # fmt: skip
    parser.add_argument("--scene", help="another scene than that of the training")
    parser.add_argument("--trust", action="store_true", help="load an archive that may run code")
    parser.add_argument("--layout", metavar="FILE", help="write the layout, .csv or .json")
    many = parser.add_argument_group("evaluation on many scenes, of a policy trained on many")
    many.add_argument("--scenes", type=int, metavar="N", help="number of scenes")
    many.add_argument(
        "--distribution", metavar="NAME",
        help="varied, varied-thickness, varied-course, or a file (that of the training, or varied)",
    )  # fmt: skip
    many.add_argument("--seed", type=int, help="sample the scenes (the first N of the test set)")
    many.add_argument(
        "--budget", type=int, metavar="N",
        help="search each scene too, with N evaluations (scores of 2500 ship with the test sets)",
    )  # fmt: skip
    many.add_argument("--csv", metavar="FILE", help="write one line per scene")


def run(arguments: argparse.Namespace) -> int:
    """Build, and say what came of it."""
    from agents.designer.features import outside
    from agents.designer.policy import ConditionedPolicy
    from agents.evaluation import load_policy
    from agents.policy import ScenePolicy
    from agents.scripted import ScriptedPolicy
    from domino_env import SceneDistribution, load_scene

    policy = load_policy(arguments.agent, trust=arguments.trust)
    conditioned = isinstance(policy, ConditionedPolicy)
    if arguments.scenes is not None:
        drawn = isinstance(policy, ScenePolicy) and isinstance(policy.scene, SceneDistribution)
        if isinstance(policy, ScriptedPolicy) or not (conditioned or drawn):
            raise ValueError(
                "--scenes evaluates a policy that was trained on many scenes: "
                f"{arguments.agent} is none"
            )
        return _evaluate_scenes(policy, arguments)
    name = arguments.scene
    if name is None and (conditioned or isinstance(policy, ScriptedPolicy)):
        name = "sprint"
    scene = None if name is None else load_scene(name)
    built = policy.build(scene)
    if conditioned:
        for difference in outside(built.scene):
            print(f"beyond what it was trained on: {difference}")
    print(sentence(built))
    if arguments.layout:
        write_layout(built.layout, arguments.layout)
        print(f"row written to {arguments.layout}")
    return 0


def _evaluate_scenes(policy: ConditionedPolicy | ScenePolicy, arguments: argparse.Namespace) -> int:
    """Its rows in many random scenes, as a table."""
    from agents.evaluation import evaluate_scenes, scenes_of, searched_scores

    number, seed = arguments.scenes, arguments.seed
    given = arguments.distribution or getattr(policy, "scene", None) or "varied"
    name = str(getattr(given, "name", given))
    found = evaluate_scenes(
        scenes_of(given, number, seed),
        policy,
        budget=arguments.budget,
        searched=searched_scores(name, number) if seed is None else None,
        progress=None,
    )
    print(found.table())
    if arguments.csv:
        found.save(Path(arguments.csv))
        print(f"scenes written to {arguments.csv}")
    return 0


def sentence(built: Rollout) -> str:
    """Say score, gain over uniform, gap to the best known."""
    from domino_env.scenes.uniform import gain, gain_in_words
    from optimize.experiments.best_known import best_known

    words = f"{built.scene.name}: score {built.score:.6f} ({built.wave.outcome.name})"
    if built.gain is not None:
        words += f", {gain_in_words(built.gain)} the best uniform row ({built.uniform.score:.6f})"
    known = best_known().get(built.scene.name)
    gap = None if known is None else gain(built.score, known.score)
    if known is not None and gap is not None:
        words += f", {gain_in_words(gap, 3)} the best known ({known.score:.6f})"
    return f"{words}; built in {built.seconds * 1e3:.1f} ms"
