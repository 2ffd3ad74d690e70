"""Train a policy that builds layouts (APG, PPO, ARS, SAC, TD3, TQC).

The command needs the extra "rl". Ctrl-C ends the training with the best policy so far; --resume
continues it.
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import NATURAL, WHOLE, add_flags, add_options, add_out_option, output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino train`."""
    name = "name of a scene or a distribution, or .toml file"
    parser.add_argument("scene", metavar="SCENE", help=name)
    number = "number of scenes of a distribution to sample (all of its pool)"
    archive = "write the best policy as an archive of Stable-Baselines3 too (.zip)"
    add_options(
        parser,
        ("algorithm", str, "NAME", None, "apg, ppo, ars, sac, td3 or tqc (ppo)"),
        ("steps", NATURAL, "N", None, "least number of dominoes placed (that of the algorithm)"),
        ("seed", WHOLE, "N", None, "seed of all randomness (0)"),
        ("num-scenes", NATURAL, "N", None, number),
        ("save-zip", output(".zip"), "FILE", None, archive),
    )
    add_out_option(parser, "runs/SCENE-ALGORITHM", literal=False)
    add_flags(parser, resume="continue from the checkpoint in the folder")


def run(arguments: argparse.Namespace) -> int:
    """Train, and print the result."""
    from agents.cli.evaluate import describe
    from agents.training import train

    result = train(
        arguments.scene, arguments.algorithm, arguments.steps, arguments.seed, arguments.out,
        resume=arguments.resume, progress=None, num_scenes=arguments.num_scenes,
    )  # fmt: skip
    if result.rollout is None:
        print(f"median gain in training scenes: {result.curve[-1][3]:+z.2%}")
    else:
        print(describe(result.rollout))
    print(
        f"{'interrupted after ' if result.interrupted else ''}{result.steps:,} dominoes placed in "
        f"{result.seconds:.0f} s, written to {result.folder}"
    )
    if arguments.save_zip:
        from agents.sb3.factory import save_zip

        save_zip(result.folder, arguments.save_zip)
        print(f"archive written to {arguments.save_zip}")
    return 0
