"""Scene distributions: files with ranges, sampled scenes, test sets."""

import tomllib

import numpy as np
import pytest
from sampled_scenes import TEXT, small_scenes

import domino_env as de
from domino_env.scenes import distribution
from domino_env.scenes.pool import ScenePool, load_test_set
from domino_env.scenes.uniform import best_point
from domino_env.scenes.uniform_layouts import UniformLayouts


def out_of_range(distribution, scene):
    """Return how many numbers of a scene are out of their ranges."""
    scaled = distribution.scale(distribution.numbers(scene))
    return int(np.sum(np.abs(scaled) > 1.0 + 1e-6))


@pytest.mark.parametrize("name", de.distribution_names())
def test_stored_scenes_are_valid_and_equal_to_newly_sampled_ones(name):
    drawn_from = de.load_distribution(name)
    written = de.SceneDistribution(tomllib.loads(drawn_from.to_toml()), "another")
    assert written == drawn_from
    is_random = name in ("varied-draw", "varied-tempo")
    tests, validation = (load_test_set(name, kind) for kind in ("test", "validation"))
    assert (len(tests), len(validation)) == ((100, 50) if is_random else (200, 100))
    scenes = [*tests, *validation]
    assert len(set(scenes)) == len(scenes)
    for scene in scenes:
        assert out_of_range(drawn_from, scene) == 0
    assert scenes[0].uniform().score > 0.0
    if name != "varied-beyond":
        i = 40  # the files hold what is sampled now
        stored, anew = ScenePool(drawn_from), ScenePool(drawn_from)
        assert not np.isnan(stored.points).any()
        anew.points[i] = np.nan
        again, scene = anew.scene(i), stored.scene(i)
        assert again == scene
        assert again.uniform().score == pytest.approx(scene.uniform().score, rel=1e-9)


def test_scenes_with_a_stock_are_sampled():
    document = de.load_scene("stock").document()
    document["physics"]["friction"] = {"min": 0.1, "max": 0.4}
    drawn_from = de.SceneDistribution(document, "boxes")
    scene = de.DominoChain(drawn_from).reset(seed=0)[1]["scene"]
    assert scene.stock == de.load_scene("stock").stock
    assert 0.1 <= scene.physics.friction <= 0.4


def test_thicknesses_of_a_box_and_the_schedule_are_sampled():
    for name, places in (
        ("varied-draw", {"stock thickness[0]", "stock thickness[2]"}),
        ("varied-tempo", {"tempo from", "tempo to"}),
    ):
        drawn_from = de.load_distribution(name)
        scenes = [drawn_from.sample(seed) for seed in range(2)]
        assert places < set(drawn_from.features)
        for scene in scenes:
            again = drawn_from.scene(drawn_from.numbers(scene), scene.name)
            assert again.document() == scene.document()
        assert scenes[0].settings != scenes[1].settings or scenes[0].stock != scenes[1].stock
        with pytest.raises(ValueError, match="differs from those of"):
            drawn_from.numbers(scenes[0].replace(density=900.0))


def test_numbers_of_the_test_set_beyond_the_ranges_are_out_of_range():
    varied = de.load_distribution("varied")
    for scene in de.load_test_set("varied-beyond"):
        assert out_of_range(varied, scene) >= 5  # one may lie on the edge


@pytest.mark.parametrize("name", ["varied", "varied-course"])
def test_the_quick_baseline_equals_that_of_the_full_search(name):
    for scene in de.load_test_set(name)[::40]:
        quick = UniformLayouts(scene).layout(best_point(scene, quick=True))
        assert scene.score(quick) == pytest.approx(scene.uniform().score, rel=1e-7)
    searched = scene.replace(name="another").uniform()  # without a stored baseline
    assert scene.uniform().score == pytest.approx(searched.score, rel=1e-9)


def test_a_scene_has_the_numbers_it_was_made_from():
    small, rng = small_scenes(), np.random.default_rng(5)
    low, high = np.array([(r.min, r.max) for r in small.ranges.values()]).T
    for _ in range(30):
        scene = small.sample(rng)
        numbers = small.numbers(scene)
        assert (numbers >= low * (1.0 - 1e-12)).all()
        assert (numbers <= high * (1.0 + 1e-12)).all()
        again = small.scene(numbers)
        np.testing.assert_allclose(small.numbers(again), numbers, rtol=1e-12)
        assert np.abs(small.scale(numbers)).max() <= 1.0 + 1e-9
    np.testing.assert_allclose(np.abs(small.scale(np.array([low, high]))), 1.0)
    assert small == small_scenes()
    far = scene.replace(physics=scene.physics.replace(friction=0.7))
    assert out_of_range(small, far) == 1
    with pytest.raises(ValueError, match=r"differs from those of 'small' in more than friction, "):
        small.numbers(scene.replace(width=0.03))


@pytest.mark.parametrize(("old", "new", "words"), [
    ("min = 0.0, max = 0.4", "min = 0.5, max = 0.4", "physics.friction.min = 0.5 is more"),
    ("min = 0.5,", "min = 0.0,", 'give more than 0 for spread = "log"'),
    ("min_ratio = 2", "min_ratio = 5", "spacing.max = 0.9: give at least min_ratio = 5"),
    ("count = {min = 4,", "count = {min = 4.5,", "row.count = 4.5 to 9.0: give whole numbers"),
    ("min = 1.6,", 'of = "height", min = 1.6,', "physics.gravity.of = 'height': only for"),
    ("{min = 0.03,", "{least = 0.03,", "unknown key 'row.height.least'"),
    ("0.012}", '0.012, min_ratio = 1, of = "height"}', "give `of` in both min and max"),
    ("[thickness]", "[stock]\ncount = [{min = 3, max = 9}]\n[thickness]",
     r"stock.count\[0\]: only thicknesses may have ranges"),
])  # fmt: skip
def test_invalid_ranges_are_rejected(old, new, words):
    assert old in TEXT
    with pytest.raises(ValueError, match=words):
        de.SceneDistribution(tomllib.loads(TEXT.replace(old, new)), "wrong")


def test_a_distribution_is_read_from_a_file_of_its_own(tmp_path, monkeypatch):
    file = tmp_path / "mine.toml"
    file.write_text(TEXT)
    assert de.DominoChain(file).distribution == de.load_distribution(file)
    assert de.load_distribution(file).name == "mine"
    monkeypatch.setattr(distribution, "MAX_SAMPLES", 5)
    with pytest.raises(ValueError, match="none of 5 scenes can be used "):
        de.SceneDistribution(tomllib.loads(TEXT.replace("0.007", "1e-12")), "none")
