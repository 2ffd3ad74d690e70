"""Train an agent that builds layouts for a scene, one domino after the other.

Needs the extra "rl". Ctrl-C ends the training with the best policy so far; --resume continues it.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import add_out_option

SUMMARY = "train an agent that builds layouts (APG, PPO, ARS)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino train`."""
    parser.add_argument(
        "scene", metavar="SCENE", help="name of a scene or a distribution, or .toml file"
    )
    parser.add_argument("--algorithm", default="ppo", help="ppo (default), apg, ars")
    parser.add_argument("--steps", type=int, metavar="N", help="number of actions in all")
    parser.add_argument("--seed", type=int, default=0, help="seed of all randomness (0)")
    add_out_option(parser, "runs/SCENE-ALGORITHM", literal=False)
    parser.add_argument(
        "--resume", action="store_true", help="continue from the checkpoint in the folder"
    )


def run(arguments: argparse.Namespace) -> int:
    """Train, and print the result."""
    from agents.cli.evaluate import sentence
    from agents.training import train

    done = train(
        arguments.scene, arguments.algorithm, arguments.steps, arguments.seed, arguments.out,
        resume=arguments.resume, progress=None,
    )  # fmt: skip
    if done.rollout is None:
        print(f"median gain over the uniform baselines of some scenes: {done.curve[-1][3]:+.2%}")
    else:
        print(sentence(done.rollout))
    print(
        f"{'interrupted after ' if done.interrupted else ''}{done.steps:,} dominoes placed in "
        f"{done.seconds:.0f} s, written to {done.folder}"
    )
    return 0
