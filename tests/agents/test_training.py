"""Agents that learn: the vector environment that they learn in, tiny trainings, resumption."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sampled_scenes import small_scenes

pytest.importorskip("stable_baselines3")

import torch
from stable_baselines3.common.vec_env import DummyVecEnv

import domino_env as de
from agents import evaluate, train
from agents.algorithms import ALGORITHMS, Hyperparameters, hyperparameters
from agents.evaluation import evaluate_scenes, load_policy, scenes_of
from agents.sb3 import Learner
from agents.training import Training
from agents.vec_env import DominoVecEnv
from domino_env import DominoChain

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")

SMALL = replace(de.load_scene("sprint"), name="small", count=7)
TINY = {  # environments, steps, options
    "apg": (4, 1200, {}),
    "ppo": (16, 6000, {"n_steps": 12, "batch_size": 96, "n_epochs": 4}),
    "ars": (4, 2000, {"n_delta": 4, "n_top": 2}),
}


def tiny(algorithm: str, **changes: object) -> Hyperparameters:
    """Hyperparameters that learn for a moment."""
    plan, (rows, steps, options) = hyperparameters(algorithm, 6), TINY[algorithm]
    tiny = replace(plan, rows=rows, steps=steps, width=16, options=plan.options | options)
    return replace(tiny, **changes)


# the vector environment ---------------------------------------------------------------------------


@pytest.mark.parametrize("drawn", [False, True], ids=["one scene", "sampled scenes"])
def test_it_is_the_single_environments_step_for_step(drawn: bool) -> None:
    scene = small_scenes() if drawn else SMALL
    ours = DominoVecEnv(scene, 5)
    theirs = DummyVecEnv([lambda: DominoChain(scene)] * 5)
    if drawn:
        ours.follow(9.0)  # the best score so far is of one scene, and no reference for others
    ours.seed(2)
    theirs.seed(2)
    assert np.array_equal(ours.reset(), theirs.reset())
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(40):
        actions = rng.uniform(-1.2, 1.2, (5, 1 + drawn)).astype(np.float32)
        one, two = ours.step(actions), theirs.step(actions)
        assert all(map(np.array_equal, one[:3], two[:3]))
        for mine, yours in zip(one[3], two[3], strict=True):
            assert ("terminal_observation" in mine) == ("terminal_observation" in yours)
            if "terminal_observation" in yours:
                ended += 1
                assert np.array_equal(mine["terminal_observation"], yours["terminal_observation"])
                assert mine["score"] == yours["score"]
                assert mine["TimeLimit.truncated"] is False
                assert mine["episode"]["l"] <= 8
                assert mine.get("scene") == yours.get("scene")
    assert ended > 20


# the policy of APG and PPO ------------------------------------------------------------------------


@pytest.mark.parametrize(("bias", "slope"), [(-1.5, -0.5), (0.9, 0.0), (3.0, 2.0)])
def test_means_outside_the_box_are_drawn_back(bias: float, slope: float) -> None:
    """Beyond it all samples are cut off alike: the reward has no slope there."""
    for pull in (0.0, 1.0):
        learner = Learner(SMALL, "ppo", tiny("ppo", pull=pull), 0)
        policy = learner.model.policy
        with torch.no_grad():
            policy.action_net.weight.zero_()
            policy.action_net.bias.fill_(bias)
        means = policy.get_distribution(torch.from_numpy(learner.env.reset())).mode()
        (0.0 * means.sum()).backward()
        assert float(policy.action_net.bias.grad) == pytest.approx(pull * slope)


def test_actions_deviate_further_near_the_end_of_the_chain() -> None:
    plan = tiny("ppo", rows=1, first_deviation=0.02)
    learner = Learner(replace(SMALL, count=40), "ppo", plan, 0)
    policy, widths = learner.model.policy, []

    def deviations(observed: np.ndarray) -> torch.Tensor:
        return policy.get_distribution(torch.from_numpy(observed)).distribution.stddev.detach()

    learner.adapt(0.0, 0.0)
    observed = learner.env.reset()
    for _ in range(39):
        widths.append(float(deviations(observed)[0, 0]))
        observed = learner.env.step(np.zeros((1, 1), np.float32))[0]
    assert widths[0] == pytest.approx(0.02, rel=1e-3)
    assert widths[-1] == pytest.approx(0.02 * plan.end ** np.exp(-0.25))
    assert np.all(np.diff(widths) > 0.0)
    policy.deviation = 0.9
    assert float(deviations(observed).max()) <= 1.0


# trainings ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_training_learns_repeats_and_continues_after_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, algorithm: str
) -> None:
    plan = tiny(algorithm)
    run = train(SMALL, algorithm, seed=3, folder=tmp_path / "run", plan=plan)
    assert {file.name for file in run.folder.iterdir()} >= {
        "scene.toml", "config.json", "progress.csv", "policy.npz", "policy.json", "layout.csv",
        "layout.json", "summary.json", "result.png", "checkpoint.pt",
    }  # fmt: skip
    assert run.rollout is not None
    assert SMALL.violations(run.rollout.layout) == []
    assert run.rollout.score > run.rollout.uniform.score or algorithm == "ars"
    assert evaluate(run.folder).score == run.rollout.score
    assert de.Layout.read(run.folder / "layout.csv") == run.rollout.layout
    summary = json.loads((run.folder / "summary.json").read_text())
    assert (summary["finished"], summary["score"]) == (True, run.rollout.score)

    kept, count = Training.checkpoint, [0]

    def failing(self: Training) -> None:
        kept(self)
        count[0] += 1
        if count[0] == 4:
            raise RuntimeError("the power fails")

    with monkeypatch.context() as patch:
        patch.setattr(Training, "checkpoint", failing)
        with pytest.raises(RuntimeError, match="the power fails"):
            train(SMALL, algorithm, seed=3, folder=tmp_path / "cut", plan=plan)
    before = _curve(tmp_path / "cut")
    whole = _curve(run.folder)
    assert before == whole[: len(before)]  # the same seed gives the same results
    with pytest.raises(ValueError, match=r"holds .* already: go on with --resume"):
        train(SMALL, algorithm, folder=tmp_path / "cut", plan=plan)
    resumed = train("sprint", folder=tmp_path / "cut", resume=True)
    assert (resumed.scene, resumed.algorithm) == ("small", algorithm)
    assert resumed.steps >= plan.steps
    after = _curve(resumed.folder)
    assert after[: len(before)] == before
    assert [row[0] for row in after] == sorted({row[0] for row in after})
    again = train(SMALL, folder=tmp_path / "cut", resume=True)  # there is nothing left to do
    assert (again.steps, len(again.curve)) == (resumed.steps, len(after))


def _curve(folder: Path) -> list[tuple[float, ...]]:
    """Steps, score and best score at each evaluation."""
    with (folder / "progress.csv").open(newline="") as file:
        rows = csv.DictReader(file)
        return [tuple(float(row[k]) for k in ("steps", "score", "best_score")) for row in rows]


@pytest.mark.parametrize("algorithm", ["apg", "ppo"])
def test_a_policy_for_sampled_scenes_is_evaluated_in_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, algorithm: str
) -> None:
    monkeypatch.setattr("agents.scores.POOL_SCENES", 4)
    plan = tiny(algorithm, steps=200)
    run = train(small_scenes(), algorithm, folder=tmp_path / "run", plan=plan)
    assert run.rollout is None
    assert "median gain" in repr(run)
    with pytest.raises(ValueError, match="no single layout"):
        run.plot()
    resumed = train("varied", folder=run.folder, resume=True)
    assert (resumed.scene, resumed.steps) == ("small", run.steps)
    policy, scenes = load_policy(run.folder), scenes_of(small_scenes(), 3, seed=1)
    found = evaluate_scenes(scenes, policy)
    assert "its proposal" not in found.table()
    for score, scene in zip(found.designed, scenes, strict=True):
        rollout = evaluate(run.folder, scene)
        assert rollout.score == score
        assert scene.violations(rollout.layout) == []
    with pytest.raises(ValueError, match="no test scenes ship for 'small': give a seed"):
        scenes_of(policy.scene, 3)
    with pytest.raises(ValueError, match="was trained on many scenes: name one"):
        evaluate(run.folder)


def test_a_killed_training_continues_from_its_checkpoint(tmp_path: Path) -> None:
    scene, folder = tmp_path / "small.toml", tmp_path / "run"
    scene.write_text(SMALL.to_toml())
    words = ["train", str(scene), "--steps", "400000", "--out", str(folder)]
    training = subprocess.Popen([sys.executable, "-m", "domino_env", *words], cwd=tmp_path)
    while not (folder / "checkpoint.pt").exists() and training.poll() is None:
        time.sleep(0.05)
    training.send_signal(signal.SIGKILL)
    training.wait()
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(config | {"steps": 1}))  # enough for a test
    resumed = train(scene, folder=folder, resume=True)
    assert resumed.algorithm == "ppo"
    assert json.loads((folder / "summary.json").read_text())["finished"]


def test_scalars_go_to_tensorboard_only_where_it_is(tmp_path: Path, monkeypatch) -> None:
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    train(SMALL, "ppo", folder=tmp_path / "with", plan=tiny("ppo"), steps=800)
    seen = events.EventAccumulator(str(tmp_path / "with" / "tensorboard")).Reload()
    assert {"design/score", "train/value_loss"} <= set(seen.Tags()["scalars"])
    monkeypatch.setattr("agents.training.find_spec", lambda name: None)
    train(SMALL, "apg", folder=tmp_path / "without", plan=tiny("apg"), steps=100)
    assert not (tmp_path / "without" / "tensorboard").exists()


def test_what_cannot_be_done_is_refused(tmp_path: Path) -> None:
    for changes, reason in (
        ({"algorithm": "dqn"}, "algorithm = 'dqn': .*apg, ppo, ars"),
        ({"steps": 0}, "steps = 0: give a whole number"),
        ({"seed": -1}, "seed = -1: give a whole number"),
        ({"folder": tmp_path, "resume": True}, "nothing to go on from"),
    ):
        with pytest.raises(ValueError, match=reason):
            train(SMALL, **changes)
    for name, value in (("first_deviation", 0.0), ("end", -1.0), ("middle", 1.0), ("rows", 0)):
        with pytest.raises(ValueError, match=f"{name} = "):
            replace(hyperparameters("ppo", 39), **{name: value})


def test_a_damaged_or_foreign_checkpoint_is_refused_and_its_code_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = train(SMALL, "apg", folder=tmp_path / "run", plan=tiny("apg"), steps=24)
    path = run.folder / "checkpoint.pt"
    whole = torch.load(path, weights_only=True)
    data = path.read_bytes()
    monkeypatch.chdir(tmp_path)
    for state in (
        {},
        {"progress": 1},
        whole | {"parameters": {}},
        whole | {"steps": "many"},
        _Code(),
    ):
        torch.save(state, path)
        with pytest.raises(ValueError, match=r"checkpoint\.pt: (it does not fit|not a checkpoint)"):
            train(SMALL, folder=run.folder, resume=True)
    assert not Path("ran").exists()
    for torn in (b"", data[:3000], data[3000:]):
        path.write_bytes(torn)
        with pytest.raises(ValueError, match=r"checkpoint\.pt: not a checkpoint, or damaged"):
            train(SMALL, folder=run.folder, resume=True)


class _Code:
    """Shows that a pickle was run."""

    def __reduce__(self) -> object:
        return Path.touch, (Path("ran"),)
