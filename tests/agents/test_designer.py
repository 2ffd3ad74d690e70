"""The scene-conditioned policy: what it designs, what it needs, what it refuses."""

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
from agents import design, evaluate
from agents.base.shipped import DESIGNER, POLICIES
from agents.cards import MARKED, card_of, figures
from agents.conditioned.laying import laid
from agents.conditioned.observations import plans_of
from agents.conditioned.policy import ConditionedPolicy
from agents.evaluation.many_scenes import evaluate_scenes, scenes_of
from domino_env.cli.main import main

WEIGHTS = POLICIES / DESIGNER / "policy.npz"
REFUSED = r"policy\.npz: it (does not hold|is no archive)"
KINDS = ("varied", "varied-thickness", "varied-course")


@pytest.fixture
def sprint():
    return de.load_scene("sprint")


# scenes -------------------------------------------------------------------------------------------


def test_a_scene_beyond_the_training_is_told(sprint) -> None:
    assert all(design(name).outside == () for name in ("sprint", "course", "sprint-thickness"))
    long = design(replace(sprint, count=100))
    assert long.outside == ("count 100 is outside 15 to 80",)
    assert long.score > 0.0
    both = replace(de.load_scene("sprint-thickness"), length=0.8)
    assert design(both).outside == ("free thickness over a given length",)
    assert both.violations(design(both).layout) == []


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("tempo", "its objective is tempo"),
        ("stock", "from a stock"),
        ("magnify", "or grow"),
        ("jitter", "its objective is robust"),
        ("table", "rows stand on a floor"),
    ],
)
def test_another_kind_of_scene_is_refused(name: str, reason: str) -> None:
    with pytest.raises(ValueError, match=f"{reason}.*domino optimize"):
        design(name)


# designing ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_designs_keep_the_rules_and_beat_uniform_in_scenes_they_have_not_seen(kind: str) -> None:
    found = evaluate_scenes(scenes_of(kind, 12))
    gains = found.gains(found.designed)
    assert np.mean(gains > 0.0) >= 0.9
    assert np.median(gains) > 0.015
    assert np.all(found.designed >= found.proposed - 1e-6)
    for scene in found.scenes:
        made = design(scene)
        assert scene.violations(made.layout) == []
        assert made.score == scene.score(made.layout)
        assert made.plan < plans_of(scene.count)


@pytest.mark.parametrize("pitch", [1.02, 1.5, 3.0, 4.9])
def test_rows_have_their_length_whatever_the_networks_say(pitch: float) -> None:
    rng = np.random.default_rng(3)
    scene = replace(de.load_scene("sprint-thickness"), length=39 * pitch * 0.0103)
    said, plans = 3.0 * rng.standard_normal((5, 39, 2)), np.array([0.0, 2.0, 5.0, 9.0, 12.0])
    gaps, thickness = laid(scene, said, plans)
    assert gaps.sum(axis=1) + thickness.sum(axis=1) == pytest.approx(scene.length, abs=1e-12)
    for i in range(5):
        assert scene.violations(scene.layout(gaps[i], thickness[i])) == []


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


def test_evaluate_knows_it_by_name(sprint) -> None:
    built = evaluate("designer", sprint)
    assert built.score == design(sprint).score
    assert built.gain is not None
    assert built.gain > 0.0
    with pytest.raises(ValueError, match="name one to design for"):
        evaluate("designer")


def test_trying_plans_never_loses_and_polishing_gains(sprint) -> None:
    scores = [design(sprint, tries=n, steps=0).score for n in (1, 4, 13)]
    assert scores[0] <= scores[1] + 1e-9 <= scores[2] + 2e-9
    polished = [design("course", steps=k).score for k in (0, 6, 30)]
    assert polished[0] < polished[1] < polished[2]
    for given in ({"tries": 0}, {"steps": -1}):
        with pytest.raises(ValueError, match="give 1 or more, and 0 or more"):
            design(sprint, **given)


def test_it_works_without_torch(tmp_path: Path) -> None:
    row = str(tmp_path / "row.csv")
    script = (
        "import sys\n"
        "for name in ('torch', 'stable_baselines3', 'sb3_contrib'):\n"
        "    sys.modules[name] = None\n"
        "from domino_env.cli.main import main\n"
        f"sys.exit(main(['evaluate', 'designer', '--scene', 'sprint', '--layout', {row!r}]))"
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
    card = WEIGHTS.with_name("README.md").read_text("utf-8")
    assert "version 0.3.0" in card


@pytest.mark.parametrize("name", sorted(p.name for p in POLICIES.iterdir() if p.is_dir()))
def test_every_policy_that_ships_has_a_card_with_its_figures(name: str) -> None:
    card = card_of(name).read_text("utf-8")
    for part in ("**Scene", "**Seed", "**Score", "**Limits.**", "**Train it again.**"):
        assert part in card
    (table,) = MARKED.findall(card)
    if name == DESIGNER:
        assert table.count("| design |") == len(KINDS)
    else:
        assert table.strip() == figures(name)


def test_weights_survive_a_file_and_others_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "policy.npz"
    with np.load(WEIGHTS) as shipped:
        good = dict(shipped)
    np.savez(path, **good)
    assert (
        design("sprint", designer=ConditionedPolicy.load(tmp_path)).score == design("sprint").score
    )
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
    words = ["evaluate", "designer", "--scenes", "3", "--seed", "5", "--csv", str(file)]
    assert main([*words, "--of", "varied-course", "--search", "40"]) == 0
    table = capsys.readouterr().out
    assert "| its proposal | " in table
    assert "| search | " in table
    with file.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 3
    assert all(float(row["designed"]) > 0.0 < float(row["uniform"]) for row in rows)
    assert main(["evaluate", "greedy", "--scenes", "3"]) != 0
    assert "greedy is none" in capsys.readouterr().err
    assert main(["evaluate", "designer", "--scenes", "201"]) != 0
    assert "has 200 scenes" in capsys.readouterr().err
