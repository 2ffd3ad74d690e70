"""Physics: values and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import domino_env as de
from domino_env.physics.physics import Physics


def test_defaults_and_whole_numbers_become_floats() -> None:
    physics = Physics(friction=0, gravity=10, push=3)
    assert (physics.friction, physics.gravity, physics.push) == (0.0, 10.0, 3.0)
    values = physics.friction, physics.gravity, physics.push
    assert all(type(value) is float for value in values)
    assert Physics(push=np.float64(3.0)).replace(friction=0, gravity=np.int64(10)) == physics
    assert Physics() == Physics(0.25, 9.81, 8.0)


@pytest.mark.parametrize(("name", "value", "words"), [
    ("friction", -0.1, "friction = -0.1: give a finite number from 0 to 1e+09"),
    ("friction", float("nan"), "friction = nan"),
    ("friction", float("inf"), "friction = inf"),
    ("gravity", 0.0, "gravity = 0.0: give a finite number from 1e-09"),
    ("gravity", -9.81, "gravity = -9.81"),
    ("gravity", float("inf"), "gravity = inf"),
    ("push", 0.0, "push = 0.0: give a finite number from 1e-09"),
    ("push", -1.0, "push = -1.0"),
    ("push", float("nan"), "push = nan"),
])  # fmt: skip
def test_no_physics_is_refused_with_its_value(name: str, value: float, words: str) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
        Physics(**{name: value})
    assert str(refused.value).startswith(words)


def test_physics_cannot_be_changed() -> None:
    with pytest.raises(AttributeError, match="immutable"):
        Physics().push = 1.0  # type: ignore[misc]


@pytest.mark.parametrize("function", [de.simulate, de.diagnose, de.smallest_push])
def test_what_is_no_row_or_no_physics_is_told_what_is_wanted(function) -> None:
    with pytest.raises(
        TypeError, match=r"layout is a list: give a Layout, such as Layout\(spacing="
    ):
        function([0.018, 0.02], Physics())
    with pytest.raises(TypeError, match=r"physics is a float: give a Physics, such as Physics\("):
        function(de.Layout([0.018], 0.0075), 0.25)
