"""Train an agent that builds rows for a scene, and write down what it learned.

Needs the extra "rl".  Ctrl-C ends the training with the best policy so far; --resume goes on.
"""

from __future__ import annotations

import argparse

SUMMARY = "train an agent that builds rows (PPO, SAC, TD3, TQC, ARS)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `domino train`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene's name or .toml file")
    parser.add_argument("--algorithm", default="ppo", help="ppo (default), sac, td3, tqc, ars")
    parser.add_argument("--steps", type=int, help="dominoes to place in all")
    parser.add_argument("--seed", type=int, default=0, help="of all randomness (0)")
    parser.add_argument("--out", metavar="FOLDER", help="the run's folder (runs/SCENE-ALGORITHM)")
    parser.add_argument("--resume", action="store_true", help="go on from the checkpoint there")


def run(arguments: argparse.Namespace) -> int:
    """Train, and say what was built."""
    import sys

    from agents.evaluate_command import sentence
    from agents.training import train

    done = train(
        arguments.scene,
        arguments.algorithm,
        arguments.steps,
        arguments.seed,
        arguments.out,
        resume=arguments.resume,
        progress=sys.stderr.isatty(),
    )
    print(sentence(done.built))
    spent = f"{done.steps:,} dominoes placed in {done.seconds:.0f} s, written to {done.folder}"
    print(("interrupted after " if done.interrupted else "") + spent)
    return 0
