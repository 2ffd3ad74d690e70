"""The best uniform row: of scenes that ship, as it comes with the package, and of long rows."""

from dataclasses import replace

import numpy as np
import pytest

import domino_env as de
from domino_env.scenes import uniform
from domino_env.scenes.objectives.base import Limits
from domino_env.scenes.uniform import best_point
from domino_env.scenes.uniform_layouts import UniformLayouts


def shipped(scene):
    return uniform._shipped_points().get(uniform.stamp(scene))


def test_every_mark_that_ships_is_of_the_scene_as_it_is_and_no_neighbour_beats_it() -> None:
    for name in de.scene_names():
        scene = de.load_scene(name)
        assert shipped(scene), f"{name}: run `python -m domino_env.scenes.shipping`"
        point = np.array(shipped(scene))
        rows, random = UniformLayouts(scene), np.random.default_rng(7)
        if scene.floor_friction is not None:  # its scores are known less closely
            near = point + np.array([[-1e-3, 0.0], [0.0, 0.0], [1e-3, 0.0]])
            assert rows.scores(near, 1e-3).max() <= rows.scores(near[1:2], 1e-3) * (1.0 + 3e-4)
            continue
        drawn = scene.criterion.simulations_per_score > 1
        near = point + 10.0 ** random.uniform(-6, -3, (6, 1)) * random.choice([-1.0, 1.0], (6, 2))
        far = random.uniform(rows.low, rows.high, (4 if drawn else 20, 2))
        others = np.clip(np.concatenate([near, far]), rows.low, rows.high)
        scores = rows.scores(np.concatenate([point[None], others]), 1e-8 if drawn else 1e-11)
        assert scores[1:].max() <= scores[0] * (1.0 + 1e-9), name


def test_a_mark_that_is_read_is_the_one_that_is_found_to_the_bit() -> None:
    for name in ("sprint", "stock", "course"):
        scene = de.load_scene(name)
        assert best_point(scene).tolist() == shipped(scene)


def test_a_scene_that_asks_otherwise_reads_no_mark() -> None:
    scene = de.load_scene("sprint")
    renamed = replace(scene, name="mine", title="the same under another name")
    assert shipped(renamed)
    for changed in ({"count": 41}, {"spacing": (0.002, 0.041)}, {"limits": Limits(0.1)}):
        assert not shipped(replace(scene, **changed))


def test_equal_scenes_share_their_mark() -> None:
    one, other = (replace(de.load_scene("sprint"), count=9, name="own") for _ in range(2))
    assert one is not other
    assert one.uniform() is other.uniform()


LONG = {
    "speed": {},
    "length": {"length": 3.2, "thickness": (0.005, 0.010)},
    "dying": {"physics": de.Physics(friction=0.25, push=0.5)},
    "limited": {"limits": Limits(stall_margin=0.3)},
    "list": {"spacing_values": tuple(1e-3 * np.arange(2, 40))},
    "toppled": {"objective": "toppled"},
}


@pytest.mark.parametrize("asked", LONG.values(), ids=LONG)
def test_long_rows_have_the_same_mark_by_their_first_dominoes_as_whole(asked, monkeypatch) -> None:
    for name in ("FULL", "BY_PREFIX"):
        monkeypatch.setattr(uniform, name, getattr(uniform, name)._replace(line=20))
    scene = replace(de.load_scene("marathon"), count=160, **asked)
    monkeypatch.setattr(uniform, "LARGEST_GRID", np.inf)
    whole = best_point(scene)
    monkeypatch.setattr(uniform, "LARGEST_GRID", 0)
    monkeypatch.setattr(UniformLayouts, "scores", _once(UniformLayouts.scores))
    by_prefix = best_point(scene)
    assert by_prefix == pytest.approx(whole, abs=2e-8)


def _once(scores):
    """Whole rows are toppled for one point only, the check at the end."""

    def checked(rows, points, rtol):
        assert len(points) == 1
        return scores(rows, points, rtol)

    return checked
