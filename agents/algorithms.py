"""Learning algorithms and their default hyperparameters.

The hyperparameters of PPO were chosen by hand on `sprint`, `ideal` and `sprint-thickness`. The
standard deviation of the actions follows a schedule and is not learned: it decreases quickly to 0.1
and slowly from there, where the noise of the gaps no longer decides which thicknesses are best. A
term of the loss penalises means outside [-1, 1], and the standard deviation is larger near the end
of the chain (`agents.sb3.ScheduledPolicy`). On `sprint`, 2 million steps with this schedule end at
a normalised score of 93 to 95 % (ten seeds). With a learned deviation, 64 environments and
defaults of Stable-Baselines3 except for the learning rate, 3 million steps end at 93 and 98 % in
two of five seeds, and in three at 70 %, without the tight gaps at the end of the best layouts.

The first deviation is 0.3. Trainings begin at the uniform baseline, and with much larger noise the
returns of similar layouts can hardly be told apart. It was chosen with the seeds 0 to 3. Means of
five other seeds (100 to 104) after 2 million steps, on `varied` 3 million, with 0.3 and with 1 are
on `ideal` 1.108 and 1.090 m/s, on `sprint-thickness` 0.8826 and 0.8806 m/s, on `draw` 0.8252 and
0.8247 m/s and on `varied` 1.76 and 1.44 %, but on `sprint` 0.8269 and 0.8274 m/s and on `course`
0.8574 and 0.8576 m/s. With 0.2, `ideal` ends at 1.111 m/s, but one of four seeds of `sprint` at
0.8246 m/s.

In random scenes (`agents.rollout.is_random`), 64 environments and a slower schedule are better
(`draw`, a million steps: 0.8219 m/s, with a learned deviation 0.8146 to 0.8205 m/s in three seeds).
The deviation is 0.3 until 40 % of the steps. A last deviation of 0.02 instead of 0.05 helps long
trainings (with a first one of 1, five million steps, means of five seeds and of three: 0.8263 and
0.8258 m/s; two million: 0.8230 and 0.8237 m/s).

SAC, TD3 and TQC have the defaults of Stable-Baselines3 and sb3-contrib, except for

- 16 environments, one update per transition and two layers of 64 units, which are faster;
- 2000 steps of random actions instead of 100: with 16 environments, 100 steps are the first six
  dominoes of each chain (TD3 on `sprint`, 20 000 steps: -38 % without, 25 and 41 % with);
- target networks that follow ten times as fast, with tau = 0.05 instead of 0.005, as trainings are
  short (30 000 steps, mean gains with and without: SAC on `sprint` 2.38 and 2.28 %, four seeds, on
  `draw` 2.63 and 1.83 %, three seeds; TD3 on `sprint` 2.32 and 1.83 %, two seeds; on `tempo-noise`
  no difference; with the returns of v2 SAC on `varied` 1.14 and 1.00 %, one seed);
- for TQC 10 quantiles of each critic instead of 25, without the highest one, which is 2.6 times as
  fast (`tempo-noise`, 30 000 steps, one seed: 1.54 and 1.55 ms);
- a learning rate of 1e-3 for all (SAC on `draw`, 30 000 steps: 0.804 m/s, with 3e-4 0.790 m/s);
- for TD3 the exploration noise of its authors, without which all environments of one scene would
  take the same actions, and less noise on the actions of its targets, 0.05 instead of 0.2, as good
  actions are not much larger than that (30 000 steps, two seeds: `sprint` 55 and 60 %, with 0.2 52
  and 39 %; `sprint-thickness` 37 and 26 %, with 0.2 6 and 19 %; one seed: `tempo-noise` 4.2 ms,
  with 0.2 6.8 ms).

The discount factor is 1, as the gain is the undiscounted return (SAC on `sprint`, 30 000 steps:
62 %, with 0.99 54 %, with 0.95 28 %), for SAC, TD3 and TQC 0.99 in random scenes. If hits have a
schedule, it is 0.95 for all these algorithms, as an action decides about the next hits (SAC on
`tempo-noise`, 30 000 steps: 2.4 ms, with 0.99 3.1 ms, with 0.9 2.9 ms, same seed).

Without a note, figures are of trainings in which a wave that stops returned -200 to -100, as in v1,
with tau = 0.005 (TQC: 0.05), and for TD3 with rewards times 0.1. Comparisons of first
deviations of PPO and its five seeds on `sprint` have the returns of v2.

References
----------
Fujimoto, S., van Hoof, H., Meger, D. (2018). Addressing function approximation error in
actor-critic methods. arXiv:1802.09477.
Haarnoja, T., Zhou, A., Abbeel, P., Levine, S. (2018). Soft actor-critic. arXiv:1801.01290.
Kuznetsov, A., Shvechikov, P., Grishin, A., Vetrov, D. (2020). Controlling overestimation bias with
truncated mixture of continuous distributional quantile critics. arXiv:2005.04269.
"""

from __future__ import annotations

from typing import Annotated, Any

from msgspec import Meta, field

from agents.rollout import is_random
from domino_env import Scene, SceneDistribution
from domino_env.core.checks import require_choice, require_extra
from domino_env.core.models import Value
from domino_env.scenes.io.ranges import COUNT

OFF_POLICY = ("sac", "td3", "tqc")
ALGORITHMS = ("apg", "ppo", "ars", *OFF_POLICY)
TYPICAL_EPISODE = 32  # assumed steps per episode if scenes differ in their number of dominoes


def require_learning() -> None:
    """Raise ImportError with the command that installs it if a package for learning is missing."""
    require_extra("learning", "rl", "torch", "stable_baselines3", "sb3_contrib")


PositiveInt = Annotated[int, Meta(ge=1)]
PositiveFloat = Annotated[float, Meta(gt=0.0)]


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
        See `agents.sb3.ScheduledPolicy` (APG, PPO).
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
    last_rate: float = 0.05
    first_deviation: PositiveFloat = 1.0
    middle_deviation: PositiveFloat = 0.03
    last_deviation: PositiveFloat = 0.01
    middle: Annotated[float, Meta(gt=0.0, lt=1.0, description="a fraction of the steps")] = 0.6
    end_factor: PositiveFloat = 8.0
    penalty: float = 1.0
    options: dict[str, Any] = field(default_factory=dict)

    def deviation(self, progress: float) -> float:
        """Return the standard deviation of the actions after a fraction of the steps, 0 to 1."""
        if progress < self.middle:
            start, end, part = self.first_deviation, self.middle_deviation, progress / self.middle
        else:
            start, end = self.middle_deviation, self.last_deviation
            part = (progress - self.middle) / (1.0 - self.middle)
        return float(start * (end / start) ** part)


def default_hyperparameters(algorithm: str, target: Scene | SceneDistribution) -> Hyperparameters:
    """Return the default hyperparameters of an algorithm.

    APG has more environments and updates if scenes are sampled, or if episodes are random, with
    placement noise or pieces in random order. If a random scene has a schedule of the hits, which a
    small change of all gaps misses, APG has fewer of both, a small learning rate and little noise.

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
    episode = TYPICAL_EPISODE if count_varies else scene.count - 1
    discount = 0.95 if scene.tempo is not None else 1.0
    if algorithm == "ppo":
        # steps of a rollout in each environment: two episodes, or one if they are long
        length = 2 * episode if episode <= 120 else episode
        options = {"n_steps": length, "n_epochs": 8, "gamma": discount}
        if is_random(target):
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
    if algorithm == "apg":
        # steps: number of updates, times environments, times steps of an episode
        defaults = Hyperparameters(
            num_envs=16, steps=400 * 16 * episode, learning_rate=2e-2, last_rate=0.02, middle=0.5,
            first_deviation=0.3, middle_deviation=0.06, last_deviation=0.003, penalty=0.1,
        )  # fmt: skip
        if scene is target and not is_random(target):
            return defaults
        if is_random(target) and scene.tempo is not None:
            return defaults.replace(
                num_envs=8, steps=300 * 8 * episode, width=128, learning_rate=3e-4,
                first_deviation=0.004, middle_deviation=0.003, last_deviation=0.002,
            )  # fmt: skip
        return defaults.replace(
            num_envs=32, steps=1500 * 32 * episode, width=128,
            first_deviation=0.2, middle_deviation=0.05, last_deviation=0.01,
        )  # fmt: skip
    if algorithm in OFF_POLICY:
        own: dict[str, dict[str, Any]] = {
            "sac": {},
            "td3": {"action_noise": 0.1, "target_policy_noise": 0.05, "target_noise_clip": 0.1},
            "tqc": {"policy_kwargs": {"n_quantiles": 10}, "top_quantiles_to_drop_per_net": 1},
        }
        return Hyperparameters(
            num_envs=16, steps=30_000 if scene is target else 60_000, last_rate=1.0,
            options={
                "train_freq": 1, "gradient_steps": -1, "learning_starts": 2000, "tau": 0.05,
                "gamma": min(discount, 0.99) if is_random(target) else discount, **own[algorithm],
            },
        )  # fmt: skip
    # ARS: the best of three searches for hyperparameters on `sprint`, rounded; the scores of the
    # others were within 0.00004 m/s.  A learning rate of 0.05 is as good there and better elsewhere
    # (2 million steps, same seed: `ideal` 1.110 m/s, with 0.2 1.096 m/s; `tempo-noise` 1.7 ms, with
    # 0.2 9.3 ms)
    return Hyperparameters(
        num_envs=64, steps=4_000_000, learning_rate=0.05, last_rate=0.02,
        options={"n_delta": 32, "n_top": 20, "delta_std": 0.05, "zero_policy": True},
    )  # fmt: skip
