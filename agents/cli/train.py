"""Train an agent that builds rows for a scene, and write down what it learned.

Needs the extra "rl". Ctrl-C ends the training with the best policy so far; --resume goes on.
"""

from __future__ import annotations

import argparse

SUMMARY = "train an agent that builds rows (APG, PPO, ARS)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino train`."""
    parser.add_argument("scene", metavar="SCENE", help="name or .toml file of a scene or many")
    parser.add_argument("--algorithm", default="ppo", help="ppo (default), apg, ars")
    parser.add_argument("--steps", type=int, help="dominoes to place in all")
    parser.add_argument("--seed", type=int, default=0, help="of all randomness (0)")
    parser.add_argument("--out", metavar="FOLDER", help="the run's folder (runs/SCENE-ALGORITHM)")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint there")


def run(arguments: argparse.Namespace) -> int:
    """Train, and describe the result."""
    from agents.cli.evaluate import sentence
    from agents.training import train

    done = train(
        arguments.scene, arguments.algorithm, arguments.steps, arguments.seed, arguments.out,
        resume=arguments.resume, progress=None,
    )  # fmt: skip
    if done.rollout is None:
        print(f"median gain over the best uniform rows of some scenes: {done.curve[-1][3]:+.2%}")
    else:
        print(sentence(done.rollout))
    print(
        f"{'interrupted after ' if done.interrupted else ''}{done.steps:,} dominoes placed in "
        f"{done.seconds:.0f} s, written to {done.folder}"
    )
    return 0
