"""Policies for scenes whose pieces are drawn in random order.

- rule: the desired thickness is a function of the position in the chain; the gap is a
  function of the position, the thickness of the placed piece and that of the piece before it.
  Both together have 25 coefficients;
- open loop: a fixed sequence of gaps and desired thicknesses.

Both are in relative sizes: -1 is the smallest gap or thickness of the scene, 1 the largest. Of the
pieces in hand, the one with the nearest thickness is taken.

`docs/draw_references.py` fits both to the orders of `SELECTION_SEEDS` of the scene "draw" and
writes `draw.json` beside this file. The file also has the mean score [m/s] of layouts that were
optimised with the order known in advance ("hindsight"). For other scenes, `fit_gaps` adapts the
gaps of the rule; without its reaction to pieces, it is an open loop.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from agents.network import Policy
from agents.rollout import SELECTION_SEEDS
from domino_env import DominoChain, DominoChainVector, Scene
from domino_env.core.files import read_json
from domino_env.core.types import Floats, Singles
from domino_env.envs.spaces import gap_entries
from optimize.methods.gradient.local_search import LocalSearch

PATH = Path(__file__).with_name("draw.json")
# numbers of knots: of the desired thickness, of the gap, and of its derivatives with respect to the
# thickness of the placed piece and to that of the piece before it
KNOTS = 7, 10, 4, 4
GRADIENTS = 40  # largest number of gradients of `fit_gaps`
WIDEST = 2.0  # size up to which `fit_gaps` changes coefficients


@cache
def shipped_references() -> dict[str, Floats]:
    """Return the contents of `draw.json`: rule (25,), plan (39, 2) and hindsight () [m/s]."""
    return {name: np.array(values) for name, values in read_json(PATH).items()}


def relative_kinds(scene: Scene) -> Floats:
    """Return the relative thicknesses (K,) of the kinds of a stock, thin to thick."""
    assert scene.stock is not None
    return relative(np.sort(scene.stock.thickness), scene.thickness)


def relative(sizes: Floats, bounds: tuple[float, float]) -> Floats:
    """Return the relative sizes of sizes [m] within bounds [m]."""
    low, high = bounds
    return np.asarray(2.0 * (sizes - low) / (high - low) - 1.0)


def absolute(relative_sizes: Floats, bounds: tuple[float, float]) -> Floats:
    """Return the sizes [m] of relative sizes within bounds [m]; inverse of `relative`."""
    low, high = bounds
    return np.asarray(low + 0.5 * (relative_sizes + 1.0) * (high - low))


def require_choices(scene: Scene) -> None:
    """Raise ValueError for fixed gaps, a single kind of pieces, or fewer than three dominoes."""
    if not scene.space.spacing.is_free or not scene.free_thickness or scene.count < 3:
        kinds, (low, high) = len(relative_kinds(scene)), scene.spacing
        raise ValueError(
            f"scene '{scene.name}' has {scene.count} dominoes of {kinds} kinds and gaps from "
            f"{low:g} to {high:g} m: to plan or rule drawn pieces, give three dominoes or more, "
            "two kinds or more and free gaps, or use another policy"
        )


def to_actions(scene: Scene, sizes: Floats) -> Floats:
    """Return the actions (…, 1 + K) for relative gaps and desired relative thicknesses (…, 2)."""
    gaps = absolute(sizes[..., :1], scene.spacing)
    distance = np.abs(relative_kinds(scene) - np.clip(sizes[..., 1:], -1.0, 1.0))
    return np.concatenate([gap_entries(scene, gaps), 1.0 - distance], axis=-1)


def rule(scene: Scene, coefficients: Floats) -> Policy:
    """Return the policy of the rule with given coefficients.

    Parameters
    ----------
    scene
        A scene with a hand.
    coefficients
        (25,), or (B, 25) for B environments: values at the knots, as relative sizes.

    Returns
    -------
    callable
        Function from observations (…, O) to actions (…, 1 + K).

    Raises
    ------
    ValueError
        For the reasons of `require_choices`.
    """
    require_choices(scene)
    sizes = rule_sizes(scene, coefficients)
    return lambda observation: to_actions(scene, sizes(observation))


def rule_sizes(scene: Scene, coefficients: Floats) -> Policy:
    """Return a function from observations to relative gaps and desired thicknesses (…, 2)."""
    parts, pairs = DominoChain(scene).observation_layout, scene.count - 1
    uniform = scene.uniform().layout.thickness[1]
    kinds, first = relative_kinds(scene), relative(np.array(scene.first_thickness), scene.thickness)
    curves = np.split(coefficients, np.cumsum(KNOTS)[:-1], axis=-1)

    def sizes(observation: Singles) -> Floats:
        n = np.rint(observation[..., parts["placed"].start] * pairs)
        position = _position(n, pairs)
        desired, gap, by_piece, by_last = (_interpolate(position, values) for values in curves)
        distance = np.abs(kinds - np.clip(desired, -1.0, 1.0)[..., None])
        distance[~(observation[..., parts["hand"]] > 0.0)] = np.inf
        piece = kinds[np.argmin(distance, axis=-1)]
        latest = uniform * np.exp(observation[..., parts["thicknesses"].start])  # [m]
        last = np.where(n > 0, relative(latest, scene.thickness), first)
        return np.stack([gap + by_piece * piece + by_last * last, desired], axis=-1)

    return sizes


def fit_gaps(scene: Scene, coefficients: Floats, *, reacts: bool = True) -> Floats:
    """Return a rule (25,) with gaps that are optimised by exact gradients on the planning orders.

    Parameters
    ----------
    scene
        A scene with a hand.
    coefficients
        (25,) rule to begin at, with the uniform baseline for its gaps; its desired thicknesses, on
        which the order of the pieces depends, are kept.
    reacts
        If False, gaps do not depend on pieces.

    Raises
    ------
    ValueError
        For the reasons of `require_choices`.
    """
    require_choices(scene)
    pairs, knots = scene.count - 1, np.cumsum(KNOTS)[:-1]
    position = _position(np.arange(pairs, dtype=np.float64), pairs)
    sizes = np.zeros((pairs, 2))
    sizes[:, 1] = _interpolate(position, coefficients[: knots[0]])
    env = DominoChainVector(len(SELECTION_SEEDS), scene)
    env.reset(seed=list(SELECTION_SEEDS))
    thickness = env.place_all(np.tile(to_actions(scene, sizes), (env.num_envs, 1, 1)))[1]
    first = np.full((env.num_envs, 1), scene.first_thickness)
    last = relative(np.hstack([first, thickness[:, :-1]]), scene.thickness)
    factors = np.ones_like(last), relative(thickness, scene.thickness), last
    # derivatives of the gaps (S, N-1) with respect to the coefficients, relative sizes
    basis = np.concatenate(
        [
            factor[..., None] * _interpolate(position[:, None], np.eye(number))
            for factor, number in zip(factors, KNOTS[1:], strict=True)
        ],
        axis=-1,
    )
    widths = np.full(basis.shape[-1], WIDEST)
    widths[KNOTS[1] :] *= reacts
    start = np.zeros(len(widths))
    start[: KNOTS[1]] = relative(scene.uniform().layout.spacing[:1], scene.spacing)
    low, high = scene.spacing
    search = LocalSearch(0.5 + 0.5 * start / WIDEST)
    while not search.done and search.evaluations < GRADIENTS:
        relative_gaps = basis @ (widths * (2.0 * search.candidate - 1.0))
        gaps = absolute(np.clip(relative_gaps, -1.0, 1.0), scene.spacing)
        result = scene.evaluate(scene.batch(gaps, thickness), gradient=True)
        assert result.gradient is not None
        by_gap = result.gradient.spacing * (np.abs(relative_gaps) < 1.0) * (high - low)
        gradient = widths * np.einsum("sn,snk->k", by_gap, basis) / len(gaps)
        search.update(float(result.score.mean()), gradient)
    return np.concatenate([coefficients[: knots[0]], widths * (2.0 * search.design - 1.0)])


def _position(n: Floats, pairs: int) -> Floats:
    """Return positions from 0 to 1, dense near both ends, after n of some gaps."""
    return np.asarray(0.5 + 0.5 * np.log((n + 1.0) / (pairs - n)) / np.log(pairs))


def _interpolate(position: Floats, values: Floats) -> Floats:
    """Interpolate linearly between values (…, K) at evenly spaced knots in [0, 1]."""
    last = values.shape[-1] - 1
    distance = np.abs(position[..., None] * last - np.arange(last + 1))
    return np.asarray(np.sum(np.maximum(1.0 - distance, 0.0) * values, axis=-1))


def open_loop(scene: Scene, sizes: Floats) -> Policy:
    """Return the policy of a sequence of relative gaps and desired thicknesses (N-1, 2)."""
    require_choices(scene)
    placed, pairs = DominoChain(scene).observation_layout["placed"].start, scene.count - 1
    actions = to_actions(scene, sizes)
    return lambda observation: np.asarray(
        actions[np.rint(observation[..., placed] * pairs).astype(np.int64)]
    )
