"""Learning algorithms and their default hyperparameters.

Figures are gains, or normalised scores where they are more than 20 %. `docs/agents.md` has those of
PPO's schedule, which was chosen by hand on `sprint`, `ideal` and `sprint-thickness`. The discount
factor is 1, as the gain is the undiscounted return, but 0.95 if hits have a schedule, as an action
decides about the next hits (SAC on `tempo-noise`: 2.4 ms, with 0.99 3.1 ms, with 0.9 2.9 ms), and
0.99 for off-policy algorithms where pieces are drawn.

References
----------
Fujimoto, S., van Hoof, H., Meger, D. (2018). Addressing function approximation error in
actor-critic methods. arXiv:1802.09477.
Haarnoja, T., Zhou, A., Abbeel, P., Levine, S. (2018). Soft actor-critic. arXiv:1801.01290.
Kuznetsov, A., Shvechikov, P., Grishin, A., Vetrov, D. (2020). Controlling overestimation bias with
truncated mixture of continuous distributional quantile critics. arXiv:2005.04269.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, NamedTuple

from msgspec import Meta, field

from agents.rollout import is_random
from domino_env import Scene, SceneDistribution
from domino_env.core.checks import require_choice, require_extra
from domino_env.core.models import Value
from domino_env.scenes.io.ranges import COUNT

TYPICAL_EPISODE = 32  # assumed steps per episode if scenes differ in their number of dominoes


def require_learning() -> None:
    """Raise ImportError with the command that installs it if a package for learning is missing."""
    require_extra("learning", "rl", "torch", "stable_baselines3", "sb3_contrib")


PositiveInt = Annotated[int, Meta(ge=1)]
PositiveFloat = Annotated[float, Meta(gt=0.0)]
NonNegativeFloat = Annotated[float, Meta(ge=0.0)]


class Hyperparameters(Value, frozen=True):  # type: ignore[misc]
    """Hyperparameters of a training.

    Attributes
    ----------
    num_envs
        Number of environments that are stepped together.
    steps
        Number of dominoes placed in a whole training.
    width, depth
        Number of units of a hidden layer, and number of hidden layers of each network; ARS has
        none.
    learning_rate
        Learning rate at the start; it decreases linearly to `last_rate` times that.
    last_rate
        Ratio of the last learning rate to the first.
    first_deviation, middle_deviation, last_deviation
        Standard deviation of the actions at the start, at `middle` and at the end; its logarithm
        is linear in between (APG, PPO).
    middle
        Fraction of the steps at which the standard deviation is `middle_deviation`.
    end_factor, penalty
        See `agents.sb3.scheduled.ScheduledPolicy` (APG, PPO).
    options
        Other arguments of the algorithm's class, which has defaults of its own; "policy_kwargs" go
        before `width` and `depth`, "action_noise" is given as a standard deviation, and
        "delta_std" is multiplied by the schedule of the learning rate.
    """

    num_envs: PositiveInt
    steps: PositiveInt
    width: PositiveInt = 64
    depth: PositiveInt = 2
    learning_rate: PositiveFloat = 1e-3
    last_rate: NonNegativeFloat = 0.05
    first_deviation: PositiveFloat = 1.0
    middle_deviation: PositiveFloat = 0.03
    last_deviation: PositiveFloat = 0.01
    middle: Annotated[float, Meta(gt=0.0, lt=1.0, description="a fraction of the steps")] = 0.6
    end_factor: PositiveFloat = 8.0
    penalty: NonNegativeFloat = 1.0
    options: dict[str, Any] = field(default_factory=dict)

    def deviation(self, progress: float) -> float:
        """Return the standard deviation of the actions after a fraction of the steps, 0 to 1."""
        if progress < self.middle:
            start, end, part = self.first_deviation, self.middle_deviation, progress / self.middle
        else:
            start, end = self.middle_deviation, self.last_deviation
            part = (progress - self.middle) / (1.0 - self.middle)
        return float(start * (end / start) ** part)


class Case(NamedTuple):
    """Properties of a scene or distribution on which default hyperparameters depend.

    Attributes
    ----------
    episode
        Number of steps of an episode.
    discount
        Discount factor.
    is_random, is_sampled, has_schedule
        True if episodes of a fixed scene differ, if scenes are sampled, if hits have a schedule.
    """

    episode: int
    discount: float
    is_random: bool
    is_sampled: bool
    has_schedule: bool


def _apg(case: Case) -> Hyperparameters:
    """Return the hyperparameters of APG; steps are updates · environments · steps of an episode."""
    one = Hyperparameters(
        num_envs=16, steps=400 * 16 * case.episode, learning_rate=2e-2, last_rate=0.02, middle=0.5,
        first_deviation=0.3, middle_deviation=0.06, last_deviation=0.003, penalty=0.1,
    )  # fmt: skip
    if case.is_random and case.has_schedule:  # which a small change of all gaps misses
        return one.replace(
            num_envs=8, steps=300 * 8 * case.episode, width=128, learning_rate=3e-4,
            first_deviation=0.004, middle_deviation=0.003, last_deviation=0.002,
        )  # fmt: skip
    if case.is_random or case.is_sampled:
        return one.replace(
            num_envs=32, steps=1500 * 32 * case.episode, width=128,
            first_deviation=0.2, middle_deviation=0.05, last_deviation=0.01,
        )  # fmt: skip
    return one


def _ppo(case: Case) -> Hyperparameters:
    """Return the hyperparameters of PPO; random scenes have few environments, a slow schedule."""
    # steps of a rollout in each environment: two episodes, or one if they are long
    length = 2 * case.episode if case.episode <= 120 else case.episode
    options = {"n_steps": length, "n_epochs": 8, "gamma": case.discount}
    if case.is_random:
        return Hyperparameters(
            num_envs=64, steps=5_000_000, last_rate=0.1, middle=0.4,
            first_deviation=0.3, middle_deviation=0.3, last_deviation=0.02,
            options={"batch_size": max(64 * length // 8, 64)} | options,
        )  # fmt: skip
    return Hyperparameters(
        num_envs=256, steps=15_000_000, last_rate=0.1, middle=0.25,
        first_deviation=0.3, middle_deviation=0.1, last_deviation=0.015,
        # four minibatches of a rollout, none of fewer than 256 transitions
        options={"batch_size": max(256 * length // 4, 256)} | options,
    )  # fmt: skip


def _ars(case: Case) -> Hyperparameters:
    """Return the hyperparameters of ARS, the best of three searches on `sprint`, rounded."""
    return Hyperparameters(
        # as good there as 0.2, and better elsewhere (`tempo-noise` 1.7 ms, with 0.2 9.3 ms)
        num_envs=64, steps=4_000_000, learning_rate=0.05, last_rate=0.02,
        options={"n_delta": 32, "n_top": 20, "delta_std": 0.05, "zero_policy": True},
    )  # fmt: skip


def _off_policy(case: Case, **own: Any) -> Hyperparameters:
    """Return the hyperparameters of an algorithm with a replay buffer; own: its other options."""
    return Hyperparameters(
        num_envs=16, steps=60_000 if case.is_sampled else 30_000, last_rate=1.0,
        options={
            # 16 environments and one update per transition are faster
            "train_freq": 1, "gradient_steps": -1,
            # 100 steps, the default, are six dominoes of each chain (TD3: -38 %, with 2000 25 %)
            "learning_starts": 2000,
            # trainings are short (SAC on `draw` 2.63 %, with 0.005, the default, 1.83 %)
            "tau": 0.05,
            "gamma": min(case.discount, 0.99) if case.is_random else case.discount,
            **own,
        },
    )  # fmt: skip


ALGORITHMS: dict[str, Callable[[Case], Hyperparameters]] = {
    "apg": _apg,
    "ppo": _ppo,
    "ars": _ars,
    "sac": _off_policy,
    # less noise on targets: good actions are not much larger (`sprint` 55 %, with 0.2 52 %)
    "td3": partial(_off_policy, action_noise=0.1, target_policy_noise=0.05, target_noise_clip=0.1),
    # fewer quantiles than 25 are 2.6 times as fast (`tempo-noise` 1.54 ms, with 25 1.55 ms)
    "tqc": partial(_off_policy, policy_kwargs={"n_quantiles": 10}, top_quantiles_to_drop_per_net=1),
}
"""Default hyperparameters of all algorithms, by name."""


def default_hyperparameters(algorithm: str, target: Scene | SceneDistribution) -> Hyperparameters:
    """Return the default hyperparameters of an algorithm.

    Parameters
    ----------
    algorithm
        One of `ALGORITHMS`.
    target
        The scene or scene distribution.

    Raises
    ------
    ValueError
        If the algorithm is unknown.
    """
    require_choice("algorithm", algorithm, ALGORITHMS)
    scene = target if isinstance(target, Scene) else target.first
    count_varies = isinstance(target, SceneDistribution) and COUNT in target.ranges
    has_schedule, is_sampled = scene.tempo is not None, scene is not target
    episode = TYPICAL_EPISODE if count_varies else scene.count - 1
    case = Case(episode, 0.95 if has_schedule else 1.0, is_random(target), is_sampled, has_schedule)
    return ALGORITHMS[algorithm](case)
