"""Cloning: a policy learns to build a given row before it goes on by itself.

What is imitated are the actions of the row (Pomerleau 1991), shown on its own states and on those
of rows that were placed with errors, where the action is the one that leads back (as in Ross et al.
2011, with the row itself as the expert). The last layer is then solved for exactly. The critic
learns the returns of the clone, so that what follows does not begin with wrong advantages.

References
----------
Pomerleau, D. A. (1991). Efficient training of artificial neural networks for autonomous navigation.
Neural Computation 3, 88-97.

Ross, S., Gordon, G. J., Bagnell, J. A. (2011). A reduction of imitation learning and structured
prediction to no-regret online learning. AISTATS, 627-635.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray

from agents.base.building import build
from agents.sb3.learner import policy_of
from domino_env import Layout, Scene

if TYPE_CHECKING:
    from agents.sb3.vec_env import DominoVecEnv

Floats = NDArray[np.float64]

SEARCHED = 20_000  # evaluations of `auto`, some seconds
CLOSE = 3e-5  # relative loss of score at which a clone is good enough
ROUNDS = 3  # of learning, each with the row as the policy places it so far
STEPS = 300  # a round
ERRORS = (0.0, 0.003, 0.01, 0.03)  # standard deviations of the actions that are shown
DEMONSTRATIONS = 40  # rows with errors
ON_THE_ROW = 10  # copies of the row itself beside them
BEYOND = (1.02, 1.2)  # where the mean of an action at a bound is to lie, times the bound
CRITICS = 64  # rows that the critic learns from


@dataclass(frozen=True)
class Cloned:
    """Result of cloning a row.

    Attributes
    ----------
    source
        The row that was imitated, in words.
    row_score
        Its score.
    score
        That of the row the clone builds, without noise.
    seconds
        Time that it took.
    """

    source: str
    row_score: float
    score: float
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """Give the fields for a file."""
        return asdict(self)


def row_to_clone(scene: Scene, what: str | Path | Layout, seed: int = 0) -> tuple[Layout, str]:
    """Find the row to imitate.

    Parameters
    ----------
    scene
        Where it is to score.
    what
        A row; the file of one; the folder of a run, of a search or a training; "auto": searched
        for, for some seconds; "best-known": the record of the scene.
    seed
        Of the search.

    Returns
    -------
    row : Layout
        The row.
    source : str
        Where it is from, in words.

    Raises
    ------
    ValueError
        Where there is no such row, and for one that breaks the scene's rules or dies.
    """
    if isinstance(what, Layout):
        row, source = what, "a row"
    elif what == "auto":
        from optimize import search

        found = search(scene, budget=SEARCHED, seed=seed, progress=False)
        row, source = found.layout, f"searched with {found.evaluations} evaluations"
    elif what == "best-known":
        from optimize.records.shipped import best_known

        known = best_known().get(scene.name)
        if known is None:
            raise ValueError(f"no row of '{scene.name}' is on record: name a row, or say auto")
        row, source = known.layout, f"the best known ({known.method})"
    else:
        path = Path(what)
        file = path / "layout.json" if path.is_dir() else path
        if not file.exists():
            raise ValueError(
                f"{what} is no row: give a layout's file, the folder of a run, auto or best-known"
            )
        row, source = Layout.read(file), str(what)
    score = scene.score(row)  # refuses one that breaks the rules
    if score <= 0.0:
        raise ValueError(
            f"{source}: its wave dies (score {score:.6f}), there is nothing to imitate"
        )
    return row, source


def clone(
    model: Any, env: DominoVecEnv, what: str | Path | Layout, deviation: float, seed: int
) -> Cloned:
    """Train PPO's networks on a row and its returns; the best of some rounds is kept.

    Parameters
    ----------
    model
        PPO of stable-baselines3.
    env
        What it learns in.
    what
        See `row_to_clone`.
    deviation
        Standard deviation of the actions with which it will go on.
    seed
        Of the search of the row, and of the errors in the rows that are imitated.

    Raises
    ------
    ValueError
        As of `row_to_clone`.
    """
    began = time.perf_counter()
    scene, policy = env.rows.scene, model.policy
    row, source = row_to_clone(scene, what, seed)
    score = scene.score(row)
    if scene.criterion.is_ratio:  # what the training will lead against, and the policy sees
        env.rows.reference_speed = score
    rng = np.random.default_rng(seed)
    best, kept = -np.inf, policy.state_dict()
    demonstrations = [
        _demonstrations(env, row, rng, None, DEMONSTRATIONS),
        *[_demonstrations(env, row, rng, None, 1)] * ON_THE_ROW,
    ]
    for _ in range(ROUNDS):
        observations, wanted = (
            np.concatenate(parts) for parts in zip(*demonstrations, strict=True)
        )
        _imitate(policy, observations, wanted)
        built = build(policy_of(model), scene, float(env.rows.reference_speed))
        if built.score > best:
            best = built.score
            kept = {name: value.clone() for name, value in policy.state_dict().items()}
        if best >= score - CLOSE * abs(score):
            break
        demonstrations += [_demonstrations(env, row, rng, model, 1)] * ON_THE_ROW
    policy.load_state_dict(kept)
    _fit_critic(model, env, deviation, rng)
    return Cloned(source, score, best, time.perf_counter() - began)


def _demonstrations(
    env: DominoVecEnv,
    row: Layout,
    rng: np.random.Generator,
    model: Any | None,
    number: int,
) -> tuple[Floats, Floats]:
    """Observations (M, O) along rows placed with errors, and the actions (M, A) that lead back.

    model: who places them; None for the row itself.  number: of rows; of one alone, without errors.
    """
    rows = env.rows
    observations = env.reset()
    number = min(number, env.num_envs)
    error = np.resize(np.array(ERRORS), env.num_envs)[:, None]
    running = np.arange(env.num_envs) < number
    states, actions = [], []
    for _ in range(rows.scene.count - 1):
        right = rows.actions_towards(row)
        states.append(observations[running].astype(np.float64))
        actions.append(right[running])
        placed = right if model is None else model.predict(observations, deterministic=True)[0]
        env.step_async(placed + error * rng.standard_normal(right.shape))
        observations, _, ended, _ = env.step_wait()
        running &= ~ended
        if not running.any():
            break
    return np.concatenate(states), np.concatenate(actions)


def _imitate(policy: Any, observations: Floats, wanted: Floats) -> None:
    """Regression of the mean action; a value at a bound may be anywhere a little beyond it."""
    hidden, last = policy.mlp_extractor.policy_net, policy.action_net

    def loss(means: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
        error = torch.where(
            right.abs() < 1.0, means - right, right * means - torch.clamp(right * means, *BEYOND)
        )
        return (error**2).mean()

    _fit(torch.nn.Sequential(hidden, last), observations, wanted, loss)


def _fit(network: torch.nn.Module, observations: Floats, wanted: Floats, loss: Any) -> None:
    """All of the data at once, by quasi-Newton steps in double precision: the network is small."""
    network.double()
    inputs, targets = torch.from_numpy(observations), torch.from_numpy(wanted)
    optimizer: Any = torch.optim.LBFGS(
        network.parameters(), max_iter=STEPS, history_size=30, line_search_fn="strong_wolfe",
        tolerance_grad=1e-9, tolerance_change=1e-12,
    )  # fmt: skip

    def closure() -> Any:
        optimizer.zero_grad()
        off: Any = loss(network(inputs), targets)
        off.backward()
        return off

    optimizer.step(closure)
    network.float()


def _fit_critic(model: Any, env: DominoVecEnv, deviation: float, rng: np.random.Generator) -> None:
    """Fit the critic to the sums of rewards to come of rows that the clone places with noise."""
    states: list[Any] = []
    rewards: list[Floats] = []
    alive: list[NDArray[np.bool_]] = []
    observations = env.reset()
    running = np.arange(env.num_envs) < CRITICS
    while running.any():
        states.append(observations.astype(np.float64))
        alive.append(running.copy())
        placed = model.predict(observations, deterministic=True)[0]
        env.step_async(placed + deviation * rng.standard_normal(placed.shape))
        observations, rewarded, ended, _ = env.step_wait()
        rewards.append(np.where(running, rewarded, 0.0))
        running &= ~ended
    to_come = np.cumsum(np.array(rewards)[::-1], axis=0)[::-1]
    mask = np.array(alive)
    network = torch.nn.Sequential(model.policy.mlp_extractor.value_net, model.policy.value_net)
    _fit(network, np.array(states)[mask], to_come[mask][:, None], torch.nn.functional.mse_loss)
