"""Third-party learning algorithms, named `package.module:fit`.

The function `fit(make_env, steps, seed)` places about `steps` dominoes in single Gymnasium
environments, which `make_env()` returns. It returns an object with the method `predict` of
Stable-Baselines3, which maps observations (B, O) to a tuple of the actions (B, A) and None.
Recurrent policies, which return a state in place of None, are rejected.
"""

from __future__ import annotations

import inspect
import os
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, cast

import numpy as np

from agents.network import UnsupportedPolicyError
from agents.policy import ScenePolicy, observation_bounds, policy_of
from domino_env import DominoChain, Scene, SceneDistribution
from optimize.experiments.task import Trace
from optimize.methods import registry

Fit = Callable[[Callable[[], DominoChain], int, int], Any]
STEPS = 100_000  # number of dominoes to place if none is given


class CountedChain(DominoChain):
    """Environment that counts its steps and the layouts that it simulates.

    Parameters
    ----------
    target
        The scene, or the distribution that scenes are sampled from.
    work
        Counter that receives the numbers of "steps" and of "simulations".
    """

    def __init__(self, target: Scene | SceneDistribution, work: Counter[str]) -> None:
        super().__init__(target)
        self._work = work

    def step(self, action: Any) -> Any:
        """Place a domino; see `DominoChain.step`."""
        result = super().step(action)
        self._work["steps"] += 1
        self._work["simulations"] += result[2]  # terminated
        return result


def load_fit(name: str) -> Fit | None:
    """Import a learning algorithm; return None if the name is not that of one.

    A learning algorithm has three arguments, a search method has two; both may have optional ones.

    Raises
    ------
    ValueError
        If the function cannot be imported, or has another number of arguments.
    """
    module, colon, _ = name.partition(":")
    if not colon or module in (*registry.METHODS, *registry.installed_families()):
        return None
    function = cast("Fit", registry.import_function(name))
    for number in (2, 3):
        with suppress(TypeError):
            inspect.signature(function).bind(*[None] * number)
            return function if number == 3 else None
    raise ValueError(
        f"algorithm '{name}': its arguments are neither (make_env, steps, seed), as of a learning "
        "algorithm, nor (evaluator, rng), as of a search method: give it one of these signatures"
    )


def train_third_party(
    name: str, target: Scene | SceneDistribution, steps: int | None, seed: int
) -> tuple[ScenePolicy, Trace, dict[str, int]]:
    """Train with a third-party algorithm.

    Parameters
    ----------
    name
        Name of the algorithm, `package.module:fit`.
    target
        The scene, or the distribution that scenes are sampled from.
    steps
        Number of dominoes to place; None for `STEPS`.
    seed
        Seed of the training.

    Returns
    -------
    policy : ScenePolicy
        The policy.
    trace : dict
        One entry: the "steps", the processor "seconds" with those of ended child processes, and
        nan for the "score", which is not known. As steps in child processes are not counted, their
        number is at least that requested.
    work : dict
        Number of simulated layouts, "simulations".

    Raises
    ------
    ValueError
        If the function returns an object without `predict`, or a recurrent policy; see also
        `load_fit`.
    """
    fit, work = load_fit(name), Counter[str]()
    assert fit is not None
    start = sum(os.times()[:4])
    model = fit(lambda: CountedChain(target, work), steps or STEPS, seed)
    seconds = sum(os.times()[:4]) - start
    if not callable(getattr(model, "predict", None)):
        raise ValueError(
            f"{name} returned {type(model).__name__}, which has no method predict: return an "
            "object with predict(observations, deterministic=True), as Stable-Baselines3 has it"
        )
    placed, bounds = max(work.pop("steps", 0), steps or STEPS), observation_bounds(target)
    try:
        policy = policy_of(model, bounds.shape[1])
    except UnsupportedPolicyError as error:
        raise ValueError(f"{name}: {error}") from None
    trace: Trace = {"steps": [placed], "seconds": [seconds], "score": [np.nan]}
    return ScenePolicy(Path(name), policy, bounds, target), trace, dict(work)
