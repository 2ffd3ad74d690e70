"""Policies for scenes whose pieces are drawn in random order, all with the same hand.

- rule: pieces by a template of thickness over the position, gaps by the position, the piece that is
  placed and the one before it; 25 numbers;
- open loop: a fixed sequence of gaps and wished thicknesses.

Both are fitted to the orders of `PLANNING_SEEDS` of the scene "draw" by `docs/draw_references.py`,
which writes `draw.json` beside this file, with the mean score in hindsight.
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
PARTS = 7, 10, 4, 4  # knots of template and gap, and of the gap's change with both thicknesses


@cache
def numbers() -> dict[str, Floats]:
    """Return the numbers that were fitted to the scene "draw": rule (25,) and plan (39, 2)."""
    return {name: np.array(values) for name, values in read_json(PATH).items()}


def rule(scene: Scene, numbers: Floats) -> Policy:
    """Return the policy with some numbers of the rule.

    Parameters
    ----------
    scene
        A scene with a hand.
    numbers
        (25,), or (B, 25) for B environments: knots over the position, dense near both ends, of the
        wished thickness, the gap, and its change with the thickness placed and the one before. All
        are in units of actions.
    """
    assert scene.stock is not None
    layout, pairs = DominoChain(scene).observation_layout, scene.count - 1
    low, high = scene.thickness
    kinds = 2.0 * (np.array(scene.stock.thickness) - low) / (high - low) - 1.0
    first = 2.0 * (scene.first_thickness - low) / (high - low) - 1.0
    parts = np.split(numbers, np.cumsum(PARTS)[:-1], axis=-1)

    def policy(observation: Singles) -> Floats:
        n = np.rint(observation[..., layout["placed"].start] * pairs)
        place = 0.5 + 0.5 * np.log((n + 1.0) / (pairs - n)) / np.log(pairs)
        wish, gap, own, before = (_between(place, knots) for knots in parts)
        wish = np.clip(wish, -1.0, 1.0)
        away = np.abs(kinds - wish[..., None])
        away[~(observation[..., layout["hand"]] > 0.0)] = np.inf
        piece = kinds[np.argmin(away, axis=-1)]
        last = np.where(n > 0, observation[..., layout["thicknesses"].start], first)
        return np.stack([gap + own * piece + before * last, wish], axis=-1)

    return policy


def _between(place: Floats, knots: Floats) -> Floats:
    """Interpolate values at knots (…, K), which are evenly spaced, at places in [0, 1]."""
    last = knots.shape[-1] - 1
    away = np.abs(place[..., None] * last - np.arange(last + 1))
    return np.asarray(np.sum(np.maximum(1.0 - away, 0.0) * knots, axis=-1))


def fixed(scene: Scene, actions: Floats) -> Policy:
    """Return the policy that takes (N-1, 2) actions one after another, whatever it observes."""
    placed = DominoChain(scene).observation_layout["placed"].start
    pairs = scene.count - 1
    return lambda o: np.asarray(actions[np.rint(o[..., placed] * pairs).astype(np.int64)])
