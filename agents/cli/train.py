"""Train an agent that builds rows for a scene, and write down what it learned.

SCENE `designer` trains the policy of `agents.design` over random scenes, in a way of its own, whose
batches are its steps.

Needs the extra "rl". Ctrl-C ends the training with the best policy so far; --resume goes on.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from agents.base.shipped import DESIGNER, OLD_NAMES

if TYPE_CHECKING:
    from agents.base.training import TrainingRun

SUMMARY = "train an agent that builds rows (APG, PPO, ARS)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino train`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene's name or .toml file; designer")
    parser.add_argument("--algorithm", default="ppo", help="ppo (default), apg, ars")
    parser.add_argument("--steps", type=int, help="dominoes to place in all")
    parser.add_argument("--seed", type=int, default=0, help="of all randomness (0)")
    parser.add_argument("--out", metavar="FOLDER", help="the run's folder (runs/SCENE-ALGORITHM)")
    parser.add_argument(
        "--warm-start",
        metavar="ROW",
        help="begin as a clone of a row: a layout's file, a run's folder, auto, best-known (PPO); "
        "designer: with the weights of another, a run's folder or designer, which ships",
    )
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint there")


def run(arguments: argparse.Namespace) -> int:
    """Train, and say what came of it."""
    from domino_env import SceneDistribution
    from domino_env.scenes.distribution import load_any

    conditioned = arguments.scene == DESIGNER or arguments.scene in OLD_NAMES
    if conditioned:
        done = _conditioned(arguments)
    elif isinstance(load_any(arguments.scene), SceneDistribution):
        done = _drawn(arguments)
    else:
        done = _single(arguments)
    print(
        f"{'interrupted after ' if done.interrupted else ''}{done.steps:,} "
        f"{'steps' if conditioned else 'dominoes placed'} in {done.seconds:.0f} s, "
        f"written to {done.folder}"
    )
    return 0


def _single(arguments: argparse.Namespace) -> TrainingRun:
    """A policy for one scene."""
    from agents.cli.evaluate import sentence
    from agents.single.training import train

    done = train(
        arguments.scene,
        arguments.algorithm,
        arguments.steps,
        arguments.seed,
        arguments.out,
        resume=arguments.resume,
        progress=None,
        warm_start=arguments.warm_start,
    )
    if done.clone_score is not None:
        print(f"the clone it began with: score {done.clone_score:.6f}")
    print(sentence(done.built))
    return done


def _drawn(arguments: argparse.Namespace) -> TrainingRun:
    """A policy for scenes that are drawn."""
    from agents.single.drawn import train_drawn

    if arguments.warm_start is not None:
        raise ValueError("a warm start is a row of one scene: leave it out where scenes are drawn")
    done = train_drawn(
        arguments.scene,
        arguments.algorithm,
        arguments.steps,
        arguments.seed,
        arguments.out,
        resume=arguments.resume,
        progress=None,
    )
    print(f"median gain over the best uniform rows of some scenes: {done.curve[-1][3]:+.2%}")
    return done


def _conditioned(arguments: argparse.Namespace) -> TrainingRun:
    """One policy for many scenes."""
    from agents.conditioned.preset import FURTHER, ConditionedPreset
    from agents.conditioned.training import train_conditioned
    from agents.evaluation.one_scene import folder_of

    if arguments.algorithm != "ppo":
        raise ValueError("designer is trained in its own way: leave out --algorithm")
    preset = ConditionedPreset() if arguments.warm_start is None else FURTHER
    if arguments.steps is not None:
        if arguments.steps < 0:
            raise ValueError(f"steps = {arguments.steps}: give 0 or more batches")
        preset = replace(preset, batches=arguments.steps)
    done = train_conditioned(
        arguments.out or "runs/designer",
        arguments.seed,
        preset,
        start=None if arguments.warm_start is None else folder_of(arguments.warm_start),
        resume=arguments.resume,
        progress=None,
    )
    gain, beaten = done.curve[-1][2:4]
    print(f"beats the best uniform row in {beaten:.0%} of its scenes, by {gain:.2%} on average")
    return done
