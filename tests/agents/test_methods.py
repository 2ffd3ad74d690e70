"""Learners and trained policies as search methods: budgets, time limits, reproducibility."""

import json
import sys

import numpy as np
import pytest
from env_scenes import SMALL

pytest.importorskip("stable_baselines3")

import domino_env as de
from agents import evaluate
from agents.policy import POLICIES
from optimize import METHODS, search
from optimize.methods.registry import installed_methods, load

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")

LEARNED = ("apg", "ppo", "ars")


@pytest.mark.parametrize("method", LEARNED)
def test_a_learner_keeps_a_budget_and_is_reproducible(method):
    budget, remaining = 400, []
    options = {"seed": 5, "callback": lambda evaluator: remaining.append(evaluator.remaining)}
    result, again = (search(SMALL, method, budget=budget, **options) for _ in range(2))
    assert 0.7 * budget < result.evaluations <= budget
    assert min(remaining) >= 0
    assert result.evaluations == again.evaluations
    assert np.array_equal(result.layout.spacing, again.layout.spacing)
    assert [t[3] for t in result.trace] == [t[3] for t in again.trace]
    assert SMALL.violations(result.layout) == []
    assert result.falls > result.evaluations
    assert result.score == pytest.approx(result.trace[-1][3], rel=1e-5)


def test_a_budget_may_be_one_layout_or_a_time():
    assert search(SMALL, "ppo", budget=1).evaluations == 1
    assert search(SMALL, "ars", seconds=1e-9).evaluations >= 1
    assert search(SMALL, "ppo", seconds=1.0).seconds < 30.0  # its default steps take minutes


def test_a_trained_policy_counts_one_evaluation_and_its_training_time(tmp_path):
    scene = de.load_scene("sprint")
    rollout = evaluate("sprint", scene)
    result = search(scene, "agent:sprint", seconds=5.0)
    assert result.evaluations == 1
    assert result.score == rollout.score
    assert search(scene, "agent:designer", seconds=5.0).score == evaluate("designer", scene).score
    home = POLICIES / "sprint"
    for name in ("scene.toml", "config.json", "policy.npz", "policy.json"):
        (tmp_path / name).write_bytes((home / name).read_bytes())
    (tmp_path / "summary.json").write_text(json.dumps({"seconds": 321.0}))
    result = search(scene, f"agent:{tmp_path}", seconds=5.0)
    assert result.score == rollout.score
    assert all(seconds > 321.0 for _, _, seconds, _ in result.trace)


def test_unknown_methods_are_rejected(tmp_path):
    for name in ("agent:", "agent:nowhere", f"agent:{tmp_path}"):
        with pytest.raises(ValueError, match=r"holds no policy|policy = 'nowhere': choose one of"):
            load(name)
    for name in ("agent", "ppo:x", "cma:x", "pppo"):
        with pytest.raises(ValueError, match="method = "):
            load(name)
    assert set(LEARNED) <= set(installed_methods())
    assert not set(LEARNED) & set(METHODS)


def test_the_error_of_a_missing_extra_names_the_command_that_installs_it(monkeypatch, error_of):
    monkeypatch.setattr("domino_env.core.checks.find_spec", lambda name: None)
    monkeypatch.delitem(sys.modules, "agents.methods", raising=False)  # checked when it is imported
    load("agent:sprint")
    with pytest.raises(ImportError, match=r'pip install "domino-chains\[rl\]"'):
        load("ppo")
    error = error_of("benchmark", "sprint", "--out", "runs/no")  # before any task
    assert 'pip install "domino-chains[rl]"' in error
