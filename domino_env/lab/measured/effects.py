"""What the model leaves out, as factors on its rows: gaps that are uneven, floors that slip."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from domino_env.chain.physics import Physics
from domino_env.chain.wave import simulate_batch
from domino_env.lab.measured.source import Setting

Effect = Callable[[Setting, float, float], float]
"""Speed with the effect over speed without, of a row of a setting at a pitch and a friction."""

DRAWS, SEED = 20, 18  # rows with uneven gaps, and their seed
DOMINOES, STARTED = 60, 20  # in them, and those before the wave counts as steady
NARROWEST, HIGHEST = 0.05, 0.999  # [gaps], [heights]: gaps drawn beyond are as wide as this


def uneven(deviation: float, setting: Setting, pitch: float, friction: float) -> float:
    """Find what gaps that scatter cost, in the mean over rows.

    Parameters
    ----------
    deviation
        Standard deviation of a gap [heights].
    setting, pitch, friction
        The row; the wave far down it is compared.
    """
    gap = pitch - setting.thickness
    draws = np.random.default_rng(SEED).standard_normal((DRAWS, DOMINOES - 1))
    gaps = np.vstack([np.full(DOMINOES - 1, gap), gap + deviation * setting.height * draws])
    gaps = np.clip(gaps, NARROWEST * gap, HIGHEST * setting.height)
    push = float(np.sqrt(setting.gravity / setting.height))  # a firm one, whatever the size
    physics = Physics(friction, setting.gravity, push)
    thickness = np.full(DOMINOES, setting.thickness)
    times = simulate_batch(gaps, thickness, physics, height=setting.height).arrival_times
    length = gaps[:, STARTED:].sum(axis=1) + (DOMINOES - 1 - STARTED) * setting.thickness
    speed = length / (times[:, -1] - times[:, STARTED])
    fell = np.isfinite(speed) & (speed > 0.0)
    return float(speed[1:][fell[1:]].mean() / speed[0]) if fell[0] and fell[1:].any() else 1.0


EFFECTS: dict[str, Effect] = {
    "gaps uneven by 1 % of the height": partial(uneven, 0.01),
    "gaps uneven by 2 % of the height": partial(uneven, 0.02),
}
