"""Train an agent that builds layouts for a scene, one domino after the other.

Needs the extra "rl". Ctrl-C ends the training with the best policy so far; --resume continues it.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import NATURAL, SEED, add_out_option, output

SUMMARY = "train an agent that builds layouts (APG, PPO, ARS, SAC, TD3, TQC)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino train`."""
    parser.add_argument(
        "scene", metavar="SCENE", help="name of a scene or a distribution, or .toml file"
    )
    parser.add_argument("--algorithm", default="ppo", help="ppo (default), apg, ars, sac, td3, tqc")
    parser.add_argument("--steps", type=NATURAL, metavar="N", help="number of actions in all")
    parser.add_argument("--seed", type=SEED, default=0, help="seed of all randomness (0)")
    parser.add_argument(
        "--num-scenes", type=NATURAL, metavar="N",
        help="number of scenes of a distribution to sample (all 4096)",
    )  # fmt: skip
    add_out_option(parser, "runs/SCENE-ALGORITHM", literal=False)
    parser.add_argument(
        "--resume", action="store_true", help="continue from the checkpoint in the folder"
    )
    parser.add_argument(
        "--save-zip", metavar="FILE", type=output(".zip"),
        help="write the best policy as an archive of Stable-Baselines3 too (.zip)",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Train, and print the result."""
    from agents.cli.evaluate import sentence
    from agents.training import save_zip, train

    result = train(
        arguments.scene, arguments.algorithm, arguments.steps, arguments.seed, arguments.out,
        resume=arguments.resume, progress=None, num_scenes=arguments.num_scenes,
    )  # fmt: skip
    if result.rollout is None:
        print(f"median gain over the uniform baselines of some scenes: {result.curve[-1][3]:+.2%}")
    else:
        print(sentence(result.rollout))
    print(
        f"{'interrupted after ' if result.interrupted else ''}{result.steps:,} dominoes placed in "
        f"{result.seconds:.0f} s, written to {result.folder}"
    )
    if arguments.save_zip:
        save_zip(result.folder, arguments.save_zip)
        print(f"archive written to {arguments.save_zip}")
    return 0
