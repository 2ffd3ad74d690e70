"""Long layouts: stretched from shorter ones, counted by their dominoes, the same when resumed."""

from dataclasses import replace

import domino_env as de
from optimize import search
from optimize.methods.search import long_layouts


def test_a_long_search_is_reproducible_and_beats_uniform(monkeypatch, tmp_path):
    monkeypatch.setattr(long_layouts, "SHORT_EVALUATIONS", 40)
    scene = replace(de.load_scene("marathon"), count=512)
    expected = search(scene, budget=36, seed=3)
    assert expected.evaluations == 36
    assert expected.gain > 0.02  # uniform layouts start slowly or are slow
    search(scene, budget=28, seed=3, folder=tmp_path / "run")
    resumed = search(scene, budget=36, seed=3, folder=tmp_path / "run", resume=True)
    assert resumed.layout == expected.layout
    assert resumed.score == expected.score
