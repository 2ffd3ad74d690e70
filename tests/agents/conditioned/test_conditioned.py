"""The scene-conditioned policy: what it designs, what it needs, how it is trained."""

from __future__ import annotations

import csv
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
import domino_env.scenes.scene
from agents import evaluate
from agents.base.building import build
from agents.base.shipped import FAMILY, POLICIES
from agents.conditioned.designing import acting, design
from agents.conditioned.distribution import SceneDistribution, features_of, scene_with
from agents.conditioned.examples import load_examples, make_examples
from agents.conditioned.observations import PLANS, plans_of
from agents.conditioned.policy import ConditionedPolicy, shipped_policy
from agents.conditioned.preset import EXAMPLES_SEED, ConditionedPreset
from agents.evaluation.many_scenes import evaluate_scenes
from agents.evaluation.one_scene import load_policy
from domino_env.cli.main import main

WEIGHTS = POLICIES / FAMILY / "policy.npz"
REFUSED = r"policy\.npz: it (does not hold|is no archive)"
SHORT = SceneDistribution(count=(15, 24))  # its marks are found quickly
TINY = SceneDistribution(count=(8, 10))
LITTLE = ConditionedPreset(
    width=8, examples=3, evaluations=30, passes=4, together=2, batches=6, scenes=2
)


@pytest.fixture
def sprint():
    return de.load_scene("sprint")


# scenes -------------------------------------------------------------------------------------------


def test_drawn_scenes_are_within_the_family_and_some_uniform_row_runs() -> None:
    distribution = SceneDistribution()
    rng = np.random.default_rng(3)
    drawn = [distribution.sample(rng) for _ in range(40)]
    assert all(distribution.outside(scene) == () for scene in drawn)
    assert all(scene.spacing[1] >= distribution.apart * scene.spacing[0] for scene in drawn)
    for scene in drawn[:3]:
        assert scene.uniform().score > 0.0
        again = scene_with(features_of(scene))
        assert features_of(again) == pytest.approx(features_of(scene), rel=1e-15)
    counts = [scene.count for scene in drawn]
    assert min(counts) < 25
    assert max(counts) > 60
    repeated = np.random.default_rng(3)
    assert np.array_equal(features_of(distribution.sample(repeated)), features_of(drawn[0]))


def test_a_scene_beyond_the_distribution_is_told(sprint) -> None:
    assert design(sprint).outside == ()
    long = design(replace(sprint, count=100))
    assert long.outside == ("count 100 is outside 15 to 80",)
    assert long.score > 0.0


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("course", "asks for a length"),
        ("tempo", "its objective is tempo"),
        ("sprint-thickness", "its dominoes differ"),
        ("stock", "its dominoes differ"),
        ("jitter", "its objective is robust"),
    ],
)
def test_another_kind_of_scene_is_refused(name: str, reason: str) -> None:
    with pytest.raises(ValueError, match=f"{reason}.*domino optimize"):
        design(name)


# designing ----------------------------------------------------------------------------------------


def test_the_policy_that_ships_beats_uniform_in_scenes_it_has_not_seen() -> None:
    found = evaluate_scenes(40, seed=7, distribution=SHORT)
    assert np.mean(found.tried > found.uniform * (1.0 + 1e-9)) >= 0.9
    assert np.all(found.tried >= found.untried - 1e-9)
    assert np.all(found.tried > 0.0)
    with pytest.raises(ValueError, match="drew the examples"):
        evaluate_scenes(3, seed=EXAMPLES_SEED)


def test_designs_keep_the_rules_and_are_scored_by_the_scene() -> None:
    rng = np.random.default_rng(11)
    for _ in range(20):
        scene = SceneDistribution().sample(rng)
        made = design(scene)
        assert scene.violations(made.layout) == []
        assert made.score == scene.score(made.layout)
        tight = made.layout.spacing == scene.spacing[0]
        assert tight[scene.count - 1 - made.plan :].all()
        assert 0 <= made.plan < plans_of(scene.count) <= PLANS


def test_a_design_scales_with_the_dominoes(sprint) -> None:
    k = 3.7
    large = replace(
        sprint,
        height=k * sprint.height,
        width=k * sprint.width,
        first_thickness=k * sprint.first_thickness,
        spacing=(k * sprint.spacing[0], k * sprint.spacing[1]),
        thickness=(k * sprint.thickness[0], k * sprint.thickness[1]),
        physics=de.Physics(0.25, 9.81, 8.0 / np.sqrt(k)),
        density=500.0,
    )
    small, big = design(sprint), design(large)
    assert big.plan == small.plan
    assert big.layout.spacing == pytest.approx(k * small.layout.spacing, rel=1e-5)
    assert big.score == pytest.approx(np.sqrt(k) * small.score, rel=1e-5)
    strong = replace(
        sprint, physics=de.Physics(0.25, 4.0 * 9.81, 2.0 * sprint.physics.push)
    )  # time runs twice as fast
    assert design(strong).layout.spacing == pytest.approx(small.layout.spacing, rel=1e-5)


def test_a_design_does_not_ask_for_the_best_uniform_row(sprint, monkeypatch) -> None:
    def refused(*asked: object) -> None:
        raise AssertionError("the search of the mark takes longer than a design")

    monkeypatch.setattr(domino_env.scenes.scene, "best_uniform", refused)
    unseen = replace(sprint, count=33)
    assert design(unseen).score > 0.0
    with pytest.raises(AssertionError, match="takes longer"):
        unseen.uniform()


def test_it_builds_the_same_row_domino_by_domino_in_the_environment(sprint) -> None:
    made = design(sprint)
    built = build(acting(sprint, made.plan), sprint)
    assert built.layout.spacing == pytest.approx(made.layout.spacing, rel=1e-5)
    assert built.score == pytest.approx(made.score, rel=1e-5)
    alone = build(acting(sprint), sprint)
    assert alone.score == pytest.approx(design(sprint, tries=1).score, rel=1e-5)
    with pytest.raises(ValueError, match="choose 0 to 12"):
        acting(sprint, 13)


def test_evaluate_knows_it_by_name(sprint) -> None:
    built = evaluate("family", sprint)
    assert built.score == design(sprint).score
    assert built.gain is not None
    assert built.gain > 0.0
    with pytest.raises(ValueError, match="name one to design for"):
        evaluate("family")


def test_trying_plans_never_loses(sprint) -> None:
    scores = [design(sprint, tries=n).score for n in (1, 4, PLANS)]
    assert scores[0] <= scores[1] + 1e-9 <= scores[2] + 2e-9
    with pytest.raises(ValueError, match="tries = 0"):
        design(sprint, tries=0)


def test_it_works_without_torch(tmp_path: Path) -> None:
    row = str(tmp_path / "row.csv")
    script = (
        "import sys\n"
        "for name in ('torch', 'stable_baselines3', 'sb3_contrib'):\n"
        "    sys.modules[name] = None\n"
        "from domino_env.cli.main import main\n"
        f"sys.exit(main(['evaluate', 'family', '--scene', 'sprint', '--layout', {row!r}]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "over the best uniform row" in done.stdout
    assert de.Layout.from_csv(row).count == 40


# weights ------------------------------------------------------------------------------------------


def test_what_ships_is_small_and_says_how_it_was_made() -> None:
    assert WEIGHTS.stat().st_size < 1_000_000
    figures = WEIGHTS.with_name("figures.json").read_text("utf-8")
    assert '"command": "domino train family' in figures


def test_weights_survive_a_file_and_others_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "policy.npz"
    good = shipped_policy().arrays()
    np.savez(path, **good)
    again = ConditionedPolicy.load(tmp_path).arrays()
    assert all(np.array_equal(again[name], good[name]) for name in good)
    bad = {
        "another name": {**good, "extra": np.zeros(3)},
        "a missing array": {k: v for k, v in good.items() if k != "plan_0_bias"},
        "a shape": {**good, "row_1_weight": good["row_1_weight"][:-1]},
        "not finite": {**good, "row_0_bias": good["row_0_bias"] * np.nan},
        "too large": {**good, "row_0_bias": good["row_0_bias"] + 1e30},
        "words": {**good, "row_0_bias": np.array(["a", "b"])},
        "nothing": {},
    }
    for arrays in bad.values():
        np.savez_compressed(path, **arrays)
        with pytest.raises(ValueError, match=REFUSED):
            ConditionedPolicy.load(tmp_path)
    np.savez(path, **{**good, "row_0_bias": np.array([print], dtype=object)})  # needs a pickle
    with pytest.raises(ValueError, match=REFUSED):
        ConditionedPolicy.load(tmp_path)
    whole = WEIGHTS.read_bytes()
    torn = bytearray(whole)
    torn[len(whole) // 2 : len(whole) // 2 + 40] = bytes(40)
    for content in (b"", b"not an archive", whole[:2000], whole[2000:], bytes(torn)):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=REFUSED):
            ConditionedPolicy.load(tmp_path)


# commands -----------------------------------------------------------------------------------------


def test_the_command_evaluates_it_in_many_scenes(tmp_path: Path, capsys) -> None:
    file = tmp_path / "scenes.csv"
    words = ["evaluate", "family", "--scenes", "3", "--seed", "5", "--csv", str(file)]
    assert main([*words, "--search", "40"]) == 0
    table = capsys.readouterr().out
    assert "| best of the plans | " in table
    assert "| search | " in table
    with file.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 3
    assert all(float(row["tried"]) > 0.0 < float(row["uniform"]) for row in rows)
    assert main(["train", "family", "--algorithm", "ars"]) != 0
    assert "in its own way" in capsys.readouterr().err
    assert main(["evaluate", "greedy", "--scenes", "3"]) != 0
    assert "greedy is none" in capsys.readouterr().err


# training -----------------------------------------------------------------------------------------


def test_examples_are_kept_and_others_refused(tmp_path: Path) -> None:
    file = tmp_path / "examples.npz"
    made = make_examples(TINY, 3, 4, 30, file)
    scene = made.scene(1)
    gaps = made.gaps[1, : scene.count - 1] * scene.height
    assert made.score[1] == pytest.approx(scene.score(scene.layout(gaps)), rel=1e-8)
    assert np.all(made.score >= made.uniform)
    again = make_examples(TINY, 3, 4, 30, file)
    assert np.array_equal(again.gaps, made.gaps, equal_nan=True)
    with pytest.raises(ValueError, match="other scenes"):
        make_examples(TINY, 3, 5, 30, file)
    file.write_bytes(b"nothing")
    with pytest.raises(ValueError, match="holds no examples"):
        load_examples(file)


def weights(policy: ConditionedPolicy) -> list[np.ndarray]:
    return [array for layer in (*policy.row.layers, *policy.plan.layers) for array in layer]


def test_the_same_seed_gives_the_same_weights_and_so_does_going_on(
    tmp_path: Path, monkeypatch
) -> None:
    pytest.importorskip("stable_baselines3")
    from agents.conditioned import training

    monkeypatch.setattr(training, "SCENES", 2)
    first = training.train_conditioned(tmp_path / "a", 1, LITTLE, TINY)
    again = training.train_conditioned(tmp_path / "b", 1, LITTLE, TINY)
    other = training.train_conditioned(
        tmp_path / "c", 2, LITTLE, TINY, examples=tmp_path / "a" / "examples.npz"
    )
    assert all(map(np.array_equal, weights(first.policy), weights(again.policy)))
    assert not np.array_equal(first.policy.row.layers[0][0], other.policy.row.layers[0][0])
    assert first.steps == 10
    whole = training.ConditionedTraining._climb

    def stops(self: training.ConditionedTraining, batch: int) -> None:
        whole(self, batch)
        if batch == 3:  # learned, and not yet counted
            raise KeyboardInterrupt

    monkeypatch.setattr(training.ConditionedTraining, "_climb", stops)
    cut = training.train_conditioned(tmp_path / "d", 1, LITTLE, TINY)
    assert cut.interrupted
    assert cut.steps == 7
    monkeypatch.setattr(training.ConditionedTraining, "_climb", whole)
    resumed = training.train_conditioned(tmp_path / "d", resume=True)
    assert not resumed.interrupted
    assert all(map(np.array_equal, weights(first.policy), weights(resumed.policy)))
    found = load_policy(tmp_path / "d")
    assert isinstance(found, ConditionedPolicy)
    assert all(map(np.array_equal, weights(first.policy), weights(found)))
    with pytest.raises(ValueError, match="go on with --resume"):
        training.train_conditioned(tmp_path / "d", 1, LITTLE, TINY)
    with pytest.raises(ValueError, match="nothing to go on from"):
        training.train_conditioned(tmp_path / "none", resume=True)
    kept = (tmp_path / "d" / "checkpoint.pt").read_bytes()
    for content in (b"", kept[:3000], (tmp_path / "d" / "policy.npz").read_bytes()):
        (tmp_path / "d" / "checkpoint.pt").write_bytes(content)
        with pytest.raises(ValueError, match=r"checkpoint.pt"):
            training.train_conditioned(tmp_path / "d", resume=True)
    config = (tmp_path / "d" / "config.json").read_text("utf-8")
    for old, new in (('"width": 8', '"width": "8"'), ("0.02", "-0.02"), ('"seed"', '"sead"')):
        assert old in config
        (tmp_path / "d" / "config.json").write_text(config.replace(old, new), "utf-8")
        with pytest.raises(ValueError, match=r"config.json: (teaching|family|seed)"):
            training.train_conditioned(tmp_path / "d", resume=True)


def test_the_exact_slope_trains_from_scratch(tmp_path: Path, monkeypatch) -> None:
    pytest.importorskip("stable_baselines3")
    from agents.conditioned import training

    monkeypatch.setattr(training, "SCENES", 8)
    plan = replace(LITTLE, width=24, examples=0, batches=30, scenes=8)
    run = training.train_conditioned(tmp_path, 0, plan, TINY)
    gains = [row[2] for row in run.curve]
    assert gains[-1] > gains[0] + 0.005
    assert run.curve[-1][3] > 0.5
