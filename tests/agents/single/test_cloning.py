"""Cloning: a policy that learned a given row builds it, and what follows does not lose it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import domino_env as de
from agents import evaluate
from agents.sb3.learner import learner
from agents.sb3.presets import preset
from agents.sb3.vec_env import DominoVecEnv
from agents.single.cloning import clone, row_to_clone
from agents.single.training import SLACK, train
from domino_env import DominoChainVector
from optimize import search

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")


@pytest.fixture(scope="module")
def small():
    return replace(de.load_scene("sprint"), name="small", count=8)


@pytest.fixture(scope="module")
def row(small):
    return search(small, "cma", budget=1500, seed=0).layout


def tiny(**more):
    plan = preset("ppo", 7, warm=True)
    options = {**plan.options, "n_steps": 14, "batch_size": 112, "n_epochs": 2}
    return replace(plan, rows=16, steps=4000, width=32, options=options, **more)


@pytest.mark.parametrize("name", ["sprint", "sprint-thickness", "course", "stock"])
def test_actions_towards_a_row_build_it(name: str) -> None:
    scene = de.load_scene(name)
    rows = DominoChainVector(3, scene, autoreset_mode="Disabled")
    row = scene.uniform().layout
    rng = np.random.default_rng(4)
    if name == "course":  # rows of another shape and the same length
        shift = 0.001 * rng.permutation(np.resize([1.0, -1.0], scene.count - 1))
        shift[-1] -= shift.sum()
        row = scene.layout(row.spacing + shift)
    rows.reset()
    told: dict = {}
    for _ in range(scene.count - 1):
        told = rows.step(rows.actions_towards(row))[4]
    built = told["layout"][1]
    assert built.spacing == pytest.approx(row.spacing, abs=1e-12)
    assert built.thickness == pytest.approx(row.thickness, abs=1e-12)
    assert built.height == pytest.approx(row.height, rel=1e-12)


@pytest.mark.parametrize("length", [None, 0.16])
def test_a_clone_builds_its_row(small, row, length: float | None) -> None:
    scene = small if length is None else replace(small, length=length)
    row = row if length is None else search(scene, "l-bfgs", budget=400, seed=0).layout
    env = DominoVecEnv(scene, 16)
    model = learner("ppo", tiny(), env, 0)
    cloned = clone(model, env, row, 0.03, 0)
    assert cloned.row_score == scene.score(row)
    assert cloned.score > cloned.row_score - 1e-4
    if length is not None:  # where some of the rows it learns from jam, the critic is rougher
        return
    # the critic knows what is left to win along the row
    state, _ = env.rows.reset()
    values, rewards = [], []
    for _ in range(scene.count - 1):
        values.append(float(model.policy.predict_values(model.policy.obs_to_tensor(state)[0])[0]))
        state, paid, *_ = env.rows.step(env.rows.actions_towards(row))
        rewards.append(paid[0])
    left = np.cumsum(rewards[::-1])[::-1]
    assert np.corrcoef(values, left)[0, 1] > 0.9


def test_training_from_a_clone_keeps_it_and_goes_on(small, row, tmp_path: Path, monkeypatch):
    file = tmp_path / "row.csv"
    row.to_csv(file)
    plan = tiny(rate=0.1)  # steps that lead astray
    plan = replace(plan, options=plan.options | {"target_kl": None})
    whole = train(small, "ppo", seed=2, folder=tmp_path / "whole", plan=plan, warm_start=file)
    assert whole.clone_score is not None
    scores = np.array([row[2] for row in whole.curve])
    assert scores.min() < whole.clone_score - SLACK  # the plan does what it is for
    assert scores[-1] >= whole.clone_score - SLACK
    assert evaluate(whole.folder).score >= whole.clone_score
    summary = json.loads((whole.folder / "summary.json").read_text())
    config = json.loads((whole.folder / "config.json").read_text())
    assert summary["clone_score"] == config["warm_start"]["score"] == whole.clone_score
    assert config["warm_start"]["source"] == str(file)

    import agents.single.training as training

    kept, count = training.SceneTraining.checkpoint, [0]

    def cut(self) -> None:
        kept(self)
        count[0] += 1
        if count[0] == 4:
            raise RuntimeError("the power fails")

    monkeypatch.setattr(training.SceneTraining, "checkpoint", cut)
    with pytest.raises(RuntimeError, match="the power fails"):
        train(small, "ppo", seed=2, folder=tmp_path / "cut", plan=plan, warm_start=row)
    monkeypatch.undo()

    def fail(self) -> None:
        raise RuntimeError("the power fails")

    monkeypatch.setattr(training.SceneTraining, "_log", fail)  # before the first rollout
    with pytest.raises(RuntimeError, match="the power fails"):
        train(small, "ppo", seed=2, folder=tmp_path / "early", plan=plan, warm_start=row)
    monkeypatch.undo()
    for folder in ("cut", "early"):
        resumed = train(small, "ppo", folder=tmp_path / folder, resume=True)
        assert resumed.clone_score == whole.clone_score
        assert [row[2] for row in resumed.curve] == [row[2] for row in whole.curve]


def test_what_cannot_be_imitated_is_told(small, row, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="PPO's, not ars's"):
        train(small, "ars", folder=tmp_path / "run", warm_start=row)
    with pytest.raises(ValueError, match="is no row"):
        row_to_clone(small, tmp_path / "nothing")
    with pytest.raises(ValueError, match="on record"):
        row_to_clone(small, "best-known")
    with pytest.raises(ValueError, match="dominoes stand where the scene asks for"):
        row_to_clone(de.load_scene("sprint"), row)
    with pytest.raises(ValueError, match="its wave dies"):
        row_to_clone(replace(small, physics=de.Physics(push=0.2)), row)
