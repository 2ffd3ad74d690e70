"""Physics: gravity, friction and push."""

from __future__ import annotations

import math
from typing import Annotated, Self

from msgspec.structs import asdict

from domino_env.core.checks import require_type
from domino_env.core.models import Amount, Size, Value, about
from domino_env.physics.layout import Layout

ESTABLISHED = "friction", "gravity", "push"  # fields that all digests contain
ROUNDED_PUSH = 2e-3  # relative difference of a push that counts as that of a released domino
RELEASED = 0.1  # angular velocity at the balance of a released domino, over the smallest push


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

    @classmethod
    def released(cls, layout: Layout, friction: float = 0.25, gravity: float = 9.81) -> Self:
        """Return physics in which the first domino is released: a slow finger tips it past balance.

        It passes its balance at a tenth of the smallest push that tips it, which is 13 mm/s at the
        top of a standard domino. A slower finger delays all hits by the same time, and after the
        first hit no time changes by more than 0.1 %.

        Parameters
        ----------
        layout
            The layout. Its first gap lets the domino tip over before it hits the next one.
        friction
            Coulomb coefficient between dominoes.
        gravity
            Acceleration of gravity [m/s²].

        Returns
        -------
        Physics
            Physics with the push of the release.

        Raises
        ------
        TypeError
            For a layout of another type.
        ValueError
            For a number out of its range.

        Examples
        --------
        >>> import domino_env as de
        >>> layout = de.Layout.uniform(40, pitch=0.02)
        >>> round(de.Physics.released(layout).push, 3)
        2.708
        """
        require_layout(layout)
        height, thickness = float(layout.height[0]), float(layout.thickness[0])
        physics = cls(friction, gravity)
        return physics.replace(
            push=released_push(height, thickness, physics.gravity, float(layout.tilt[0]))
        )

    def is_released(self, layout: Layout) -> bool:
        """Return True if the push is that of a released first domino, which may be rounded."""
        released = type(self).released(layout, gravity=self.gravity).push
        return abs(self.push / released - 1.0) < ROUNDED_PUSH


def released_push(height: float, thickness: float, gravity: float, tilt: float = 0.0) -> float:
    """Return the push of a released domino [rad/s]; sizes in m, gravity in m/s², tilt in rad."""
    # from upright, the centre of mass rises over the front edge
    diagonal, angle = math.hypot(height, thickness), math.atan2(thickness, height) - tilt
    smallest = math.sqrt(6.0 * gravity / diagonal) * math.sin(0.5 * angle)
    return math.hypot(1.0, RELEASED) * smallest


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
