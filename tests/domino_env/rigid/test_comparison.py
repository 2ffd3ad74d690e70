"""The model against judges who keep no contact closed."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.cli.main import main
from domino_env.rigid.built_in import Standing
from domino_env.rigid.comparison import between, document, table, verify, write_verification
from domino_env.rigid.converging import Engine, extrapolated
from domino_env.rigid.judges import Fall, largest_move
from domino_env.rigid.uniform import best_uniform_on

ROW, PHYSICS = de.Layout.uniform(14, pitch=0.024), de.Physics(push=5 * np.pi)
QUICK = (2e-4, 1e-4)  # [s]


@dataclass(frozen=True)
class Late:
    """A judge who sees the model's times later by a share, and doubts them."""

    late: float = 0.0
    doubt: float = 0.0
    hit: int = 14
    toppled: int = 14
    name: str = "late"

    def fall(self, layout: de.Layout, physics: de.Physics, floor: float | None) -> Fall:
        times = de.simulate(layout, physics).arrival_times * (1.0 + self.late)
        times[self.hit :] = np.inf
        return Fall(floor, times, self.toppled, self.doubt, self.doubt < 1e-3, "by hand")


@pytest.mark.parametrize(
    ("judge", "word"),
    [
        (Late(5e-4, 0.0), "AGREES"),
        (Late(2e-3, 0.0), "CLOSE"),
        (Late(1.8e-3, 9e-4), "AGREES"),  # only what exceeds the doubt counts
        (Late(3.5e-3, 9e-4), "CLOSE"),
        (Late(4e-3, 0.0), "DIFFERS"),
        (Late(4e-3, 5e-3), "UNDECIDED"),  # a doubt as large as that agrees with nothing
        (Late(0.0, math.inf), "UNDECIDED"),
        (Late(hit=13, toppled=13), "DIFFERS: the wave reaches 14 of 14 dominoes in the model, 13"),
        (Late(toppled=13), "DIFFERS: every arrival time"),
    ],
)
def test_only_what_exceeds_the_judges_doubt_counts(judge: Late, word: str, tmp_path: Path) -> None:
    checked = verify(ROW, PHYSICS, floors=[0.5], judge=judge)
    assert checked.verdict.startswith(word)
    assert "nan" not in checked.verdict
    write_verification(checked, tmp_path / "verification.json", checked)
    read = json.loads((tmp_path / "verification.json").read_text())
    assert read["verdict"] == table(checked)[-1]
    assert [one["floor"] for one in read["floors"]] == [None, 0.5]
    assert read["second"]["floors"] == read["floors"]
    assert "agree" in between(checked, checked)[0]


def test_a_wave_that_dies_dies_for_the_judge_too() -> None:
    layout = de.Layout([0.012, 0.012, 0.060, 0.012], 0.0075)
    died = verify(layout, de.Physics(push=10.0), floors=[0.5])
    assert died.wave.hit == died.hinged.hit == died.standing[0].hit == 3
    assert np.isnan(died.difference)
    assert document(died)["difference"] is None
    assert died.verdict.startswith("AGREES")


def test_uniform_and_random_rows_agree() -> None:
    rng = np.random.default_rng(4)
    random = de.Layout(rng.uniform(0.008, 0.024, 13), rng.uniform(0.005, 0.009, 14))
    for row in (ROW, random):
        checked = verify(row, PHYSICS, floors=[])
        assert checked.verdict.startswith("AGREES")
        assert checked.free is None


@pytest.fixture(scope="module")
def engine() -> Engine:
    pytest.importorskip("pymunk")
    return Engine(steps=QUICK, share=3e-3)


HILL = de.Layout(
    [0.016] * 13, 0.0075, rise=np.linspace(0.0018, -0.0018, 13), tilt=np.linspace(-0.08, 0.08, 14)
)


@pytest.mark.parametrize(
    "row",
    [ROW, de.Layout.uniform(14, pitch=0.02, slope=-0.07), HILL],
    ids=["flat", "uphill", "over a hill"],
)
def test_the_engine_agrees_with_both(engine: Engine, row: de.Layout) -> None:
    ours, theirs = (verify(row, PHYSICS, floors=[0.5], judge=one) for one in (None, engine))
    assert theirs.hinged.converged
    assert abs(theirs.difference) < 1e-3
    for one, other in zip(ours.falls, theirs.falls, strict=True):
        assert largest_move(one.arrivals, other.arrivals) < 2e-3


def test_an_engine_that_may_not_converge_says_so(engine: Engine) -> None:
    lines: list[str] = []
    hasty = Engine(steps=QUICK, share=1e-9, most_sweeps=60, progress=lines.append)
    found = verify(ROW, PHYSICS, floors=[], judge=hasty)
    assert not found.hinged.converged
    assert "not converged within its limits" in "\n".join(table(found))
    # nothing was doubled: nobody knows what more sweeps would do
    assert found.hinged.doubt == math.inf
    assert found.verdict.startswith("UNDECIDED")
    assert len(lines) == 2


def test_dominoes_far_behind_may_be_taken_away() -> None:
    pytest.importorskip("pymunk")
    from domino_env.rigid.engine import topple

    # they were held in place once, and pushed the others on, the more the more sweeps there were
    row = de.Layout.uniform(40, pitch=0.02)
    physics = de.Physics(push=8.0)
    whole, near, far = (
        topple(row, physics, 2e-4, sweeps=60, window=w).arrivals for w in (None, 24, 8)
    )
    assert largest_move(near, whole) < 1e-5
    assert largest_move(far, whole) > 1e-3
    for wrong in ({"window": 0}, {"step": 1e-2}, {"sweeps": 0}):
        asked = {"step": 1e-4, "sweeps": 30} | wrong
        with pytest.raises(ValueError, match=next(iter(wrong))):
            topple(row, physics, **asked)


def test_extrapolation_is_exact_for_errors_of_first_order() -> None:
    steps, limit = np.array([4e-5, 2e-5, 1e-5]), np.array([0.0, 0.1, 0.3, np.inf])
    times = limit + np.outer(steps, [0.0, 3.0, 7.0, 1.0])
    np.testing.assert_allclose(extrapolated(steps, times), limit, rtol=1e-13)


def test_bad_questions_are_refused() -> None:
    with pytest.raises(ValueError, match="at least two"):
        verify(ROW, PHYSICS, [1e-5, 1e-5])
    with pytest.raises(ValueError, match="share = 0"):
        Engine(share=0.0)
    with pytest.raises(ValueError, match=r"floor = -0\.3"):
        verify(ROW, PHYSICS, floors=[-0.3])
    with pytest.raises(ValueError, match="no wave"):
        verify(de.Layout([], [0.0075]), PHYSICS)


@pytest.fixture(scope="module")
def short() -> de.Scene:
    return replace(de.load_scene("sprint"), count=12)


def test_the_command_checks_a_row_without_the_engine(
    short: de.Scene, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short.uniform().layout.to_csv(tmp_path / "row.csv")
    (tmp_path / "scene.toml").write_text(short.to_toml())
    line = ["verify", str(tmp_path / "row.csv"), "--floor", "free"]
    assert main([*line, "--no-engine", "--plot", str(tmp_path / "row.png")]) == 0
    said = capsys.readouterr().out
    assert "AGREES" in said
    assert "floor 1:" in said  # what was called free
    assert (tmp_path / "row.png").stat().st_size > 10_000
    with pytest.raises(SystemExit):
        main([*line[:-1], "rough"])
    assert "coefficients of friction" in capsys.readouterr().err
    assert main([*line, "--no-engine", "--sweeps", "60"]) == 2


def test_the_best_uniform_row_of_a_floor_beats_its_neighbours(short: de.Scene) -> None:
    judge = Standing()
    mark = short.uniform().layout
    row = best_uniform_on(short, mark, 0.3, judge)
    assert best_uniform_on(short, mark, None, judge) is mark

    def speed(gap: float) -> float:
        layout = de.Layout.uniform(short.count, pitch=gap + 0.0075)
        return layout.length / judge.fall(layout, short.physics, 0.3).arrivals[-1]

    gap = float(row.spacing[0])
    assert speed(gap) > max(speed(gap - 0.003), speed(gap + 0.003))
