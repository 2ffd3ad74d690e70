"""Long layouts: stretched from shorter ones, counted by their dominoes, the same when resumed."""

from dataclasses import replace

import numpy as np

import domino_env as de
from optimize import search
from optimize.methods.search import long_layouts
from optimize.methods.search.long_layouts import best_steady


def test_no_steady_wave_beats_the_best_one():
    scene = de.load_scene("gentle")
    gap, thickness = best_steady(scene)

    def speed(s: float, d: float) -> float:
        return de.steady_wave(s + d, d, scene.height, scene.physics).speed

    best = speed(gap, thickness)
    random = np.random.default_rng(2)
    for s, d in random.uniform(*np.array([scene.spacing, scene.thickness]).T, (100, 2)):
        assert speed(s, d) <= best
    assert best_steady(replace(scene, length=1.0)) is None


def test_a_long_search_is_bitwise_reproducible_and_beats_the_uniform_baseline(
    monkeypatch, tmp_path
):
    monkeypatch.setattr(long_layouts, "SEARCHED", 40)
    scene = replace(de.load_scene("marathon"), count=512)
    whole = search(scene, budget=36, seed=3)
    assert whole.evaluations == 36
    assert whole.gain > 0.02  # uniform layouts start slowly or are slow
    search(scene, budget=28, seed=3, folder=tmp_path / "run")
    resumed = search(scene, budget=36, seed=3, folder=tmp_path / "run", resume=True)
    assert resumed.layout == whole.layout
    assert resumed.score == whole.score
