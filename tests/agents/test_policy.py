"""Policies without torch: the network in NumPy, the policies that ship, damaged files."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from agents import evaluate
from agents.designer.policy import Designer
from agents.network import acting, actor_of, read_arrays
from agents.policy import DESIGNER, POLICIES, ScenePolicy, shipped

SPRINT = POLICIES / "sprint"
FIRST, LAST = "mlp_extractor.policy_net.0.weight", "action_net.bias"


@pytest.mark.parametrize("name", shipped())
def test_a_policy_that_ships_has_its_reported_score(name: str) -> None:
    rollout = evaluate(name)
    reported = json.loads((POLICIES / name / "policy.json").read_text("utf-8"))
    assert rollout.score == pytest.approx(reported["score"], rel=1e-6)
    assert rollout.gain is not None
    assert rollout.gain > 0.03
    assert rollout.scene.violations(rollout.layout) == []
    assert f"| {rollout.score:.5f} |" in (POLICIES / name / "README.md").read_text("utf-8")


@pytest.mark.parametrize("name", [*shipped(), DESIGNER])
def test_every_policy_that_ships_has_a_card(name: str) -> None:
    card = (POLICIES / name / "README.md").read_text("utf-8")
    for part in ("**Scene", "**Seed", "**Score", "**Limits.**", "**Train it again.**"):
        assert part in card


def test_the_network_agrees_with_torch() -> None:
    torch = pytest.importorskip("torch")
    arrays = read_arrays(SPRINT / "policy.npz")
    network, rng = acting(actor_of(arrays)), np.random.default_rng(0)
    linear, tanh = torch.nn.functional.linear, torch.tanh
    for _ in range(20):
        observation = rng.standard_normal(arrays[FIRST].shape[1]).astype(np.float32)
        values = torch.from_numpy(observation)
        for layer in ("mlp_extractor.policy_net.0.", "mlp_extractor.policy_net.2.", "action_net."):
            weight, bias = (torch.from_numpy(arrays[layer + name]) for name in ("weight", "bias"))
            values = linear(values if layer.endswith("0.") else tanh(values), weight, bias)
        action = values.clamp(-1.0, 1.0).numpy()
        assert network(observation) == pytest.approx(action, abs=2e-6)


def test_evaluating_and_designing_need_no_torch(tmp_path: Path) -> None:
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
def test_weights_that_do_not_fit_are_rejected(tmp_path: Path, name: str) -> None:
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
        with pytest.raises(ValueError, match=r"policy\.npz: (it does not hold|not an archive)"):
            load(folder)
    whole = (POLICIES / name / "policy.npz").read_bytes()
    torn = whole[: len(whole) // 2] + bytes(40) + whole[len(whole) // 2 + 40 :]
    for data in (b"", b"not an archive", whole[:2000], whole[2000:], torn):
        path.write_bytes(data)
        with pytest.raises(ValueError, match=r"policy\.npz: not an archive"):
            load(folder)


def test_a_policy_of_another_scene_is_rejected() -> None:
    with pytest.raises(ValueError, match="choose a scene with the same free variables"):
        evaluate("sprint", "sprint-thickness")
    rougher = replace(de.load_scene("sprint"), name="rougher", physics=de.Physics(0.3, push=8.0))
    assert evaluate("sprint", rougher).score > 0.0
    with pytest.raises(ValueError, match=r"ships: .*sprint"):
        evaluate("nothing-of-that-name")


def test_an_archive_is_opened_only_where_it_is_trusted(tmp_path: Path) -> None:
    path = tmp_path / "agent.zip"
    path.write_bytes(b"PK")
    with pytest.raises(ValueError, match="runs the code that it contains: add --trust"):
        evaluate(path, "sprint")
    pytest.importorskip("stable_baselines3")
    with pytest.raises(ValueError, match="is no archive of"):
        evaluate(path, "sprint", trust=True)
