"""Scenes whose rules conflict are found before the search, and the rules are named."""

from dataclasses import replace

import pytest

import domino_env as de
from domino_env.scenes.rules import Stock
from domino_env.scenes.scene import Scene
from optimize import Problem, search
from optimize.constraints.feasible_set import conflicting_rules, require_feasible


def asking(**changes: object) -> Scene:
    return replace(de.load_scene("sprint"), count=9, name="asking", **changes)


GRID = tuple(round(0.002 + 0.0005 * k, 6) for k in range(77))
BOX = {"stock": Stock((0.005, 0.01), (5, 4)), "thickness": (0.005, 0.01),
       "thickness_values": (0.005, 0.01), "first_thickness": 0.005}  # fmt: skip

CONFLICTS = [
    (asking(length=0.18025, spacing_values=GRID),
     ["spacing only 0.002, 0.0025, … 0.04 m", "thickness = 0.0075 m", "row.length = 0.18025 m"]),
    # 2 mm and 40 mm would do, but not next to each other
    (asking(length=8 * 0.0075 + 7 * 0.002 + 0.04, spacing_values=(0.002, 0.04),
            largest_change=0.01),
     ["spacing only 0.002, 0.04 m", "spacing.largest_change = 0.01 m", "thickness = 0.0075 m",
      "row.length = 0.114 m"]),
]  # fmt: skip


@pytest.mark.parametrize(("scene", "names"), CONFLICTS)
def test_the_rules_that_conflict_are_named_and_no_others(scene: Scene, names: list[str]) -> None:
    assert conflicting_rules(scene) == names
    with pytest.raises(
        ValueError, match=r"scene 'asking': no layout of 9 dominoes keeps all"
    ) as error:
        search(scene, "random", budget=10)
    assert all(name in str(error.value) for name in names)


@pytest.mark.parametrize("scene", [
    asking(),
    asking(length=0.18, spacing_values=GRID),
    asking(length=8 * 0.0075 + 7 * 0.002 + 0.04, spacing_values=(0.002, 0.04)),
    asking(length=0.16, **BOX),
    asking(largest_change=0.0, spacing_values=(0.002, 0.04)),
])  # fmt: skip
def test_scenes_that_can_be_met(scene: Scene) -> None:
    assert conflicting_rules(scene) == []
    require_feasible(scene)
    Problem(scene)


@pytest.mark.parametrize("name", de.scene_names())
def test_scenes_that_ship_can_be_met(name: str) -> None:
    require_feasible(de.load_scene(name))
