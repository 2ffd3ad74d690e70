"""Scripted policies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import domino_env as de
from agents import evaluate
from agents.rollout import build
from agents.scripted import SCRIPTED
from domino_env import DominoChain
from domino_env.cli.main import main


@pytest.fixture(scope="module")
def small():
    return replace(de.load_scene("sprint"), name="small", count=8)


@pytest.mark.parametrize("name", SCRIPTED)
def test_a_builder_keeps_the_rules_and_is_judged_by_the_scene(small, name: str) -> None:
    built = SCRIPTED[name](small)
    assert small.violations(built.layout) == []
    assert built.score == small.score(built.layout)
    if built.score > 0.0:  # looking one fall ahead alone may run the wave dry
        assert built.gain == pytest.approx(built.score / built.uniform.score - 1.0)
    else:
        assert name == "greedy"
        assert built.gain is None


def test_a_ramp_is_no_worse_than_uniform_and_keeps_a_length(small) -> None:
    assert SCRIPTED["ramp"](small).gain > 0.0
    exact = replace(small, length=0.16)
    built = SCRIPTED["ramp"](exact)
    assert exact.violations(built.layout) == []


def test_the_greedy_builder_takes_what_pays_most_at_once(small) -> None:
    built = SCRIPTED["greedy"](small)
    env = DominoChain(small)
    env.reset()
    low, high = small.spacing
    action = 2.0 * (built.layout.spacing[0] - low) / (high - low) - 1.0
    paid = env.step(np.array([action]))[1]
    for other in np.linspace(-1.0, 1.0, 9):
        env.reset()
        assert env.step(np.array([other]))[1] <= paid + 1e-9


def test_a_row_that_dies_is_shown_whole() -> None:
    scene = replace(de.load_scene("sprint"), name="dies", count=6, physics=de.Physics(push=2.8))
    built = build(lambda _: np.array([-1.0], dtype=np.float32), scene)
    assert built.layout.count == 6
    assert built.score < 0.0
    assert built.gain is None


def test_they_are_evaluated_by_name(small, capsys) -> None:
    assert evaluate("uniform", small).score == small.uniform().score
    with pytest.raises(ValueError, match="name one to build for"):
        evaluate("uniform")
    assert main(["evaluate", "uniform", "--scene", "sprint"]) == 0
    said = capsys.readouterr().out
    assert "score 0.802997" in said
    assert "level with the best uniform row" in said
    assert main(["evaluate", "no-such-folder"]) == 2
    assert "holds no policy" in capsys.readouterr().err
