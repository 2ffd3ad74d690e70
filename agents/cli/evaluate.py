"""Compare the layout that an agent builds with the uniform baseline and the best known layout.

RUN is the folder of a training, the name of a shipped policy (sprint, designer), a scripted policy,
or an archive (.zip) of Stable-Baselines3 or sb3-contrib with a --scene. Scripted policies are
uniform, greedy, ramp, plan (best known layout), controller (keeps a schedule) and rule (takes
pieces from a hand). Plain multilayer perceptrons are read without running code, other archives need
--trust. `designer` designs a layout for a new --scene in milliseconds. --scenes evaluates it, or a
policy trained on `varied`, on many scenes that it was not trained on.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from domino_env.cli.options import LAYOUT_FILE, NATURAL, SEED, output

if TYPE_CHECKING:
    from agents.designer.policy import Designer
    from agents.policy import ScenePolicy
    from agents.rollout import Rollout
    from agents.scripted import ScriptedPolicy

SUMMARY = "evaluate a trained agent or a scripted policy"
TEST_SCENES = 200  # scenes of a test set that are evaluated


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino evaluate`."""
    parser.add_argument(
        "agent", metavar="RUN",
        help="folder of a training; sprint or designer, as shipped; uniform, greedy, ramp, plan, "
        "controller or rule",
    )  # fmt: skip
    parser.add_argument(
        "--scene",
        help="another scene than that of the training, or a distribution for its test set",
    )
    parser.add_argument(
        "--trust", action="store_true", help="run the code in an archive where its policy needs it"
    )
    parser.add_argument(
        "--layout", type=LAYOUT_FILE, metavar="FILE", help="write the layout, .csv or .json"
    )
    many = parser.add_argument_group("evaluation on many scenes, of a policy trained on many")
    many.add_argument("--scenes", type=NATURAL, metavar="N", help="number of scenes")
    many.add_argument(
        "--distribution", metavar="NAME",
        help="varied, varied-thickness, varied-course, or a file (that of the training, or varied)",
    )  # fmt: skip
    many.add_argument("--seed", type=SEED, help="sample the scenes (the first N of the test set)")
    many.add_argument("--csv", type=output(".csv"), metavar="FILE", help="write one line per scene")


def run(arguments: argparse.Namespace) -> int:
    """Build one layout or many, and print their scores."""
    from agents.designer.features import outside
    from agents.designer.policy import Designer
    from agents.evaluation import load_policy
    from agents.policy import ScenePolicy
    from domino_env import SceneDistribution, load_scene
    from domino_env.scenes.distribution import load_any, load_distribution

    scene = None if arguments.scene is None else load_any(arguments.scene)
    if isinstance(scene, SceneDistribution):
        arguments.distribution, scene = arguments.scene, None
        arguments.scenes = arguments.scenes or TEST_SCENES
    sampled = arguments.distribution and load_distribution(arguments.distribution)
    policy = load_policy(arguments.agent, trust=arguments.trust, distribution=sampled)
    if arguments.scenes is not None:
        return _evaluate_scenes(policy, arguments)
    if isinstance(policy, ScenePolicy):
        rollout = policy.build(scene)
    else:
        rollout = policy.build(scene or load_scene("sprint"))
    if isinstance(policy, Designer):
        for difference in outside(rollout.scene):
            print(f"outside the scenes of its training: {difference}")
    print(sentence(rollout))
    if arguments.layout:
        from domino_env.scenes.io.reading import write_layout

        beside = write_layout(rollout.layout, arguments.layout, rollout.scene)
        print(f"layout written to {arguments.layout}, the scene to {beside}")
    return 0


def _evaluate_scenes(
    policy: ScenePolicy | Designer | ScriptedPolicy, arguments: argparse.Namespace
) -> int:
    """Print a table of the scores in many scenes."""
    from agents.evaluation import evaluate_scenes, scenes_of, searched_scores
    from domino_env import SceneDistribution

    number, seed = arguments.scenes, arguments.seed
    trained_on = getattr(policy, "scene", None)
    source = arguments.distribution or "varied"
    if arguments.distribution is None and isinstance(trained_on, SceneDistribution):
        source = trained_on
    name = source if isinstance(source, str) else source.name
    searched = searched_scores(name, number) if seed is None else None
    evaluation = evaluate_scenes(scenes_of(source, number, seed), policy, searched, progress=None)
    print(evaluation.table())
    if arguments.csv:
        evaluation.save(Path(arguments.csv))
        print(f"scenes written to {arguments.csv}")
    return 0


def sentence(rollout: Rollout) -> str:
    """Return a score, its gain over the uniform baseline and its distance to the best known.

    Where episodes are random, the best known is the plan that reacts to nothing, as it is built.
    """
    from agents.rollout import evaluation_seeds
    from agents.scripted import plan
    from domino_env.scenes.uniform import gain, gain_in_words
    from optimize.experiments.best_known import best_known

    scene, score, uniform = rollout.scene, rollout.score, rollout.uniform.score
    words = f"{scene.name}: score {score:.6f} ({rollout.wave.outcome.name})"
    if rollout.gain is not None:
        words += f", {gain_in_words(rollout.gain)} the uniform baseline ({uniform:.6f})"
    known = best_known().get(scene.name)
    best: float | None = None if known is None else known.score
    which = "the best known"
    if (number := len(evaluation_seeds(scene))) > 1:
        best, which = None, f"the open-loop plan over the same {number} episodes"
        with suppress(ValueError):  # the scene has no plan
            best = plan(scene).score
    gap = None if best is None else gain(score, best)
    if gap is not None:
        words += f", {gain_in_words(gap, 3)} {which} ({best:.6f})"
    return f"{words}; built in {rollout.seconds * 1e3:.1f} ms"
