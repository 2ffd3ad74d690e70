"""Policies without torch: the network in NumPy, and the policies that ship."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from agents import evaluate
from agents.base.shipped import POLICIES, shipped
from agents.sb3.actor import acting, actor_of, read_actor


@pytest.mark.parametrize("name", shipped())
def test_what_ships_builds_what_it_says(name: str) -> None:
    built = evaluate(name)
    said = json.loads((POLICIES / name / "policy.json").read_text("utf-8"))
    assert built.score == pytest.approx(said["score"], rel=1e-6)
    assert built.gain is not None
    assert built.gain > 0.03
    assert built.scene.violations(built.layout) == []
    assert sum(file.stat().st_size for file in (POLICIES / name).iterdir()) < 1_000_000


def test_it_does_what_torch_does() -> None:
    torch = pytest.importorskip("torch")
    arrays = dict(np.load(POLICIES / "sprint" / "policy.npz"))
    network = acting(actor_of(arrays))
    inputs = arrays["mlp_extractor.policy_net.0.weight"].shape[1]
    rng = np.random.default_rng(0)
    for _ in range(20):
        observation = rng.standard_normal(inputs).astype(np.float32)
        values = torch.from_numpy(observation)
        for stem in ("mlp_extractor.policy_net.0.", "mlp_extractor.policy_net.2."):
            weight, bias = (torch.from_numpy(arrays[stem + n]) for n in ("weight", "bias"))
            values = torch.tanh(torch.nn.functional.linear(values, weight, bias))
        weight, bias = (torch.from_numpy(arrays["action_net." + n]) for n in ("weight", "bias"))
        wanted = torch.nn.functional.linear(values, weight, bias).clamp(-1.0, 1.0).numpy()
        assert network(observation) == pytest.approx(wanted, abs=2e-6)


def test_building_needs_no_torch(tmp_path: Path) -> None:
    script = (
        "import sys; sys.modules['torch'] = sys.modules['stable_baselines3'] = None\n"
        "from agents import evaluate\n"
        "print(evaluate('sprint').score)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert float(done.stdout) > 0.82


def test_weights_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    good = dict(np.load(POLICIES / "sprint" / "policy.npz"))
    first, last = "mlp_extractor.policy_net.0.weight", "action_net.bias"
    for name, value in (
        (first, good[first][:, :-1][:-1]),
        (first, np.full_like(good[first], np.nan)),
        (last, np.zeros(7, np.float32)),
        (last, None),
        (last, good[last].astype(float)),
        (last, good[last] + 1e30),
    ):
        arrays = {k: v for k, v in (good | {name: value}).items() if v is not None}
        np.savez(tmp_path / "policy.npz", **arrays)
        with pytest.raises(ValueError, match=r"policy\.npz"):
            read_actor(tmp_path / "policy.npz", good[first].shape[1], 1)


def test_a_policy_of_another_scene_says_so() -> None:
    with pytest.raises(ValueError, match="choose a scene with the same things left free"):
        evaluate("sprint", "sprint-thickness")
    rougher = replace(de.load_scene("sprint"), name="rougher", physics=de.Physics(0.3, push=8.0))
    assert evaluate("sprint", rougher).score > 0.0
    with pytest.raises(ValueError, match=r"ships: .*sprint"):
        evaluate("nothing-of-that-name")
