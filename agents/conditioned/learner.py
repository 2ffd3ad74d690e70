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
from agents.conditioned.features import features_of
from agents.conditioned.observations import PLANS, SCENE, SIZE, observations, plans_of, scaled
from agents.conditioned.policy import ConditionedPolicy
from agents.conditioned.preset import ConditionedPreset
from domino_env import Scene

Floats = NDArray[np.float64]

RTOL = 1e-5  # of rows that are scored while learning
WIDEST_SHIFT = 1.0  # of the logarithm of the gaps of a row to its length, that is taken for usual
SHARP = 10.0  # preference for a plan that scores one per cent of uniform's speed more


class Learner:
    """A policy during its training.

    Parameters
    ----------
    preset
        Hyperparameters.
    seed
        Of the initial weights.
    start
        A policy to begin with instead.
    """

    def __init__(
        self, preset: ConditionedPreset, seed: int, start: ConditionedPolicy | None = None
    ) -> None:
        torch.set_num_threads(1)
        self.preset, self.seed = preset, seed
        generator = torch.Generator().manual_seed(seed)
        self.row = _network(SIZE, [preset.width] * preset.depth, 2, generator)
        self.plan = _network(SCENE, [64], PLANS, generator)
        with torch.no_grad():
            bias: Any = self.row[-1].bias
            bias[0] = float(np.log(0.35))  # gaps, of the height: most such rows run
        both = [*self.row.parameters(), *self.plan.parameters()]
        if start is not None:
            _fill(self.row, start.row)
            _fill(self.plan, start.plan)
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

    def imitate(self, chosen: list[tuple[Floats, Floats, Floats]], done: float) -> None:
        """Take one step towards rows that search found.

        Parameters
        ----------
        chosen
            Features (9,) of a scene, and gaps and thicknesses (N-1,) over h, for each row.
        done
            Part of this stage of the training that is done, 0 to 1.
        """
        observed, wanted, weights, places, plans = [], [], [], [], []
        for features, gaps, thickness in chosen:
            least, largest, thin, thick = features[[3, 4, 6, 7]]
            tight = int(np.cumprod(gaps[::-1] <= least * (1.0 + 1e-6)).sum())
            plan = min(tight, plans_of(int(features[2])) - 1)
            free = len(gaps) - plan
            observed.append(observations(features, np.array([plan])))
            middle = np.sqrt(thin * thick)
            wanted.append(
                np.stack([
                    [np.log(gaps), np.log(thickness / middle)],
                    np.log([[least], [thin / middle]]) + np.zeros((2, len(gaps))),
                    np.log([[largest], [thick / middle]]) + np.zeros((2, len(gaps))),
                ]).transpose(2, 1, 0)
            )  # fmt: skip
            weight = np.stack([
                np.arange(len(gaps)) < free, np.full(len(gaps), thin < thick)
            ], axis=1) / len(gaps)  # fmt: skip
            weights.append(weight)
            places.append(scaled(features))
            plans.append(plan)
        got = self.row(_tensor(np.concatenate(observed)))
        goal, floor, top = _tensor(np.concatenate(wanted)).unbind(dim=2)
        # beyond a bound the value is cut off: the same row, and nothing to learn
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
        observed, pulls, reach, places, merits = [], [], [], [], []
        for scene in scenes:
            features = features_of(scene)
            plans = np.arange(plans_of(scene.count), dtype=np.float64)
            gaps, thickness = policy.rows(scene, plans)
            scores = scene.score_batch(gaps, thickness, rtol=RTOL)
            unit = scene.uniform().score / 100.0
            order = np.argsort(-scores, kind="stable")
            few = order[: self.preset.climbing - 1]
            rest = order[self.preset.climbing - 1 :]
            if len(rest):
                few = np.append(few, rng.choice(rest))
            pulls.append(pull(scene, gaps[few], thickness[few], plans[few]) / (unit * len(few)))
            reach.append(np.repeat(_reach(features)[None], pulls[-1].shape[0], axis=0))
            observed.append(observations(features, plans[few]))
            places.append(scaled(features))
            merits.append(np.full(PLANS, -np.inf))
            merits[-1][: len(plans)] = SHARP * scores / unit
        got = self.row(_tensor(np.concatenate(observed)))
        loss = -(_tensor(np.concatenate(pulls)) * got).sum() / len(scenes)
        # and what has strayed far beyond its bounds stays within reach
        least, most = _tensor(np.concatenate(reach)).unbind(dim=2)
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


def pull(scene: Scene, gaps: Floats, thickness: Floats, plans: Floats) -> Floats:
    """Give the slopes of the scores of rows by what the network said, (K (N-1), 2).

    A value that is cut off at a bound moves only inward, a tight end not at all. Where a length
    is asked for, the gaps make up for whatever one of them, or a thickness, gains.
    """
    _, by_gap, by_thickness, _ = scene.score_batch_gradient(gaps, thickness, RTOL)
    features = scene.height * features_of(scene)
    least, largest, thin, thick = (float(features[i]) for i in (3, 4, 6, 7))
    pairs = scene.count - 1
    tight = np.arange(pairs) >= pairs - plans[:, None]
    if scene.length is not None:
        free = gaps * (~tight & (gaps > least) & (gaps < largest))
        price = (by_gap * free).sum(axis=1) / np.maximum(free.sum(axis=1), 1e-12)
        by_gap, by_thickness = by_gap - price[:, None], by_thickness - price[:, None]
    slopes = np.stack([by_gap * gaps, by_thickness * thickness], axis=-1)
    slopes[..., 0][tight] = 0.0
    for i, values, low, high in ((0, gaps, least, largest), (1, thickness, thin, thick)):
        slope = slopes[..., i]
        out = ((values <= low) & (slope < 0.0)) | ((values >= high) & (slope > 0.0))
        slope[out] = 0.0
    return slopes.reshape(-1, 2)


def _reach(features: Floats) -> Floats:
    """Least and largest (2, 2) of what the network may usefully say."""
    half = 0.5 * np.log(features[7] / features[6])
    gap = np.array([-WIDEST_SHIFT, WIDEST_SHIFT]) if features[8] else np.zeros(2)
    return np.array([np.log(features[3:5]) + gap, [-half, half]])


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


def _fill(network: torch.nn.Sequential, known: Network) -> None:
    linear = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    shapes = [tuple(layer.weight.shape) for layer in linear]
    found = [weight.shape for weight, _ in known.layers]
    if shapes != found:
        raise ValueError(f"its layers have the shapes {found}, those to be trained {shapes}")
    with torch.no_grad():
        for layer, (weight, bias) in zip(linear, known.layers, strict=True):
            layer.weight.copy_(torch.from_numpy(weight))
            layer.bias.copy_(torch.from_numpy(bias))


def _plain(network: torch.nn.Sequential) -> Network:
    linear = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    return Network(
        tuple(
            (layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy())
            for layer in linear
        )
    )
