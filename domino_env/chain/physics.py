"""Physics: what makes a row fall."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Physics:
    """Gravity, friction and push.

    Parameters
    ----------
    friction
        Coulomb coefficient between dominoes, 0 or more; 0 leaves all friction terms out.
    gravity
        [m/s²]
    push
        Angular velocity of domino 0 at t = 0 [rad/s].

    Raises
    ------
    ValueError
        For a number that is not finite or out of its range; says the value and what to do.
    """

    friction: float = 0.25
    gravity: float = 9.81
    push: float = 8.0

    def __post_init__(self) -> None:
        _require("friction", self.friction, "", self.friction >= 0.0, "0 (no friction) or more")
        _require("gravity", self.gravity, " m/s²", self.gravity > 0.0, "more than 0; 9.81 on Earth")
        _require(
            "push", self.push, " rad/s", self.push > 0.0, "more than 0: nothing falls unpushed"
        )
        for name in ("friction", "gravity", "push"):
            object.__setattr__(self, name, float(getattr(self, name)))


def _require(name: str, value: float, unit: str, good: bool, wanted: str) -> None:
    if not (good and math.isfinite(value)):
        raise ValueError(f"{name} = {value}{unit}: give a finite number, {wanted}")
