"""Trained policies as search methods."""

import json

import pytest

import domino_env as de
from agents import evaluate
from agents.policy import POLICIES
from optimize import search
from optimize.methods.registry import load


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
    (tmp_path / "summary.json").write_text("[]")
    with pytest.raises(ValueError, match=r"summary\.json: not a table, as domino train writes it"):
        search(scene, f"agent:{tmp_path}", seconds=5.0)


def test_unknown_methods_are_rejected(tmp_path):
    for name in ("agent:", "agent:nowhere", f"agent:{tmp_path}"):
        with pytest.raises(ValueError, match=r"holds no policy|policy = 'nowhere': choose one of"):
            load(name)
    for name in ("agent", "cma:x", "pppo"):
        with pytest.raises(ValueError, match="method = "):
            load(name)


def test_the_error_of_a_missing_extra_names_the_command_that_installs_it(monkeypatch, error_of):
    monkeypatch.setattr("domino_env.core.checks.find_spec", lambda name: None)
    load("agent:sprint")
    error = error_of("benchmark", "sprint", "--out", "runs/no")  # before any task
    assert 'pip install -e ".[rl]"' in error
