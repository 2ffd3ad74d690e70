"""Physics: gravity, friction and push."""

from __future__ import annotations

from typing import Annotated

from msgspec.structs import asdict

from domino_env.core.checks import require_type
from domino_env.core.models import Amount, Size, Value, about
from domino_env.physics.layout import Layout

ESTABLISHED = "friction", "gravity", "push"  # fields that all digests contain


class Physics(Value, frozen=True):  # type: ignore[misc]
    """Gravity, friction and push.

    Parameters
    ----------
    friction
        Coulomb coefficient between dominoes, 0 for none; by default 0.25.
    gravity
        Acceleration of gravity [m/s²]; by default 9.81.
    push
        Angular velocity of domino 0 at t = 0 [rad/s]; by default 8.

    Raises
    ------
    ValueError
        For a number out of its range: friction 0 to 1e9, gravity and push 1e-9 to 1e9.
    """

    friction: Annotated[Amount, about("coefficient between dominoes; 0 for none")] = 0.25
    gravity: Annotated[Size, about("[m/s²]; 9.81 on Earth")] = 9.81
    push: Annotated[Size, about("angular velocity of domino 0 at t = 0 [rad/s]")] = 8.0

    @property
    def distinctive(self) -> dict[str, float]:
        """Friction, gravity and push, and the other fields that differ from their defaults.

        Digests of stored results are of these, so that a new field with its default changes none.
        """
        fields, defaults = asdict(self), asdict(type(self)())
        return {k: v for k, v in fields.items() if k in ESTABLISHED or v != defaults[k]}


STANDARD = Physics()  # default argument of the simulations


def require_arguments(layout: object, physics: object) -> None:
    """Check the types of the arguments `layout` and `physics`.

    Raises
    ------
    TypeError
        If `layout` is not a Layout or `physics` is not a Physics.
    """
    require_layout(layout)
    require_physics(physics)


def require_layout(layout: object) -> None:
    """Raise a TypeError for anything but a Layout."""
    example = "Layout(spacing=[0.018, 0.02], thickness=0.0075), in metres"
    require_type("layout", layout, Layout, f"a Layout, such as {example}")


def require_physics(physics: object) -> None:
    """Raise a TypeError for anything but a Physics."""
    example = "Physics(friction=0.25, push=8.0)"
    require_type("physics", physics, Physics, f"a Physics, such as {example}")
