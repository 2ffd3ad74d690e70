"""Physics: what makes a row fall."""

from __future__ import annotations

from dataclasses import dataclass

from domino_env.core.checks import require
from domino_env.physics.layout import Layout


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
        require("friction", self.friction, 0.0, hint="0 leaves it out")
        require("gravity", self.gravity, above=0.0, unit="m/s²", hint="9.81 on Earth")
        require("push", self.push, above=0.0, unit="rad/s", hint="nothing falls unpushed")
        for name in ("friction", "gravity", "push"):
            object.__setattr__(self, name, float(getattr(self, name)))


def require_row(layout: object, physics: object) -> None:
    """Refuse what is no row, or no physics, with how to make one.

    Raises
    ------
    TypeError
        For anything but a Layout and a Physics, in this order.
    """
    if not isinstance(layout, Layout):
        raise TypeError(
            f"layout is a {type(layout).__name__}: give a Layout, such as "
            "Layout(spacing=[0.018, 0.02], thickness=0.0075), in metres"
        )
    if not isinstance(physics, Physics):
        raise TypeError(
            f"physics is a {type(physics).__name__}: give a Physics, such as "
            "Physics(friction=0.25, push=8.0)"
        )
