"""Examples: short trainings improve the policy."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from domino_env import load_test_set

EXAMPLES = Path(__file__).parent.parent / "examples"


def loaded(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("name", "short", "longer"),
    [("ppo_in_one_file", 1, 10), ("ppo_of_stable_baselines3", 1, 10 * 64 * 64)],
)
def test_an_example_learns(
    name: str, short: int, longer: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    example, scenes = loaded(name), load_test_set("varied")[:20]
    monkeypatch.setattr(example, "NUM_ENVS", 64)
    before, after = (example.gains(example.train(much), scenes) for much in (short, longer))
    assert after.shape == (20,)
    assert after.mean() > before.mean()
    assert np.all((after >= -1.0) & (after < 0.1))
