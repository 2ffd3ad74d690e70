"""Pools of a user's own distributions: which baselines are computed, and where they are kept."""

import logging

import numpy as np
import pytest
from numba.core import config
from sampled_scenes import small_scenes

import domino_env as de
from domino_env.envs import catalogue
from domino_env.scenes import pool as pools
from domino_env.scenes.pool import ScenePool


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A distribution whose baselines are not known, and the list of those that are computed."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    catalogue.shared_pool.cache_clear()
    computed, search = [], pools.best_point
    monkeypatch.setattr(
        pools,
        "best_point",
        lambda scene, quick: computed.append(scene) or search(scene, quick=quick),
    )
    yield small_scenes(), computed
    catalogue.shared_pool.cache_clear()


def test_only_baselines_of_sampled_scenes_are_computed(own):
    distribution, computed = own
    few = de.DominoChainVector(64, distribution, num_scenes=3, first_scene=60)
    few.reset(seed=0)
    assert {scene.name for scene in few.scenes} == {f"small-{i}" for i in (60, 61, 62)}
    assert 3 <= len(computed) <= 6  # scenes without a positive score are sampled again
    envs = de.DominoChainVector(4, distribution)
    envs.reset(seed=0)
    assert len(computed) <= 6 + 2 * 5  # the scene before the first reset, and those of the reset
    known = len(computed)
    envs.reset(seed=0)
    assert len(computed) == known


def test_baselines_are_kept_for_other_processes(own, tmp_path):
    distribution, computed = own
    first = ScenePool(distribution).scenes([5, 2])
    known = len(computed)
    again = ScenePool(distribution)
    assert again.is_known(np.arange(7)).tolist() == [i in (2, 5) for i in range(7)]
    scenes = again.scenes([5, 2])
    assert scenes == first
    assert [s.uniform_point for s in scenes] == [s.uniform_point for s in first]
    assert len(computed) == known
    numbers = distribution.numbers(first[0])
    np.testing.assert_allclose(again.features[5], distribution.scale(numbers), rtol=1e-12)

    other = small_scenes("[limits]\nstall_margin = 0.1\n")  # scenes differ, and so do baselines
    assert not ScenePool(other).is_known(np.array([5, 2])).any()

    (file,) = tmp_path.glob("baselines/*.csv")
    lines = file.read_bytes()
    for damage in (lines[:-9], lines.replace(b".", b"x"), b"\xff" * 300, lines.replace(b"1", b"2")):
        file.write_bytes(damage)
        points = ScenePool(distribution).points
        known = ~np.isnan(points[:, 0])
        assert known.sum() <= 1
        np.testing.assert_array_equal(points[known], again.points[known])
    file.unlink()
    file.mkdir()  # a folder that cannot be read or written as a file
    assert ScenePool(distribution).scenes([5]) == first[:1]


def test_the_user_is_told_of_baselines_that_take_long(own, monkeypatch, caplog):
    distribution, _ = own
    with caplog.at_level(logging.WARNING, "domino_env"):
        monkeypatch.setattr(pools, "UNNOTICED", np.inf)
        pool = ScenePool(distribution)
        pool.scenes([0])
        assert not [line for line in caplog.messages if "baseline" in line]
        monkeypatch.setattr(pools, "UNNOTICED", 0.0)
        pool.scenes([1, 2, 3])
        pool.scenes([4])
    (line,) = [line for line in caplog.messages if "baseline" in line]
    assert line == (
        "computing the uniform baseline of each scene that is sampled from 'small', once: 2 are "
        "known, 2 more are needed now ..."
    )
