"""Evaluate a trained or scripted policy.

Its layout is compared with the uniform baseline and the best known layout. RUN is the folder of a
training, the name of a shipped policy (sprint, designer), a scripted policy, or an archive (.zip)
of Stable-Baselines3 or sb3-contrib, which needs --scene. Scripted policies are uniform, ramp, plan
(best known layout), controller (keeps a schedule) and rule (takes pieces from a hand).
Archives with plain multilayer perceptrons are read without running code; others need --trust.
`designer` designs a layout for a new --scene in milliseconds. --scenes evaluates a policy in many
scenes that were not used in its training.
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from typing import TYPE_CHECKING

from domino_env.cli.options import LAYOUT_FILE, NATURAL, WHOLE, add_flags, add_options

if TYPE_CHECKING:
    from agents.designer.policy import Designer
    from agents.policy import ScenePolicy
    from agents.rollout import Rollout
    from agents.scripted import ScriptedPolicy


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino evaluate`."""
    parser.add_argument(
        "agent", metavar="RUN",
        help="folder of a training; sprint or designer, as shipped; uniform, ramp, plan, "
        "controller or rule",
    )  # fmt: skip
    scene = "another scene than that of the training, or a distribution for its test set"
    target = "write the layout, .csv or .json"
    names = "varied, varied-thickness, varied-course, or a file (that of the training, or varied)"
    seed = "sample the scenes (the first N of the test set)"
    add_flags(parser, trust="run the code in an archive if its policy needs it")
    add_options(
        parser, ("scene", str, "SCENE", None, scene), ("layout", LAYOUT_FILE, "FILE", None, target)
    )
    add_options(
        parser.add_argument_group("evaluation in many scenes"),
        ("scenes", NATURAL, "N", None, "number of scenes"),
        ("distribution", str, "NAME", None, names),
        ("seed", WHOLE, "N", None, seed),
    )


def run(arguments: argparse.Namespace) -> int:
    """Build one layout or many, and print their scores."""
    from agents.designer.features import range_violations
    from agents.designer.policy import Designer
    from agents.evaluation import load_policy
    from agents.policy import ScenePolicy
    from domino_env import Scene, SceneDistribution, load_scene
    from domino_env.scenes.distribution import load_any, load_distribution

    scene = None if arguments.scene is None else load_any(arguments.scene)
    source = arguments.distribution and load_distribution(arguments.distribution)
    is_sampled = isinstance(scene, SceneDistribution)
    many = is_sampled or arguments.scenes is not None
    if arguments.scenes is not None and isinstance(scene, Scene):
        raise ValueError(
            "--scenes: leave out --scene, or name a scene distribution in place of a single scene"
        )
    if source and (is_sampled or not (many or arguments.agent.endswith(".zip"))):
        raise ValueError(
            "--distribution: leave it out; it is for --scenes without --scene, and for archives"
        )
    if isinstance(scene, SceneDistribution):
        source, scene = scene, None
    policy = load_policy(
        arguments.agent, trust=arguments.trust, distribution=None if many else source
    )
    name = "layout" if many else "seed"
    if getattr(arguments, name) is not None:
        raise ValueError(f"--{name}: leave it out {'with' if many else 'without'} --scenes")
    if many:
        return _evaluate_scenes(policy, source or getattr(policy, "scene", None), arguments)
    if isinstance(policy, ScenePolicy):
        rollout = policy.build(scene)
    else:
        rollout = policy.build(scene or load_scene("sprint"))
    if isinstance(policy, Designer):
        for difference in range_violations(rollout.scene):
            print(f"outside the scenes of its training: {difference}")
    print(describe(rollout))
    if arguments.layout:
        from domino_env.scenes.io.reading import write_layout

        scene_file = write_layout(rollout.layout, arguments.layout, rollout.scene)
        print(f"layout written to {arguments.layout}, the scene to {scene_file}")
    return 0


def _evaluate_scenes(
    policy: ScenePolicy | Designer | ScriptedPolicy, source: object, arguments: argparse.Namespace
) -> int:
    """Print a table of the scores in many scenes."""
    from agents.evaluation import choose_scenes, evaluate_scenes, read_search_scores
    from agents.policy import ScenePolicy
    from domino_env import SceneDistribution, load_distribution

    if not isinstance(source, SceneDistribution):  # no policy for sampled scenes
        source = load_distribution("varied")
    if isinstance(policy, ScenePolicy) and policy.scene is None:  # an archive
        policy = policy.trained_on(source)
    scenes = choose_scenes(source, arguments.scenes, arguments.seed)
    known = read_search_scores(source.name, len(scenes)) if arguments.seed is None else None
    print(evaluate_scenes(scenes, policy, known, progress=None).table())
    return 0


def describe(rollout: Rollout) -> str:
    """Return a line with the score of a layout, compared with two references.

    One is the uniform baseline. The other is the best known layout or, if episodes are random, the
    open-loop plan over the same episodes.

    Parameters
    ----------
    rollout
        The layout and its score.
    """
    from agents.rollout import evaluation_seeds
    from agents.scripted import plan
    from optimize.experiments.best_known import best_known_of

    scene, score, criterion = rollout.scene, rollout.score, rollout.scene.criterion
    uniform, number = rollout.uniform.score, len(evaluation_seeds(scene))
    kind = rollout.wave.outcome.name if number == 1 else f"mean of {number} episodes"
    texts = [f"{scene.name}: {criterion.label(score)} ({kind})"]
    texts.append(criterion.compare(score, uniform, "the uniform baseline", detailed=True))
    known = best_known_of(scene)
    best: float | None = None if known is None else known.score
    reference = "the best known"
    if number > 1:
        best, reference = None, f"the open-loop plan over the same {number} episodes"
        with suppress(ValueError):  # there is no plan for the scene
            best = plan(scene).score
    if best is not None:
        texts.append(criterion.compare(score, best, reference, 3, detailed=True))
    return f"{', '.join(filter(None, texts))}; built in {rollout.seconds * 1e3:.1f} ms"
