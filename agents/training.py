"""Training of policies with Stable-Baselines3, for one scene or for a scene distribution.

`agents.policy` lists the files in the folder of a training.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents import policy
from agents.algorithms import ALGORITHMS, Hyperparameters, default_hyperparameters, require_learning
from agents.policy import CONFIG, SCENE, ScenePolicy
from agents.rollout import Rollout
from domino_env import Scene, SceneDistribution
from domino_env.core.checks import as_path, require, require_choice, require_type
from domino_env.core.files import require_unused, require_writable
from domino_env.scenes.distribution import load_any
from domino_env.scenes.pool import POOL_SIZE
from optimize.experiments.best_known import best_known_of
from optimize.result import draw_scores


@dataclass(frozen=True, eq=False)
class Run:
    """Result of a training.

    Attributes
    ----------
    folder
        Folder of the training.
    scene
        Name of the scene or of the scene distribution.
    algorithm
        Name of the algorithm.
    steps
        Number of dominoes placed.
    seconds
        Wall-clock time [s].
    curve
        A tuple for each evaluation, with the columns of progress.csv. If scenes are sampled, scores
        are median gains over the uniform baselines of some training scenes, and `test_score` is
        that of the best policy so far in the test set, which does not affect the training;
        otherwise, or without a test set, it is `best_score`.
    interrupted
        True if the training was interrupted (Ctrl-C).
    rollout
        Layout of the best policy; None if scenes are sampled.
    """

    folder: Path
    scene: str
    algorithm: str
    steps: int
    seconds: float
    curve: tuple[tuple[float, ...], ...]
    interrupted: bool
    rollout: Rollout | None

    def __repr__(self) -> str:
        result = f"median gain {self.curve[-1][3]:+z.2%}"  # best_score
        if self.rollout is not None:
            result = self.rollout.score_text
        work = f"{self.steps:,} dominoes placed in {self.seconds:.0f} s; {self.folder}"
        return f"Run({self.algorithm} on {self.scene}: {result}; {work})"

    def _repr_png_(self) -> bytes | None:
        return None if self.rollout is None else self.rollout._repr_png_()

    def plot(self) -> Any:
        """Draw the layout, the uniform baseline and the learning curve.

        Returns
        -------
        matplotlib.figure.Figure
            The figure.

        Raises
        ------
        ValueError
            If scenes are sampled, as there is no single layout.
        """
        from domino_env.view.figures import draw_with_uniform

        rollout = self.rollout
        if rollout is None:
            raise ValueError(
                f"the training in {self.folder} has no single layout, as scenes were sampled from "
                f"{self.scene}: see progress.csv, or evaluate the policy in one scene"
            )
        return draw_with_uniform(rollout, f"built by {self.algorithm}", self._draw_curve)

    def _draw_curve(self, axes: Any) -> None:
        """Draw the learning curve, with the uniform baseline and the best known score."""
        assert self.rollout is not None
        scene, uniform = self.rollout.scene, self.rollout.uniform.score
        lines = {"uniform baseline": uniform}
        if record := best_known_of(scene):
            lines["best known"] = record.score
        table = np.array(self.curve)  # columns as in `COLUMNS`
        curves = {"best so far": table[:, 3], "policy, without noise": table[:, 2]}
        clock = f"dominoes placed in the training ({self.algorithm})"
        draw_scores(axes, table[:, 0], curves, lines, scene.criterion, clock)


def train(
    scene: str | Path | Scene | SceneDistribution,
    algorithm: str | None = None,
    steps: int | None = None,
    seed: int | None = None,
    folder: str | Path | None = None,
    *,
    resume: bool = False,
    progress: bool | None = False,
    hyperparameters: Hyperparameters | None = None,
    num_scenes: int | None = None,
) -> Run:
    """Train a policy that builds layouts for a scene, or for all scenes of a distribution.

    Ctrl-C ends the training with the best policy so far.

    Parameters
    ----------
    scene
        A scene or a scene distribution, the name of one, or the path of its file.
    algorithm
        One of `agents.algorithms.ALGORITHMS`; None for "ppo".
    steps
        Least number of dominoes to place; None for that of the hyperparameters.
    seed
        Seed of all randomness; None for 0. Weights are bitwise reproducible on the same machine,
        except after a resumed training.
    folder
        Folder of the training; None for runs/SCENE-ALGORITHM.
    resume
        If True, the training continues from the checkpoint in the folder. The scene must be that of
        the training, and so must all arguments that are not None.
    progress
        If True, a progress bar is shown; None for a bar on a terminal and lines elsewhere.
    hyperparameters
        Hyperparameters; None for the defaults of the algorithm.
    num_scenes
        Number of scenes of a distribution to train on, from the first; None for all of its pool.

    Returns
    -------
    Run
        Folder, learning curve and best layout.

    Raises
    ------
    ImportError
        If the extra "rl" is missing.
    ValueError
        If the algorithm or the scene is unknown, if the algorithm cannot learn in it, if a number
        is out of range, if `num_scenes` is more than 1 with a single scene, if the folder holds
        another training or, with `resume`, none or one with other arguments, or if the weights are
        not finite after an update.
    TypeError
        If the folder or the hyperparameters have another type.
    OSError
        If the folder cannot be written.

    Examples
    --------
    >>> from agents import train
    >>> run = train("sprint", algorithm="apg", folder="runs/apg")  # doctest: +SKIP
    >>> run.rollout.score  # doctest: +SKIP
    """
    names = ("algorithm", "steps", "seed", "num_scenes", "hyperparameters")
    given = dict(zip(names, (algorithm, steps, seed, num_scenes, hyperparameters), strict=True))
    algorithm, seed = algorithm or "ppo", 0 if seed is None else seed
    require_choice("algorithm", algorithm, ALGORITHMS)
    require("steps", steps, 1, whole=True, optional=True)
    require("seed", seed, 0, 2**32 - 1, whole=True)
    require("num_scenes", num_scenes, 1, POOL_SIZE, whole=True, optional=True)
    require_learning()
    from agents.sb3.training import Training
    from domino_env.core.plot_style import write_png

    require_type("hyperparameters", hyperparameters, Hyperparameters | None, "Hyperparameters")
    target = scene if isinstance(scene, Scene | SceneDistribution) else load_any(scene)
    path = as_path("folder", folder or f"runs/{target.name}-{algorithm}")
    if resume:
        config, given["scene"] = policy.read_config(path), target.to_toml()
        stored = {name: getattr(config, name, None) for name in given}
        stored["scene"] = given["scene"]
        if (path / SCENE).exists():  # else it is written again
            stored["scene"] = load_any(path / SCENE).to_toml()
        if other := [name for name, x in given.items() if x is not None and x != stored[name]]:
            own = [f"another {x}" if x == "scene" else f"{x} = {stored[x]}" for x in other]
            raise ValueError(
                f"the training in {path} has {', '.join(own)}: give its own scene ({SCENE}) and "
                f"leave out the rest ({CONFIG}), or name another folder"
            )
    else:
        require_writable(path)
        require_unused(path, policy.FILES)
        chosen = hyperparameters or default_hyperparameters(algorithm, target)
        config = policy.ConfigDocument(algorithm, seed, steps or chosen.steps, chosen, num_scenes)
    try:
        training = Training(target, config, path, progress)
        interrupted = training.run(resume)
        rollout = ScenePolicy.load(path).build() if isinstance(target, Scene) else None
        done, seconds = training.write_summary(interrupted, rollout)
        curve = tuple(training.curve)
        run = Run(path, target.name, config.algorithm, done, seconds, curve, interrupted, rollout)
        if rollout is not None:
            write_png(run.plot(), path / "result.png")
    except KeyboardInterrupt:  # outside the updates
        option = " with --resume" * (path / CONFIG).exists()
        raise KeyboardInterrupt(f"interrupted: the same command{option} continues") from None
    return run
