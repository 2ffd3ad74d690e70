"""What the model leaves out, as factors on its rows: gaps that are uneven, floors that slip."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import simulate, simulate_batch
from domino_env.rigid.simulation import simulate_standing
from domino_env.validation.measured.source import Setting

Effect = Callable[[Setting, float, float], float]
"""Speed with the effect over speed without, of a row of a setting at a pitch and a friction."""

FLOORS = (1.0, 0.5, 0.3)  # their friction
STANDING, SETTLED = 24, 10  # dominoes in a row that stands, and those before its wave is steady
RTOL = 1e-2  # of its times; what the coarsest steps give is within 0.1 % of what the finest do
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
    physics = Physics(friction, setting.gravity, _push(setting))
    thickness = np.full(DOMINOES, setting.thickness)
    times = simulate_batch(gaps, thickness, physics, height=setting.height).arrival_times
    length = gaps[:, STARTED:].sum(axis=1) + (DOMINOES - 1 - STARTED) * setting.thickness
    speed = length / (times[:, -1] - times[:, STARTED])
    fell = np.isfinite(speed) & (speed > 0.0)
    return float(speed[1:][fell[1:]].mean() / speed[0]) if fell[0] and fell[1:].any() else 1.0


def slipping(floor: float, setting: Setting, pitch: float, friction: float) -> float:
    """Find what a floor costs on which feet may slide and lift.

    Parameters
    ----------
    floor
        Its friction.
    setting, pitch, friction
        The row; the wave far down it is compared with that of a row whose feet stay.
    """
    row = Layout.uniform(STANDING, pitch=pitch, thickness=setting.thickness, height=setting.height)
    physics = Physics(friction, setting.gravity, _push(setting))
    free = simulate_standing(row, physics, floor_friction=floor, rtol=RTOL).arrival_times
    held = simulate(row, physics).arrival_times
    spent = free[-1] - free[SETTLED], held[-1] - held[SETTLED]
    return float(spent[1] / spent[0]) if np.all(np.isfinite(spent)) else 0.0


def _push(setting: Setting) -> float:
    """A firm push, whatever the size [rad/s]."""
    return float(np.sqrt(setting.gravity / setting.height))


EFFECTS: Mapping[str, Effect] = {
    "gaps uneven by 1 % of the height": partial(uneven, 0.01),
    "gaps uneven by 2 % of the height": partial(uneven, 0.02),
} | {f"a floor of friction {floor:g}": partial(slipping, floor) for floor in FLOORS}
