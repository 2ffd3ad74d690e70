"""What the model says of a measured row, as a function of the friction between dominoes."""

from __future__ import annotations

from functools import cache

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.steady import steady_wave
from domino_env.physics.wave import simulate
from domino_env.validation.measured.fit import Model
from domino_env.validation.measured.source import Quantity, Setting

RTOL = 1e-6  # of times; what is measured is known to a thousandth at best


def row_model(setting: Setting, quantity: Quantity, x: float) -> Model:
    """Make the model of a row.

    Parameters
    ----------
    setting
        What the experiment is taken to be.
    quantity
        What was measured.
    x
        Spacing, as `setting` reads it.

    Returns
    -------
    callable
        Hits a second, m/s or seconds by the friction; frequency and speed are 0 and a time is
        infinite where friction is too high for a wave. Each friction is worked out once.
    """
    pitch = setting.pitch(x)

    @cache
    def value(friction: float) -> float:
        frequency = _frequency(setting, pitch, friction)
        if quantity == "frequency":
            return frequency
        if quantity == "speed":
            return frequency * pitch
        return (setting.count - 1) / frequency if frequency else float("inf")

    return value


def speed_of(quantity: Quantity, setting: Setting, x: float, value: float) -> float:
    """What a measured value means as a speed [m/s]."""
    if quantity == "time":
        value = (setting.count - 1) / value
    return value if quantity == "speed" else value * setting.pitch(x)


def _frequency(setting: Setting, pitch: float, friction: float) -> float:
    """Hits a second, far down the row or in the mean of a whole one."""
    if setting.measured == "steady":
        physics = Physics(friction, setting.gravity)
        return steady_wave(pitch, setting.thickness, setting.height, physics, rtol=RTOL).frequency
    row = Layout.uniform(
        setting.count, pitch=pitch, thickness=setting.thickness, height=setting.height
    )
    wave = simulate(row, Physics(friction, setting.gravity, setting.push), rtol=RTOL)
    return float(wave.mean_speed / pitch)
