"""Policies for scenes whose pieces are drawn in random order.

- rule: the desired thickness is a function of the position in the chain; the gap is a
  function of the position, the thickness of the placed piece and that of the piece before it.
  Both together have 25 coefficients;
- open loop: a fixed sequence of gaps and desired thicknesses.

`docs/draw_references.py` fits both to the orders of `SELECTION_SEEDS` of the scene "draw" and
writes `draw.json` beside this file. The file also has the mean score [m/s] of layouts that were
optimised with the order known in advance ("hindsight").
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from agents.network import Policy
from domino_env import DominoChain, Scene
from domino_env.core.files import read_json
from domino_env.core.types import Floats, Singles

PATH = Path(__file__).with_name("draw.json")
# numbers of knots: of the desired thickness, of the gap, and of its derivatives with respect to the
# thickness of the placed piece and to that of the piece before it
KNOTS = 7, 10, 4, 4


@cache
def shipped_references() -> dict[str, Floats]:
    """Return the contents of `draw.json`: rule (25,), plan (39, 2) and hindsight () [m/s]."""
    return {name: np.array(values) for name, values in read_json(PATH).items()}


def rule(scene: Scene, coefficients: Floats) -> Policy:
    """Return the policy of the rule with given coefficients.

    Parameters
    ----------
    scene
        A scene with a hand.
    coefficients
        (25,), or (B, 25) for B environments: values at the knots, in units of actions.

    Returns
    -------
    callable
        Function from observations (…, O) to actions (…, 2): gap and desired thickness.
    """
    assert scene.stock is not None
    parts, pairs = DominoChain(scene).observation_layout, scene.count - 1
    low, high = scene.thickness
    # thicknesses as actions, from -1 to 1
    kinds = 2.0 * (np.array(scene.stock.thickness) - low) / (high - low) - 1.0
    first = 2.0 * (scene.first_thickness - low) / (high - low) - 1.0
    curves = np.split(coefficients, np.cumsum(KNOTS)[:-1], axis=-1)

    def policy(observation: Singles) -> Floats:
        n = np.rint(observation[..., parts["placed"].start] * pairs)
        # from 0 to 1, dense near both ends
        position = 0.5 + 0.5 * np.log((n + 1.0) / (pairs - n)) / np.log(pairs)
        desired, gap, by_piece, by_last = (_interpolate(position, values) for values in curves)
        desired = np.clip(desired, -1.0, 1.0)
        distance = np.abs(kinds - desired[..., None])
        distance[~(observation[..., parts["hand"]] > 0.0)] = np.inf
        piece = kinds[np.argmin(distance, axis=-1)]
        last = np.where(n > 0, observation[..., parts["thicknesses"].start], first)
        return np.stack([gap + by_piece * piece + by_last * last, desired], axis=-1)

    return policy


def _interpolate(position: Floats, values: Floats) -> Floats:
    """Interpolate linearly between values (…, K) at evenly spaced knots in [0, 1]."""
    last = values.shape[-1] - 1
    distance = np.abs(position[..., None] * last - np.arange(last + 1))
    return np.asarray(np.sum(np.maximum(1.0 - distance, 0.0) * values, axis=-1))


def open_loop(scene: Scene, actions: Floats) -> Policy:
    """Return the policy that takes (N-1, 2) actions in order and observes only its position."""
    placed, pairs = DominoChain(scene).observation_layout["placed"].start, scene.count - 1
    return lambda observation: np.asarray(
        actions[np.rint(observation[..., placed] * pairs).astype(np.int64)]
    )
