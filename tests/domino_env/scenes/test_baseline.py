"""Uniform baselines: stored ones of shipped scenes, and those of long layouts."""

import numpy as np
import pytest

import domino_env as de
from domino_env.scenes import uniform
from domino_env.scenes.uniform import best_point, stored_point
from domino_env.scenes.uniform_layouts import UniformLayouts


def shipped(scene):
    return stored_point(scene.document())


def test_every_shipped_baseline_is_current_and_beats_its_neighbours():
    for name in de.scene_names():
        scene = de.load_scene(name)
        assert shipped(scene), f"{name}: run `python docs/shipped_scenes.py`"
        point = np.array(shipped(scene))
        layouts, random = UniformLayouts(scene), np.random.default_rng(7)
        if scene.floor_friction is not None:  # its scores are known less closely
            near = point + np.array([[-1e-3, 0.0], [0.0, 0.0], [1e-3, 0.0]])
            scores = layouts.scores(near, 1e-3)
            assert scores.max() <= scores[1] * (1.0 + 3e-4)
            continue
        sampled = scene.scoring.cost > 1
        near = point + 10.0 ** random.uniform(-6, -3, (6, 1)) * random.choice([-1.0, 1.0], (6, 2))
        far = random.uniform(layouts.low, layouts.high, (4 if sampled else 20, 2))
        others = np.clip(np.concatenate([near, far]), layouts.low, layouts.high)
        scores = layouts.scores(np.concatenate([point[None], others]), 1e-8 if sampled else 1e-11)
        assert scores[1:].max() <= scores[0] * (1.0 + 1e-9), name


def test_a_stored_baseline_equals_the_computed_one_bitwise():
    for name in ("sprint", "stock", "course"):
        scene = de.load_scene(name)
        assert tuple(best_point(scene)) == shipped(scene)


def test_a_changed_scene_has_no_stored_baseline():
    scene = de.load_scene("sprint")
    renamed = scene.replace(name="mine", title="the same under another name")
    assert shipped(renamed)
    for changed in ({"count": 41}, {"spacing": (0.002, 0.041)}, {"limits": de.Limits(0.1)}):
        assert not shipped(scene.replace(**changed))


LONG = {
    "speed": {},
    "length": {"length": 3.2, "thickness": (0.005, 0.010)},
    "dying": {"physics": de.Physics(friction=0.25, push=0.5)},
    "limited": {"limits": de.Limits(stall_margin=0.3)},
}


@pytest.mark.parametrize("changes", LONG.values(), ids=LONG)
def test_first_dominoes_of_a_long_layout_give_its_baseline(changes, monkeypatch):
    for name in ("FULL", "BY_PREFIX"):
        monkeypatch.setattr(uniform, name, getattr(uniform, name)._replace(line=20))
    scene = de.load_scene("marathon").replace(count=160, **changes)
    monkeypatch.setattr(uniform, "MAX_GRID", np.inf)
    whole = best_point(scene)
    monkeypatch.setattr(uniform, "MAX_GRID", 0)
    monkeypatch.setattr(UniformLayouts, "scores", _once(UniformLayouts.scores))
    by_prefix = best_point(scene)
    assert by_prefix == pytest.approx(whole, abs=2e-8)


def _once(scores):
    """Require that whole layouts are simulated for one point only, the final check."""

    def checked(layouts, points, rtol):
        assert len(points) == 1
        return scores(layouts, points, rtol)

    return checked
