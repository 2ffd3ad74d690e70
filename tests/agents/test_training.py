"""Training: the vector environment, the policy of APG and PPO, short trainings, resumption."""

import csv
import json
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from env_scenes import SMALL
from sampled_scenes import small_scenes

pytest.importorskip("stable_baselines3")

import torch
from gymnasium.wrappers import TimeLimit
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

import domino_env as de
from agents import evaluate, train
from agents.algorithms import ALGORITHMS, Hyperparameters, default_hyperparameters
from agents.evaluation import choose_scenes, evaluate_scenes, load_policy
from agents.network import build_actor
from agents.policy import read_config
from agents.sb3.checkpoints import model_state, restore
from agents.sb3.factory import KINDS, make_model, save_zip, weights
from agents.sb3.training import Training
from agents.vec_env import DominoVecEnv
from domino_env.cli.main import main

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")

TINY = {  # environments, steps, options
    "apg": (4, 1200, {}),
    "ppo": (16, 6000, {"n_steps": 12, "batch_size": 96, "n_epochs": 4}),
    "ars": (4, 2000, {"n_delta": 4, "n_top": 2}),
    "sac": (4, 60, {"learning_starts": 20, "batch_size": 16}),
    "td3": (4, 60, {"learning_starts": 20, "batch_size": 16}),
    "tqc": (4, 60, {"learning_starts": 20, "batch_size": 16}),
}


def tiny(algorithm: str, **changes: object) -> Hyperparameters:
    """Return hyperparameters of a training that takes a second."""
    chosen, (num_envs, steps, options) = default_hyperparameters(algorithm, SMALL), TINY[algorithm]
    options = chosen.options | options
    tiny = chosen.replace(num_envs=num_envs, steps=steps, width=16, options=options)
    return tiny.replace(**changes)


# the vector environment ---------------------------------------------------------------------------


def test_environments_keep_the_number_of_threads_of_torch():
    """Numba and torch share OpenMP; a second thread of each of two trainings slows both down."""
    code = """if True:
        import torch
        from domino_env import DominoChainVector
        torch.set_num_threads(1)
        env = DominoChainVector(1000, "sprint")
        env.reset()
        assert torch.get_num_threads() == 1
        env.step(env.action_space.sample())
        assert torch.get_num_threads() == 1
    """
    subprocess.run([sys.executable, "-c", code], check=True)


def test_trainings_with_other_seeds_have_other_scenes():
    names = []
    for seed in (100, 101):
        chosen = default_hyperparameters("ppo", de.load_distribution("varied"))
        chosen = chosen.replace(num_envs=8, options={"n_steps": 8, "batch_size": 64})
        env = make_model(de.load_distribution("varied"), "ppo", chosen, seed).env
        env.reset()
        names.append({scene.name for scene in env.vector.scenes})
    assert len(names[0] | names[1]) > 14  # of 16


def test_the_vector_environment_takes_options_and_reports_episodes_like_monitor():
    options: dict[str, object] = {"window": 4, "rtol": 1e-5}
    batch = DominoVecEnv(SMALL, 2, render_mode="rgb_array", **options)
    single = DummyVecEnv([lambda: Monitor(de.DominoChain(SMALL, **options))])
    assert batch.env_is_wrapped(Monitor) == [True, True]
    assert batch.env_is_wrapped(TimeLimit) == [False, False]
    model = PPO("MlpPolicy", batch, n_steps=8, batch_size=16, device="cpu")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        returns, lengths = evaluate_policy(model, batch, 4, return_episode_rewards=True)
    expected = evaluate_policy(model, single, 4, return_episode_rewards=True)
    assert returns == pytest.approx(expected[0], rel=1e-4)
    assert lengths == expected[1]
    assert batch.render().ndim == 3
    batch.set_options({"layout": de.Layout([0.02, 0.02], 0.0075)})
    batch.reset()
    infos = batch.step(np.zeros((2, 1)))[-1]
    assert (batch.vector.snapshot(0).layout.count, infos[0] is infos[1]) == (4, False)
    with pytest.raises(TypeError, match="give one dictionary for all environments"):
        batch.set_options([{}, {}])


@pytest.mark.parametrize("algorithm", ["sac", "td3", "tqc"])
def test_an_off_policy_training_updates_once_per_transition(algorithm):
    model = make_model(SMALL, algorithm, tiny(algorithm), 1)
    before = {name: value.copy() for name, value in weights(model.policy).items()}
    model.learn(60)
    assert model._n_updates == 60 - 20
    after = weights(model.policy)
    assert all(np.any(after[name] != before[name]) for name in before if name.endswith("weight"))
    observations = model.env.reset()
    actions = model.predict(observations, deterministic=True)[0]
    assert build_actor(after).act(observations) == pytest.approx(actions, abs=1e-6)

    again = make_model(SMALL, algorithm, tiny(algorithm), 2)
    restore(again, model_state(model))
    np.testing.assert_equal(weights(again.policy), after)
    before, restored = model.replay_buffer, again.replay_buffer
    assert (restored.pos, restored.size()) == (before.pos, before.size()) == (15, 15)
    for name in ("observations", "rewards"):
        assert np.array_equal(getattr(restored, name)[:15], getattr(before, name)[:15])
    if algorithm != "td3":
        assert again.log_ent_coef == model.log_ent_coef != 0.0


# trainings ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("algorithm", ["apg", "ppo", "ars", "sac", "tqc"])  # td3: code of sac
def test_a_training_learns_repeats_and_resumes_after_a_failure(tmp_path, monkeypatch, algorithm):
    chosen = tiny(algorithm)
    run = train(SMALL, algorithm, seed=3, folder=tmp_path / "run", hyperparameters=chosen)
    assert {file.name for file in run.folder.iterdir()} >= {
        "scene.toml", "config.json", "progress.csv", "policy.npz", "policy.json", "layout.csv",
        "layout.json", "summary.json", "result.png", "checkpoint.pt",
    }  # fmt: skip
    assert SMALL.violations(run.rollout.layout) == []
    assert run.rollout.score > run.rollout.uniform.score or algorithm not in ("apg", "ppo")
    assert run.plot().axes[-1].get_xlim() == (0.0, run.curve[-1][0])
    assert evaluate(run.folder).score == run.rollout.score
    assert de.Layout.read(run.folder / "layout.csv") == run.rollout.layout
    summary = json.loads((run.folder / "summary.json").read_text())
    assert (summary["finished"], summary["score"]) == (True, run.rollout.score)

    checkpoint, count = Training.write_checkpoint, [0]

    def failing(self: Training) -> None:
        checkpoint(self)
        count[0] += 1
        if count[0] == 4:
            raise RuntimeError("failure")

    with monkeypatch.context() as patch:
        patch.setattr(Training, "write_checkpoint", failing)
        with pytest.raises(RuntimeError, match="failure"):
            train(SMALL, algorithm, seed=3, folder=tmp_path / "cut", hyperparameters=chosen)
    before = _curve(tmp_path / "cut")
    whole = _curve(run.folder)
    assert before == whole[: len(before)]  # the same seed gives the same results
    with pytest.raises(ValueError, match=r"holds .* already: resume the same"):
        train(SMALL, algorithm, folder=tmp_path / "cut", hyperparameters=chosen)
    given = ("another scene", "sprint", {}), ("seed = 3", SMALL, {"seed": 4})
    for words, scene, wrong in given:
        with pytest.raises(ValueError, match=f"has {words}: give its own scene"):
            train(scene, folder=tmp_path / "cut", resume=True, **wrong)
    resumed = train(SMALL, algorithm, folder=tmp_path / "cut", resume=True, hyperparameters=chosen)
    assert (resumed.scene, resumed.algorithm) == ("small", algorithm)
    assert resumed.steps >= chosen.steps
    after = _curve(resumed.folder)
    assert after[: len(before)] == before
    assert [line[0] for line in after] == sorted({line[0] for line in after})
    save_zip(run.folder, tmp_path / "model.zip")
    model = KINDS[algorithm].archived.load(tmp_path / "model.zip")
    observations = DominoVecEnv(SMALL, 3).reset()
    actions = load_policy(run.folder).policy(observations)
    assert model.predict(observations, deterministic=True)[0] == pytest.approx(actions, abs=1e-6)
    rollout = evaluate(tmp_path / "model.zip", SMALL)
    assert rollout.score == pytest.approx(run.rollout.score, rel=1e-3)
    again = train(SMALL, folder=tmp_path / "cut", resume=True)  # there is nothing left to do
    assert (again.steps, len(again.curve)) == (resumed.steps, len(after))


def _curve(folder: Path) -> list[tuple[float, ...]]:
    """Return steps, score and best score at each evaluation."""
    with (folder / "progress.csv").open(newline="") as file:
        names = ("steps", "score", "best_score")
        return [tuple(float(line[name]) for name in names) for line in csv.DictReader(file)]


@pytest.mark.parametrize(("algorithm", "num_scenes"), [("apg", None), ("ppo", 3)])
def test_a_policy_is_evaluated_in_many_scenes(tmp_path, monkeypatch, algorithm, num_scenes):
    monkeypatch.setattr("agents.sb3.training.POOL_SCENES", 4)
    chosen = tiny(algorithm, steps=200)
    run = train(
        small_scenes(), algorithm, folder=tmp_path / "run", hyperparameters=chosen,
        num_scenes=num_scenes,
    )  # fmt: skip
    assert run.rollout is None
    assert "median gain" in repr(run)
    with pytest.raises(ValueError, match="no single layout"):
        run.plot()
    training = Training(small_scenes(), read_config(run.folder), run.folder, False)
    names = {scene.name for scene in training.scenes}
    assert names == {f"small-{i}" for i in (range(3) if num_scenes else range(4092, 4096))}
    vector = make_model(small_scenes(), algorithm, chosen, 0, num_scenes).env.vector
    sampled = vector.reset()[1]["scene"]
    assert num_scenes is None or {scene.name for scene in sampled} <= names
    resumed = train(small_scenes(), folder=run.folder, resume=True)
    assert json.loads((run.folder / "config.json").read_text())["num_scenes"] == num_scenes
    assert (resumed.scene, resumed.steps) == ("small", run.steps)
    policy, scenes = load_policy(run.folder), choose_scenes(small_scenes(), 3, seed=1)
    done = evaluate_scenes(scenes, policy)
    assert "proposal" not in done.table()
    for score, scene in zip(done.scores["policy"], scenes, strict=True):
        rollout = evaluate(run.folder, scene)
        assert rollout.score == score
        assert scene.violations(rollout.layout) == []
    with pytest.raises(ValueError, match="'small' has no test set: sample"):
        choose_scenes(policy.scene, 3)
    with pytest.raises(ValueError, match="has no scene of its own: give one"):
        evaluate(run.folder)


def test_invalid_arguments_are_rejected(tmp_path):
    for changes, reason in (
        ({"algorithm": "dqn"}, "algorithm = 'dqn': .*apg, ppo, ars"),
        ({"steps": 0}, "steps = 0: give a whole number"),
        ({"seed": -1}, "seed = -1: give a whole number"),
        ({"num_scenes": 5000}, "num_scenes = 5000: .*1 to 4096"),
        ({"num_scenes": 2}, "num_scenes = 2: .*the scene is fixed"),
        ({"hyperparameters": {"gamma": 1.0}}, "hyperparameters = .*gamma.*: give Hyperparameters"),
        ({"folder": 3}, "folder = 3: give a path"),
        ({"folder": Path(__file__)}, "is a file: name a folder"),
        ({"folder": tmp_path, "resume": True}, "holds no training to resume"),
    ):
        with pytest.raises((ValueError, TypeError), match=reason):
            train(SMALL, **changes)
    for name, value in {"first_deviation": 0.0, "middle": 1.0, "num_envs": 0}.items():
        with pytest.raises(ValueError, match=f"{name} = "):
            default_hyperparameters("ppo", SMALL).replace(**{name: value})


def test_the_configuration_accepts_every_algorithm(tmp_path, monkeypatch):
    arguments = {"seed": 0, "steps": 1, "hyperparameters": {"num_envs": 1, "steps": 1}}
    for algorithm in (*ALGORITHMS, "new"):
        (tmp_path / "config.json").write_text(json.dumps({"algorithm": algorithm, **arguments}))
        if algorithm == "new":
            with pytest.raises(ValueError, match=r"config\.json: algorithm = 'new': choose one of"):
                read_config(tmp_path)
            monkeypatch.setattr("agents.policy.ALGORITHMS", (*ALGORITHMS, "new"))
        assert read_config(tmp_path).algorithm == algorithm


def test_weights_that_are_not_finite_end_a_training_with_step_and_seed(tmp_path):
    chosen = tiny("ppo", learning_rate=1e30)
    with pytest.raises(
        ValueError, match=r"ppo, seed 7: the weights are not finite after \d+ steps"
    ):
        train(SMALL, "ppo", seed=7, folder=tmp_path / "run", hyperparameters=chosen)
    assert evaluate(tmp_path / "run").score > 0.0  # the best policy until then
    with pytest.raises(ValueError, match=r"use_sde = True: .*ppo"):
        train(SMALL, "ppo", folder=tmp_path / "sde", hyperparameters=tiny("ppo", options={
            "use_sde": True, "n_steps": 12}))  # fmt: skip


def test_an_interruption_outside_the_updates_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    def interrupted(training: Training, _: bool) -> None:
        training.folder.mkdir()
        (training.folder / "config.json").touch()
        raise KeyboardInterrupt

    monkeypatch.setattr(Training, "run", interrupted)
    assert main(["train", "sprint", "--out", str(tmp_path / "run")]) == 130
    words = "interrupted: the same command with --resume continues"
    assert words in capsys.readouterr().err


def test_invalid_checkpoints_are_rejected_without_running_their_code(tmp_path, monkeypatch):
    run = train(SMALL, "apg", folder=tmp_path / "run", hyperparameters=tiny("apg"), steps=24)
    path = run.folder / "checkpoint.pt"
    whole = torch.load(path, weights_only=True)
    data = path.read_bytes()
    monkeypatch.chdir(tmp_path)
    for state in ({}, {"curve": 1}, whole | {"parameters": {}}, whole | {"steps": "many"}, _Code()):
        torch.save(state, path)
        message = r"checkpoint\.pt: not a checkpoint"
        with pytest.raises(ValueError, match=message) as caught:
            train(SMALL, folder=run.folder, resume=True)
        assert "weights_only" not in str(caught.value)
    assert not Path("ran").exists()
    for torn in (b"", data[:3000], data[3000:]):
        path.write_bytes(torn)
        with pytest.raises(ValueError, match=r"checkpoint\.pt: not a checkpoint, or damaged"):
            train(SMALL, folder=run.folder, resume=True)


class _Code:
    """Object whose pickle leaves a file when it is loaded."""

    def __reduce__(self) -> object:
        return Path.touch, (Path("ran"),)
