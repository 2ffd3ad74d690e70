"""Presets that are searched for: trials that repeat what the learner takes, and going on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("optuna")

import optuna

import domino_env as de
from agents.lab.tuning import choose, tune
from agents.sb3.presets import ALGORITHMS, Preset

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_what_a_trial_chooses_is_a_preset_that_can_be_read_back(algorithm: str) -> None:
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    for _ in range(20):
        trial = study.ask()
        plan = choose(trial, algorithm, 39)
        assert Preset(**plan.to_dict()) == plan
        assert choose(optuna.trial.FixedTrial(trial.params), algorithm, 39) == plan


def test_a_search_goes_on_where_it_was(tmp_path: Path) -> None:
    small = replace(de.load_scene("sprint"), name="small", count=6)
    file = tmp_path / "trials.db"
    _, first, number = tune(small, "ars", 2, 0.3, file)
    assert number == 2
    plan, best, number = tune(small, "ars", 1, 0.3, file)
    assert number == 3
    assert best >= first
    assert plan.rows == 2 * plan.options["n_delta"]
    with pytest.raises(ValueError, match="no algorithm 'dqn'"):
        tune(small, "dqn", 1, 1.0, file)
    with pytest.raises(ValueError, match="give more than 0"):
        tune(small, "ars", 0, 1.0, file)
