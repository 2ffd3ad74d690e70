"""Learner of the scene-conditioned policy: imitation, and the exact gradient of its own rows.

The second is reinforcement learning without sampling error in the actions. The policy lays rows for
scenes that are drawn anew in every batch, and since the simulator gives the derivative of a row's
score by each gap, the gradient of the expected score by the weights is exact but for the choice of
scenes. For each scene every plan is scored, and the best few climb; the preferences learn which one
won.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from agents.base.network import Network
from agents.conditioned.distribution import FEATURES, features_of, uniform_speed
from agents.conditioned.observations import PLANS, SIZE, observations, plans_of, scaled
from agents.conditioned.policy import ConditionedPolicy
from agents.conditioned.preset import ConditionedPreset
from domino_env import Scene

Floats = NDArray[np.float64]

MARKED = 12  # uniform rows that the unit of a scene's score is taken from
RTOL = 1e-5  # of rows that are scored while learning
SHARP = 10.0  # preference for a plan that scores one per cent of uniform's speed more


class Learner:
    """A policy during its training.

    Parameters
    ----------
    preset
        Hyperparameters.
    seed
        Of the initial weights.
    """

    def __init__(self, preset: ConditionedPreset, seed: int) -> None:
        torch.set_num_threads(1)
        self.preset, self.seed = preset, seed
        generator = torch.Generator().manual_seed(seed)
        self.row = _network(SIZE, [preset.width] * preset.depth, 1, generator)
        self.plan = _network(len(FEATURES), [64], PLANS, generator)
        with torch.no_grad():
            bias: Any = self.row[-1].bias
            bias.fill_(float(np.log(0.35)))  # of the height: most such rows run
        both = [*self.row.parameters(), *self.plan.parameters()]
        # one for each stage: the second begins without the momentum of the first
        self.imitating = torch.optim.Adam(both, lr=preset.rate)
        self.climbing = torch.optim.Adam(both, lr=preset.rate)

    def policy(self) -> ConditionedPolicy:
        """Give the policy as it is now."""
        return ConditionedPolicy(_plain(self.row), _plain(self.plan))

    def state(self) -> dict[str, Any]:
        """Give all that going on needs."""
        return {
            "row": self.row.state_dict(),
            "plan": self.plan.state_dict(),
            "imitating": self.imitating.state_dict(),
            "climbing": self.climbing.state_dict(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go back to what `state` gave."""
        self.row.load_state_dict(state["row"])
        self.plan.load_state_dict(state["plan"])
        self.imitating.load_state_dict(state["imitating"])
        self.climbing.load_state_dict(state["climbing"])

    def imitate(self, chosen: list[tuple[Floats, Floats]], done: float) -> None:
        """Take one step towards rows that search found.

        Parameters
        ----------
        chosen
            Features (6,) of a scene and gaps (N-1,) over h, for each row of the batch.
        done
            Part of this stage of the training that is done, 0 to 1.
        """
        observed, wanted, weights, places, plans = [], [], [], [], []
        low, high = list[Floats](), list[Floats]()
        for features, gaps in chosen:
            tight = int(np.cumprod(gaps[::-1] <= features[3] * (1.0 + 1e-6)).sum())
            plan = min(tight, plans_of(int(features[2])) - 1)
            free = len(gaps) - plan
            observed.append(observations(features, np.array([plan]))[:free])
            wanted.append(np.log(gaps[:free]))
            low.append(np.full(free, np.log(features[3])))
            high.append(np.full(free, np.log(features[4])))
            weights.append(np.full(free, 1.0 / free))
            places.append(scaled(features))
            plans.append(plan)
        got = self.row(_tensor(np.concatenate(observed)))[:, 0]
        # beyond a bound the gap is cut off: the same row, and nothing to learn
        floor, top = _tensor(np.concatenate(low)), _tensor(np.concatenate(high))
        goal = _tensor(np.concatenate(wanted))
        there = torch.minimum(torch.maximum(got, floor), top) == goal
        off = torch.where(there, torch.zeros_like(got), got - goal)
        loss = (_tensor(np.concatenate(weights)) * off**2).sum() / len(chosen)
        loss = loss + 0.1 * torch.nn.functional.cross_entropy(
            self.plan(_tensor(np.array(places))), torch.tensor(plans)
        )
        self._step(self.imitating, loss, done)

    def climb(self, scenes: list[Scene], rng: np.random.Generator, done: float) -> None:
        """Take one step along the exact gradient of the score of what the policy builds.

        Parameters
        ----------
        scenes
            The batch.
        rng
            Chooses the plan that climbs by chance.
        done
            Part of this stage of the training that is done, 0 to 1.
        """
        policy = self.policy()
        observed, slopes, places, merits = [], [], [], []
        for scene in scenes:
            features = features_of(scene)
            plans = np.arange(plans_of(scene.count), dtype=np.float64)
            gaps = policy.gaps(scene, plans)
            scores = scene.score_batch(gaps, None, rtol=RTOL)
            # the unit of its scores; where none of the few uniform rows runs, by its own best
            unit = max(uniform_speed(scene, MARKED), 0.8 * float(scores.max()), 1e-3) / 100.0
            order = np.argsort(-scores, kind="stable")
            few = order[: self.preset.climbing - 1]
            rest = order[self.preset.climbing - 1 :]
            if len(rest):
                few = np.append(few, rng.choice(rest))
            # by the logarithm of the gap
            slope = scene.score_batch_gradient(gaps[few], None, RTOL)[1] * gaps[few]
            slope /= unit * len(few)
            tight = np.arange(scene.count - 1) >= scene.count - 1 - plans[few, None]
            slopes.append(np.where(tight, 0.0, slope).ravel())
            observed.append(observations(features, plans[few]))
            places.append(scaled(features))
            merits.append(np.full(PLANS, -np.inf))
            merits[-1][: len(plans)] = SHARP * scores / unit
        got = self.row(_tensor(np.concatenate(observed)))[:, 0]
        pull = _tensor(np.concatenate(slopes))
        # a gap that is cut off at a bound moves only when it is pulled back inside
        sizes = [len(slope) for slope in slopes]
        bounds = np.log([[c.spacing[0] / c.height, c.spacing[1] / c.height] for c in scenes])
        least, most = (_tensor(np.repeat(bounds[:, end], sizes)) for end in (0, 1))
        value = got.detach()
        out = ((value <= least) & (pull < 0.0)) | ((value >= most) & (pull > 0.0))
        loss = -(torch.where(out, torch.zeros_like(got), pull) * got).sum() / len(scenes)
        # and one that has strayed far beyond it stays within reach
        stray = torch.relu(got - most - 0.1) + torch.relu(least - 0.1 - got)
        loss = loss + 1e-3 * (stray**2).sum() / len(scenes)
        goal = torch.softmax(_tensor(np.array(merits)), dim=1)
        loss = loss + torch.nn.functional.cross_entropy(self.plan(_tensor(np.array(places))), goal)
        self._step(self.climbing, loss, done)

    def _step(self, optimizer: torch.optim.Adam, loss: torch.Tensor, done: float) -> None:
        plan = self.preset
        share = 0.5 * (1.0 + math.cos(math.pi * done))
        optimizer.param_groups[0]["lr"] = plan.last_rate + (plan.rate - plan.last_rate) * share
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.row.parameters(), 5.0)
        optimizer.step()


def _tensor(values: Floats) -> torch.Tensor:
    return torch.from_numpy(np.asarray(values, dtype=np.float32))


def _network(
    first: int, hidden: list[int], last: int, generator: torch.Generator
) -> torch.nn.Sequential:
    sizes, layers = [first, *hidden, last], list[torch.nn.Module]()
    for i, (a, b) in enumerate(pairwise(sizes)):
        layer = torch.nn.Linear(a, b)
        with torch.no_grad():
            gain = 0.01 if i == len(hidden) else 1.0
            torch.nn.init.orthogonal_(layer.weight, gain, generator=generator)
            layer.bias.zero_()
        layers += [layer, torch.nn.Tanh()]
    return torch.nn.Sequential(*layers[:-1])


def _plain(network: torch.nn.Sequential) -> Network:
    linear = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    return Network(
        tuple(
            (layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy())
            for layer in linear
        )
    )
