"""Long rows: stretched from shorter ones, paid by their dominoes, the same when resumed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import domino_env as de
from optimize import Problem, search
from optimize.evaluator import Budget, BudgetSpent
from optimize.methods.search import long_rows
from optimize.methods.search.long_rows import Stretched, best_steady, is_long, repeated
from optimize.recorder import Recorder


@pytest.mark.parametrize("period", [1, 4, 16])
def test_a_stretched_row_keeps_its_ends_and_repeats_its_middle(period: int) -> None:
    rows = np.random.default_rng(0).random((2, 41))
    longer = repeated(rows, 200, period)
    assert longer.shape == (2, 200)
    head = (41 + period) // 2 - period
    tail = 41 - period - head
    assert np.array_equal(longer[:, :head], rows[:, :head])
    assert np.array_equal(longer[:, 200 - tail :], rows[:, 41 - tail :])
    middle = longer[:, head : 200 - tail]
    assert np.array_equal(middle[:, period:], middle[:, :-period])
    assert np.array_equal(repeated(rows, 41, period), rows)


def test_a_row_that_is_flat_between_its_ends_is_climbed_from_as_it_is() -> None:
    ends = np.random.default_rng(1).random((2, 2, long_rows.ENDS))
    rows = [np.concatenate([a, np.full(700, a[-1]), b]) for a, b in ends]
    for row, (_, b) in zip(rows, ends, strict=True):
        row[long_rows.ENDS - 1 : -long_rows.ENDS + 1] = b[0]
    start = np.concatenate(rows)
    assert Stretched(start, 2, None).wanted == pytest.approx(start, abs=1e-12)


def test_which_rows_are_long() -> None:
    scene = de.load_scene("marathon")
    assert is_long(scene)
    assert is_long(replace(scene, length=20.0))
    assert not is_long(replace(scene, count=100))
    assert not is_long(replace(scene, objective="toppled"))
    assert not is_long(replace(scene, length=20.0, spacing_values=(0.01, 0.02)))


def test_no_steady_wave_beats_the_best_one() -> None:
    scene = de.load_scene("gentle")
    gap, thickness = best_steady(scene)

    def speed(s: float, d: float) -> float:
        return de.steady_wave(s + d, d, scene.height, scene.physics).speed

    best = speed(gap, thickness)
    random = np.random.default_rng(2)
    for s, d in random.uniform(*np.array([scene.spacing, scene.thickness]).T, (100, 2)):
        assert speed(s, d) <= best
    assert best_steady(replace(scene, length=1.0)) is None


def test_smaller_rows_are_paid_by_their_dominoes() -> None:
    scene = de.load_scene("sprint")
    budget = Budget(Recorder(Problem(replace(scene, count=80))), evaluations=10)
    smaller = Problem(scene)
    with budget.lend(smaller, 5) as own:
        own.scores(np.full((5, smaller.dimension), 0.3))
    assert budget.spent == 3  # five of 40 dominoes cost as much as two and a half of 80
    assert budget.falls == own.falls
    with budget.lend(smaller, 1000) as own:  # half of what is left at most
        own.scores(np.full((50, smaller.dimension), 0.3))
    assert (own.spent, budget.spent) == (7, 7)
    budget.scores(np.full((2, budget.problem.dimension), 0.3))
    with pytest.raises(BudgetSpent), budget.lend(smaller, 1) as own:
        own.scores(np.full((2, smaller.dimension), 0.3))


def test_a_long_search_is_the_same_to_the_bit_and_far_ahead_of_its_mark(
    monkeypatch, tmp_path
) -> None:
    monkeypatch.setattr(long_rows, "SEARCHED", 40)
    scene = replace(de.load_scene("marathon"), count=512)
    whole = search(scene, budget=36, seed=3)
    assert whole.evaluations == 36
    assert whole.gain > 0.02  # uniform rows begin slowly, or run slowly
    search(scene, budget=28, seed=3, folder=tmp_path / "run")
    resumed = search(scene, budget=36, seed=3, folder=tmp_path / "run", resume=True)
    assert resumed.layout == whole.layout
    assert resumed.score == whole.score
