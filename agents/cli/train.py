"""Train an agent that builds rows for a scene, and write down what it learned.

SCENE `family` trains one policy over random scenes, in a way of its own, whose batches are its
steps.

Needs the extra "rl". Ctrl-C ends the training with the best policy so far; --resume goes on.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agents.base.training import TrainingRun

SUMMARY = "train an agent that builds rows (APG, PPO, ARS)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino train`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene's name or .toml file; family")
    parser.add_argument("--algorithm", default="ppo", help="ppo (default), apg, ars")
    parser.add_argument("--steps", type=int, help="dominoes to place in all")
    parser.add_argument("--seed", type=int, default=0, help="of all randomness (0)")
    parser.add_argument("--out", metavar="FOLDER", help="the run's folder (runs/SCENE-ALGORITHM)")
    parser.add_argument(
        "--warm-start",
        metavar="ROW",
        help="begin as a clone of a row: a layout's file, a run's folder, auto, best-known (PPO)",
    )
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint there")


def run(arguments: argparse.Namespace) -> int:
    """Train, and say what came of it."""
    done = _conditioned(arguments) if arguments.scene == "family" else _single(arguments)
    print(
        f"{'interrupted after ' if done.interrupted else ''}{done.steps:,} "
        f"{'steps' if arguments.scene == 'family' else 'dominoes placed'} in {done.seconds:.0f} s, "
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


def _conditioned(arguments: argparse.Namespace) -> TrainingRun:
    """One policy for many scenes."""
    from agents.conditioned.preset import ConditionedPreset
    from agents.conditioned.training import train_conditioned

    if arguments.algorithm != "ppo" or arguments.warm_start is not None:
        raise ValueError("family is trained in its own way: leave out --algorithm and --warm-start")
    preset = ConditionedPreset()
    if arguments.steps is not None:
        if arguments.steps < 0:
            raise ValueError(f"steps = {arguments.steps}: give 0 or more batches")
        preset = replace(preset, batches=arguments.steps)
    done = train_conditioned(
        arguments.out or "runs/family",
        arguments.seed,
        preset,
        resume=arguments.resume,
        progress=None,
    )
    gain, beaten = done.curve[-1][2:4]
    print(f"beats the best uniform row in {beaten:.0%} of its scenes, by {gain:.2%} on average")
    return done
