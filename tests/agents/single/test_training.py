"""Agents that learn: the vector environment they learn in, tiny trainings, and going on."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_scenes import small_scenes

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.vec_env import DummyVecEnv

import domino_env as de
from agents import evaluate
from agents.evaluation.many_scenes import evaluate_scenes, scenes_of
from agents.evaluation.one_scene import load_policy
from agents.sb3.presets import ALGORITHMS, preset
from agents.sb3.vec_env import DominoVecEnv
from agents.single.drawn import DrawnTraining, train_drawn
from agents.single.training import train
from domino_env import DominoChain

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")


@pytest.fixture(scope="module")
def small():
    return replace(de.load_scene("sprint"), name="small", count=7)


def plan_for(algorithm: str):
    tiny = preset(algorithm, 6)
    if algorithm == "ppo":
        options = {**tiny.options, "n_steps": 12, "batch_size": 96, "n_epochs": 4}
        return replace(tiny, rows=16, steps=6000, width=16, options=options)
    if algorithm == "apg":
        return replace(tiny, rows=4, steps=1200, width=16)
    return replace(tiny, rows=4, steps=2000, options={"n_delta": 4, "n_top": 2})


@pytest.mark.parametrize("drawn", [False, True], ids=["one scene", "drawn scenes"])
def test_it_is_the_single_environments_step_for_step(small, drawn: bool) -> None:
    scene = small_scenes() if drawn else small
    ours = DominoVecEnv(scene, 5)
    theirs = DummyVecEnv([lambda: DominoChain(scene)] * 5)
    if drawn:
        ours.follow(9.0)  # the best row so far is of one scene, and no mark for others
    ours.seed(2)
    theirs.seed(2)
    assert np.array_equal(ours.reset(), theirs.reset())
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(40):
        actions = rng.uniform(-1.2, 1.2, (5, 1 + drawn)).astype(np.float32)
        one, two = ours.step(actions), theirs.step(actions)
        assert np.array_equal(one[0], two[0])
        assert np.array_equal(one[1], two[1])
        assert np.array_equal(one[2], two[2])
        for mine, yours in zip(one[3], two[3], strict=True):
            assert ("terminal_observation" in mine) == ("terminal_observation" in yours)
            if "terminal_observation" in mine:
                ended += 1
                assert np.array_equal(mine["terminal_observation"], yours["terminal_observation"])
                assert mine["score"] == yours["score"]
                assert mine["TimeLimit.truncated"] is False
                assert mine["episode"]["l"] <= 8
                assert mine.get("scene") == yours.get("scene")
    assert ended > 20


@pytest.mark.parametrize(("bias", "slope"), [(-1.5, -0.5), (0.9, 0.0), (3.0, 2.0)])
def test_means_outside_the_box_are_drawn_back(small, bias: float, slope: float) -> None:
    """Beyond it all samples are cut off alike: what is paid for them has no slope."""
    import torch

    from agents.sb3.learner import learner

    plan = plan_for("ppo")
    env = DominoVecEnv(small, plan.rows)
    for pull in (0.0, plan.pull):
        policy = learner("ppo", replace(plan, pull=pull), env, 0).policy
        with torch.no_grad():
            policy.action_net.weight.zero_()
            policy.action_net.bias.fill_(bias)
        means = policy.get_distribution(torch.from_numpy(env.reset())).mode()
        (0.0 * means.sum()).backward()
        assert float(policy.action_net.bias.grad) == pytest.approx(pull * slope)


def test_actions_stray_further_near_the_end_of_the_row(small) -> None:
    import torch

    from agents.sb3.learner import learner, set_deviation

    env = DominoVecEnv(replace(small, count=40), 1)
    plan = plan_for("ppo")
    model = learner("ppo", plan, env, 0)
    seen, widths = env.reset(), []
    for _ in range(39):
        set_deviation(model, 0.02)
        deviations = model.policy.get_distribution(torch.from_numpy(seen)).distribution.stddev
        widths.append(float(deviations.detach()[0, 0]))
        seen = env.step(np.zeros((1, 1), np.float32))[0]
    assert widths[0] == pytest.approx(0.02, rel=1e-3)
    assert widths[-1] == pytest.approx(0.02 * plan.end ** np.exp(-0.25))
    assert np.all(np.diff(widths) > 0.0)
    set_deviation(model, 0.9)
    deviations = model.policy.get_distribution(torch.from_numpy(seen)).distribution.stddev
    assert float(deviations.detach().max()) <= 1.0


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_every_algorithm_trains_into_a_folder(small, tmp_path: Path, algorithm: str) -> None:
    run = train(small, algorithm, seed=1, folder=tmp_path / "run", plan=plan_for(algorithm))
    names = {f.name for f in (tmp_path / "run").iterdir()}
    assert names >= {
        "scene.toml", "config.json", "progress.csv", "policy.npz", "policy.json", "layout.csv",
        "layout.json", "summary.json", "result.png", "checkpoint.pt",
    }  # fmt: skip
    assert small.violations(run.built.layout) == []
    assert run.built.score == small.score(run.built.layout) if run.built.score > 0 else True
    again = evaluate(tmp_path / "run")
    assert again.score == run.built.score
    assert np.array_equal(
        de.Layout.read(tmp_path / "run" / "layout.csv").spacing, run.built.layout.spacing
    )
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["score"] == run.built.score


@pytest.mark.parametrize("algorithm", ["apg", "ppo"])
def test_it_learns_and_repeats_to_the_bit(small, tmp_path: Path, algorithm: str) -> None:
    plan = plan_for(algorithm)
    one = train(small, algorithm, seed=3, folder=tmp_path / "one", plan=plan)
    train(small, algorithm, seed=3, folder=tmp_path / "two", plan=plan)
    assert one.built.score > one.built.uniform.score  # within a few thousand dominoes
    a, b = (np.load(tmp_path / name / "policy.npz") for name in ("one", "two"))
    with a, b:
        for name in a.files:
            assert np.array_equal(a[name], b[name])


def test_scalars_go_to_tensorboard_only_where_it_is(small, tmp_path: Path, monkeypatch) -> None:
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    train(small, "ppo", folder=tmp_path / "with", plan=plan_for("ppo"), steps=800)
    seen = EventAccumulator(str(tmp_path / "with" / "tensorboard")).Reload()
    assert {"design/score", "train/value_loss"} <= set(seen.Tags()["scalars"])
    monkeypatch.setattr("agents.single.training.find_spec", lambda name: None)
    train(small, "ppo", folder=tmp_path / "without", plan=plan_for("ppo"), steps=800)
    assert not (tmp_path / "without" / "tensorboard").exists()


@pytest.mark.parametrize("algorithm", ["apg", "ppo"])
def test_going_on_reaches_what_an_undisturbed_run_does(
    small, tmp_path: Path, monkeypatch, algorithm: str
) -> None:
    plan = plan_for(algorithm)
    whole = train(small, algorithm, seed=5, folder=tmp_path / "whole", plan=plan)
    import agents.single.training as training

    kept = training.SceneTraining.checkpoint
    count = [0]

    def cut(self) -> None:
        kept(self)
        count[0] += 1
        if count[0] == 4:
            with pytest.raises(ValueError, match="is being written by a training that still runs"):
                train(small, algorithm, folder=tmp_path / "cut", resume=True)
        if count[0] == 6:
            raise RuntimeError("the power fails")

    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / "notes.txt").write_text("mine")
    monkeypatch.setattr(training.SceneTraining, "checkpoint", cut)
    with pytest.raises(RuntimeError, match="the power fails"):
        train(small, algorithm, seed=5, folder=tmp_path / "cut", plan=plan)
    monkeypatch.setattr(training.SceneTraining, "checkpoint", kept)
    with pytest.raises(ValueError, match=r"holds .* already: go on with --resume"):
        train(small, algorithm, seed=5, folder=tmp_path / "cut", plan=plan)
    resumed = train(small, algorithm, folder=tmp_path / "cut", resume=True)
    assert resumed.steps == whole.steps
    assert [row[2] for row in resumed.curve] == [row[2] for row in whole.curve]
    assert resumed.built.score == whole.built.score
    with (tmp_path / "cut" / "progress.csv").open(newline="") as file:
        steps = [float(row["steps"]) for row in csv.DictReader(file)]
    assert steps == sorted(steps)


@pytest.mark.parametrize("algorithm", ["apg", "ppo"])
def test_what_learned_from_drawn_scenes_is_evaluated_in_many(
    tmp_path: Path, monkeypatch, algorithm: str
) -> None:
    monkeypatch.setattr("agents.single.drawn.LOOKED", 4)
    plan = replace(plan_for(algorithm), steps=200)
    run = train_drawn(small_scenes(), algorithm, folder=tmp_path / "run", plan=plan)
    policy, scenes = load_policy(run.folder), scenes_of(small_scenes(), 3, seed=1)
    found = evaluate_scenes(scenes, policy)
    assert "its proposal" not in found.table()
    for score, scene in zip(found.designed, scenes, strict=True):
        built = evaluate(run.folder, scene)
        assert built.score == score
        assert scene.violations(built.layout) == []
    with pytest.raises(ValueError, match="no test scenes ship for 'small': give a seed"):
        scenes_of(policy.scene, 3)


@pytest.mark.parametrize("algorithm", ["apg", "ppo"])
def test_going_on_draws_the_scenes_of_an_undisturbed_run(
    tmp_path: Path, monkeypatch, algorithm: str
) -> None:
    monkeypatch.setattr("agents.single.drawn.LOOKED", 4)
    plan = replace(plan_for(algorithm), steps=600)
    whole = train_drawn(small_scenes(), algorithm, seed=5, folder=tmp_path / "whole", plan=plan)
    kept, count = DrawnTraining.checkpoint, [0]

    def cut(self) -> None:
        kept(self)
        count[0] += 1
        if count[0] == 4:
            raise RuntimeError("the power fails")

    monkeypatch.setattr(DrawnTraining, "checkpoint", cut)
    with pytest.raises(RuntimeError, match="the power fails"):
        train_drawn(small_scenes(), algorithm, seed=5, folder=tmp_path / "cut", plan=plan)
    monkeypatch.setattr(DrawnTraining, "checkpoint", kept)
    resumed = train_drawn(small_scenes(), folder=tmp_path / "cut", resume=True)
    one, two = ([(row[0], *row[2:4]) for row in run.curve] for run in (whole, resumed))
    assert one == two
    assert len({gain for _, gain, _ in one}) > 2  # it learns something


def test_what_cannot_be_done_is_told(small, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no algorithm 'dqn': choose apg, ppo"):
        train(small, "dqn")
    with pytest.raises(ValueError, match="nothing to go on from"):
        train(small, "ppo", folder=tmp_path, resume=True)
    with pytest.raises(ValueError, match="steps = 0"):
        train(small, "ppo", steps=0)
    with pytest.raises(ValueError, match="holds no policy"):
        evaluate(tmp_path)
    (tmp_path / "agent.zip").write_bytes(b"PK")
    with pytest.raises(ValueError, match="say --trust"):
        evaluate(tmp_path / "agent.zip", "sprint")


@pytest.mark.parametrize("wrong", [
    {"first_deviation": 0.0}, {"last_deviation": -1.0}, {"end": 0.0}, {"middle": 1.0},
])  # fmt: skip
def test_a_schedule_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    (name,) = wrong
    with pytest.raises(ValueError, match=f"{name} = "):
        replace(preset("ppo", 39), **wrong)


def test_a_policy_of_another_shape_is_refused(small, tmp_path: Path) -> None:
    train(small, "ppo", folder=tmp_path / "run", plan=plan_for("ppo"), steps=400)
    other = evaluate(tmp_path / "run", replace(small, name="other", physics=de.Physics(0.4)))
    assert other.scene.name == "other"
    with pytest.raises(ValueError, match="choose a scene with the same things left free"):
        evaluate(tmp_path / "run", "sprint-thickness")
    (tmp_path / "run" / "policy.npz").write_bytes(b"not an archive")
    with pytest.raises(ValueError, match=r"policy\.npz: it (is no archive|does not hold)"):
        evaluate(tmp_path / "run")
