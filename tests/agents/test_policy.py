"""Policies without torch: the network in NumPy, the shipped policies, damaged files."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import domino_env as de
from agents import evaluate, load_policy
from agents.designer.policy import Designer
from agents.network import read_arrays
from agents.policy import DESIGNER, POLICIES, ScenePolicy, find_folder, policy_names
from domino_env.cli.main import main

FIRST, LAST = "mlp_extractor.policy_net.0.weight", "action_net.bias"


def test_a_name_selects_a_shipped_policy_and_a_path_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sprint").mkdir()
    assert find_folder("sprint") == POLICIES / "sprint"
    assert find_folder("./sprint") == find_folder(Path("sprint")) == Path("sprint")


@pytest.mark.parametrize("name", policy_names())
def test_a_shipped_policy_has_its_reported_score(name):
    rollout = evaluate(name)
    reported = json.loads((POLICIES / name / "policy.json").read_text("utf-8"))
    assert rollout.score == pytest.approx(reported["score"], rel=1e-6)
    assert rollout.gain > 0.03
    assert rollout.scene.violations(rollout.layout) == []
    assert f"| {rollout.score:.5f} |" in (POLICIES / name / "README.md").read_text("utf-8")
    policy = load_policy(name)
    with pytest.raises(TypeError, match="scene = 'sprint': give a Scene"):
        policy.build("sprint")


@pytest.mark.parametrize("name", [*policy_names(), DESIGNER])
def test_every_shipped_policy_has_a_card(name):
    card = (POLICIES / name / "README.md").read_text("utf-8")
    for part in ("**Scene", "**Seed", "**Score", "**Limits.**", "**Train it again.**"):
        assert part in card


def test_evaluating_and_designing_need_no_torch(tmp_path):
    script = (
        "import sys\n"
        "for name in ('torch', 'stable_baselines3', 'sb3_contrib'): sys.modules[name] = None\n"
        "import agents.training\n"
        "from domino_env.cli.main import main\n"
        "assert main(['evaluate', 'sprint']) == 0\n"
        "sys.exit(main(['evaluate', 'designer', '--scene', 'sprint', '--layout', 'layout.csv']))"
    )
    subprocess.run([sys.executable, "-c", script], cwd=tmp_path, check=True)
    assert de.Layout.read(tmp_path / "layout.csv").count == 40


@pytest.mark.parametrize("name", ["sprint", DESIGNER])
def test_invalid_weights_are_rejected(tmp_path, name):
    folder = shutil.copytree(POLICIES / name, tmp_path / name)
    load = ScenePolicy.load if name == "sprint" else Designer.load
    path, good = folder / "policy.npz", read_arrays(POLICIES / name / "policy.npz")
    first, last = (FIRST, LAST) if name == "sprint" else ("layout_0_weight", "tight_1_bias")
    for key, value in (
        (first, good[first][:, :-1]),
        (first, np.full_like(good[first], np.nan)),
        (last, np.zeros(99, np.float32)),
        (last, None),
        (last, good[last].astype(float)),
        (last, np.array(["a", "b"])),
        (last, np.array([print], dtype=object)),  # needs a pickle
    ):
        np.savez(path, **{k: v for k, v in (good | {key: value}).items() if v is not None})
        with pytest.raises(ValueError, match=r"policy\.npz: (not the weights|not an archive)"):
            load(folder)
    whole = (POLICIES / name / "policy.npz").read_bytes()
    torn = whole[: len(whole) // 2] + bytes(40) + whole[len(whole) // 2 + 40 :]
    for data in (b"", b"not an archive", whole[:2000], whole[2000:], torn):
        path.write_bytes(data)
        with pytest.raises(ValueError, match=r"policy\.npz: not an archive"):
            load(folder)


# archives of Stable-Baselines3 -------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("algorithm", ["PPO", "SAC", "TD3", "TQC", "ARS"])
def test_an_archive_is_evaluated_without_running_its_code(tmp_path, monkeypatch, capsys, algorithm):
    sb3 = pytest.importorskip("stable_baselines3")
    kind = getattr(sb3, algorithm, None) or getattr(pytest.importorskip("sb3_contrib"), algorithm)
    path = tmp_path / "model.zip"
    for name in ("sprint", "varied") if algorithm == "PPO" else ("sprint",):
        env = gymnasium.make("DominoChain-v2", scene=name)
        options = {} if algorithm == "ARS" else {"policy_kwargs": {"net_arch": [16]}}
        model = kind("MlpPolicy", env, seed=3, device="cpu", **options)
        model.save(path)
        distribution = de.load_distribution(name) if name == "varied" else None
        trusted = load_policy(path, trust=True, distribution=distribution)
        with monkeypatch.context() as patch:
            patch.setattr("stable_baselines3.common.save_util.load_from_zip_file", None)
            patch.setattr("pickle.loads", None)
            policy = load_policy(path, distribution=distribution)
        observations = np.stack([env.observation_space.sample() for _ in range(5)])
        expected = model.predict(observations, deterministic=True)[0]
        assert policy.policy(observations) == pytest.approx(expected, abs=1e-5)
        assert trusted.policy(observations) == pytest.approx(expected, abs=1e-6)
        scene = de.load_scene("sprint")
        assert policy.build(scene).score == pytest.approx(trusted.build(scene).score, abs=1e-3)
        for options in (["--scenes", "2"], ["--scene", "varied", "--scenes", "2"]):
            assert main(["evaluate", str(path), *options]) == 0
    if algorithm != "PPO":
        return
    assert main(["evaluate", str(path), "--scene", "sprint", "--distribution", "varied"]) == 0
    assert main(["evaluate", str(path), "--scene", "sprint"]) == 2
    assert main(["evaluate", str(path), "--scene", "varied-thickness"]) == 2
    errors = capsys.readouterr().err
    assert "this policy was trained on (26,), with 6 instead of 0 sampled numbers: choose" in errors
    assert "this policy was trained on (26,): choose a scene" in errors


def _doubled():
    """Return a features extractor without parameters that changes the observations."""
    from stable_baselines3.common.torch_layers import FlattenExtractor

    class Doubled(FlattenExtractor):
        def forward(self, observations):
            return 2.0 * super().forward(observations)

    return Doubled


@pytest.mark.filterwarnings("ignore")
def test_an_archive_that_needs_its_code_is_loaded_only_with_trust(tmp_path):
    sb3, torch = pytest.importorskip("stable_baselines3"), pytest.importorskip("torch")
    contrib = pytest.importorskip("sb3_contrib")
    path = tmp_path / "model.zip"
    env = gymnasium.make("DominoChain-v2", scene="sprint")
    for kind, options in (
        (sb3.PPO, {"policy_kwargs": {"activation_fn": torch.nn.ELU}}),
        (sb3.PPO, {"policy_kwargs": {"features_extractor_class": _doubled()}}),
        (sb3.SAC, {"use_sde": True}),
        (contrib.CrossQ, {}),
    ):
        kind("MlpPolicy", env, device="cpu", **options).save(path)
        with pytest.raises(ValueError, match=r"model\.zip: its .*; add --trust"):
            evaluate(path, "sprint")
        assert evaluate(path, "sprint", trust=True).scene.name == "sprint"
    with pytest.raises(ValueError, match="has no scene of its own: give one"):
        evaluate(path, trust=True)
    contrib.RecurrentPPO("MlpLstmPolicy", env, device="cpu").save(path)
    with pytest.raises(ValueError, match=r"model\.zip: its policy is recurrent"):
        evaluate(path, "sprint", trust=True)
    path.write_bytes(b"PK")
    for trust in (False, True):
        with pytest.raises(ValueError, match=r"model\.zip: damaged, or not an archive of Stable"):
            evaluate(path, "sprint", trust=trust)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("place", ["vec_normalize.pkl", "DominoChain-v9/vecnormalize.pkl"])
def test_observations_are_normalised_as_in_training(tmp_path, place):
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    env = VecNormalize(DummyVecEnv([lambda: de.DominoChain("sprint")]), clip_obs=2.0)
    model = sb3.PPO("MlpPolicy", env, n_steps=64, n_epochs=1, device="cpu").learn(64)
    model.save(tmp_path / "model.zip")
    for trust in (False, True):
        with pytest.raises(
            ValueError, match=r"model\.zip: its obs.* missing: save them as .*\.pkl$"
        ):
            load_policy(tmp_path / "model.zip", trust=trust)
    (tmp_path / place).parent.mkdir(exist_ok=True)
    env.save(str(tmp_path / place))
    with pytest.raises(ValueError, match=r"normalised by .*normalize\.pkl, a pickle; add --trust"):
        load_policy(tmp_path / "model.zip")
    policy = load_policy(tmp_path / "model.zip", trust=True)
    observations = env.venv.reset()
    expected = model.predict(env.normalize_obs(observations), deterministic=True)[0]
    assert policy.policy(observations) == pytest.approx(expected, abs=1e-6)
    plain = model.predict(observations, deterministic=True)[0]
    assert np.any(np.abs(plain - expected) > 1e-4)


@pytest.mark.filterwarnings("ignore")
def test_statistics_of_rewards_alone_are_not_required(tmp_path):
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    env = VecNormalize(DummyVecEnv([lambda: de.DominoChain("sprint")]), norm_obs=False)
    model = sb3.SAC("MlpPolicy", env, learning_starts=10, device="cpu").learn(50)
    model.save(tmp_path / "model.zip")
    assert load_policy(tmp_path / "model.zip").policy(env.reset()).shape == (1, 1)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("trained", "options", "given", "difference"), [
    ("sprint", {"window": 4}, "sprint", "window = 4 instead of 8"),
    ("varied", {"window": 3, "hide": ("friction",)}, "varied",
     "window = 3 instead of 8 and 5 instead of 6 sampled numbers"),
    ("varied", {}, "sprint", "6 instead of 0 sampled numbers"),
    ("sprint", {}, "varied", "0 instead of 6 sampled numbers"),
])  # fmt: skip
def test_an_error_names_how_the_environment_of_an_archive_differs(
    tmp_path, trained, options, given, difference
):
    sb3 = pytest.importorskip("stable_baselines3")
    path, env = tmp_path / "model.zip", de.DominoChain(trained, **options)
    sb3.PPO("MlpPolicy", env, device="cpu").save(path)
    distribution = de.load_distribution(given) if given == "varied" else None
    scene = de.load_scene("sprint" if distribution else given)
    with pytest.raises(ValueError, match=f"was trained on .*{difference}: choose a scene"):
        load_policy(path, distribution=distribution).build(scene)
