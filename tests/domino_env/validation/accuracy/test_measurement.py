"""How exact the answers are: against sixty digits, and estimates against true errors."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from domino_env.cli.main import main
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome, simulate, simulate_batch
from domino_env.scenes.io.reading import load_scene
from domino_env.validation.accuracy import measurement as accuracy
from domino_env.validation.accuracy import savings, stability
from domino_env.validation.accuracy.edge_rows import dipping_push, hesitant_row
from domino_env.validation.accuracy.many_digits import true_wave
from domino_env.validation.accuracy.measurement import Measurement, Row, error_of, time_to_reach

# against sixty digits ---------------------------------------------------------------------------

SHORT = {
    "a flush, friction": (Layout([0.005, 0.02, 0.025], 0.0075), Physics(0.4)),
    "two flush in one impact": (Layout([0.004, 0.004, 0.034], 0.0075), Physics(0.6, push=12.0)),
    "no friction, unequal": (
        Layout([0.02, 0.012, 0.025], [0.005, 0.009, 0.007, 0.004], [0.048, 0.047, 0.049, 0.048]),
        Physics(0.0),
    ),
    "released": (Layout([0.044, 0.042, 0.02], 0.01), Physics(0.1, push=10.0)),
}


@pytest.mark.parametrize("name", SHORT)
def test_the_tightest_run_meets_sixty_digits(name: str) -> None:
    layout, physics = SHORT[name]
    true = true_wave(layout, physics)
    wave = simulate(layout, physics, rtol=1e-13)
    assert (wave.outcome, wave.flushes) == (true.outcome, true.flushes)
    error = true.relative_error(wave.arrival_times)
    assert error <= min(wave.error_estimate, 5e-15)
    looser = simulate(layout, physics, rtol=1e-11)
    assert looser.converged
    assert true.relative_error(looser.arrival_times) <= 1e-11


@pytest.mark.parametrize("dip", [1e-4, 1e-12])
def test_a_near_stall_is_as_exact_as_it_says(dip: float) -> None:
    layout = hesitant_row()
    physics = Physics(push=dipping_push(layout, Physics(), dip))
    true = true_wave(layout, physics)
    wave = simulate(layout, physics, rtol=1e-13)
    assert wave.outcome == true.outcome == Outcome.PROPAGATED
    assert np.nanmin(wave.stall_margin) == pytest.approx(dip, rel=1e-3)
    error = true.relative_error(wave.arrival_times)
    assert 1e-17 / dip < error  # one unit in the last place moves it that much
    assert error <= wave.error_estimate < 1000.0 * error
    assert not wave.converged


def test_sixty_digits_know_other_endings() -> None:
    stalls = true_wave(Layout.uniform(3, spacing=0.002), Physics(0.5, push=2.9))
    assert stalls.outcome == Outcome.STALLED
    jams = true_wave(Layout.uniform(3, spacing=0.012), Physics(7.0, push=50.0))
    assert jams.outcome == Outcome.JAMMED
    far = true_wave(Layout([0.02, 0.05], 0.0075), Physics())
    assert far.outcome == Outcome.OUT_OF_REACH
    assert far.relative_error(np.array([0.0, np.inf, np.inf])) == math.inf


# estimates against true errors ------------------------------------------------------------------


def _kinds(rows: int) -> Iterator[tuple[str, np.ndarray, np.ndarray, Physics, dict[str, object]]]:
    """Random rows of 30 of many kinds."""
    rng, n, h = np.random.default_rng(11), 30, 0.048
    gaps = rng.uniform
    equal = np.full((rows, n), 0.0075)
    wide = gaps(0.002, 0.040, (rows, n - 1))
    mixed = gaps(0.003, 0.012, (rows, n))
    yield "mild", gaps(0.01, 0.025, (rows, n - 1)), equal, Physics(), {}
    yield "wide", wide, equal, Physics(), {}
    yield "no friction", wide, equal, Physics(0.0), {}
    yield "thickness", wide, mixed, Physics(), {}
    tall = {"height": gaps(0.0476, 0.0485, (rows, n)), "density": 10 ** gaps(2, 4, (rows, n))}
    yield "all parts", gaps(0.01, 0.03, (rows, n - 1)), mixed, Physics(push=20.0), tall
    far = h * 10 ** gaps(-4, -0.001, (rows, n - 1))
    odd = h * 10 ** gaps(-3, -0.3, (rows, n))
    yield "wild", far, odd, Physics(0.3, push=40.0), {}
    yield "wild, no friction", far, odd, Physics(0.0, push=40.0), {}
    yield "rough", wide, equal, Physics(0.8, push=60.0), {}
    yield "tight", gaps(0.0003, 0.004, (rows, n - 1)), equal, Physics(0.2, push=100.0), {}
    yield "half millimetres", 5e-4 * rng.integers(4, 80, (rows, n - 1)), equal, Physics(), {}
    runs = np.repeat(gaps(0.002, 0.035, (rows, 6)), 5, axis=1)[:, : n - 1]
    yield "runs of equal gaps", runs, equal, Physics(push=10.0), {}
    yield "hard push", wide, equal, Physics(push=1000.0), {}
    reach = h * (1.0 - 10 ** gaps(-8, -0.3, (rows, n - 1)))
    yield "nearly out of reach", reach, equal, Physics(0.0, push=10.0), {}
    same = np.repeat(gaps(0.001, 0.045, (rows, 1)), n - 1, axis=1)
    for mu in (0.25, 0.0):
        yield f"uniform, {mu}", same, equal, Physics(mu, push=15.0), {}
    tilt = 0.1 * np.sin(gaps(0, 6, (rows, 1)) + gaps(0.02, 0.3, (rows, 1)) * np.arange(n))
    even = gaps(0.01, 0.03, (rows, n - 1))
    ground = {"rise": -(even + 0.0075) * np.sin(0.5 * (tilt[:, 1:] + tilt[:, :-1])), "tilt": tilt}
    ground["rise"] += gaps(0, 0.001, (rows, n - 1))
    for mu in (0.25, 0.0):
        yield f"hills, {mu}", even, equal, Physics(mu, push=10.0), ground
    yield "short, weak push", wide[:, :3], mixed[:, :4], Physics(push=4.0), {}


def test_estimates_are_honest_and_tolerances_kept_over_random_rows() -> None:
    small, over, runs = 0, 0, 0
    for name, gaps, thick, physics, more in _kinds(250):
        exact = simulate_batch(gaps, thick, physics, rtol=1e-13, **more)  # type: ignore[arg-type]
        for rtol in (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
            got = simulate_batch(gaps, thick, physics, rtol=rtol, **more)  # type: ignore[arg-type]
            assert not np.isnan(got.arrival_times).any()
            assert not np.isnan(got.error_estimate).any()
            margin = np.minimum(got.lowest_stall_margin, exact.lowest_stall_margin)
            same = (got.outcome == exact.outcome) & (got.hit == exact.hit)
            assert np.all(same | (margin < 1e-9)), name
            struck = np.isfinite(exact.arrival_times) & (exact.arrival_times > 0.0)
            with np.errstate(invalid="ignore"):
                off = np.abs(got.arrival_times - exact.arrival_times)
                error = np.max(off / exact.arrival_times, axis=1, initial=0.0, where=struck)
            slack = exact.error_estimate
            small += int(np.sum(same & (error > got.error_estimate + slack)))
            over += int(np.sum(same & got.converged & (error > rtol + slack)))
            runs += len(same)
            if rtol >= 1e-10:  # below, the true error is rounding
                ratio = got.error_estimate / np.maximum(error, 1e-16)
                assert np.median(ratio[same]) < 1000.0, (name, rtol)
    assert runs > 20_000
    assert small <= runs // 1000
    assert over == 0


# the measuring ----------------------------------------------------------------------------------


def _run(solver: str, seconds: float, error: float) -> Measurement:
    return Measurement("row", solver, 1e-3, error, math.nan, seconds, 7, "PROPAGATED")


def test_the_error_is_the_largest_over_the_dominoes_struck() -> None:
    exact = np.array([0.0, 1.0, 2.0, np.inf])
    assert error_of(exact, exact) == 0.0
    assert error_of(np.array([0.0, 1.01, 2.04, np.inf]), exact) == pytest.approx(0.02)
    assert error_of(np.array([0.0, 1.0, 2.0, 3.0]), exact) == math.inf
    assert error_of(np.array([0.0, 1.0, np.inf, np.inf]), exact) == math.inf


def test_run_times_at_a_level_lie_between_those_measured() -> None:
    runs = [_run("rk4", 1.0, 1e-2), _run("rk4", 2.0, 1e-4), _run("rk4", 0.5, math.inf)]
    assert time_to_reach(runs, 1e-2) == 1.0
    assert time_to_reach(runs, 1e-3) == pytest.approx(math.sqrt(2.0))
    assert time_to_reach(runs, 1e-4) == 2.0
    assert math.isnan(time_to_reach(runs, 1e-6))
    assert math.isnan(time_to_reach([], 1e-6))


def test_every_solver_is_measured_and_finer_is_better() -> None:
    row = Row("short", "six", Layout.uniform(6, pitch=0.016), Physics())
    runs = list(accuracy.measure([row], budget=0.05, quick=True))
    assert {m.solver for m in runs} == set(accuracy.SOLVERS)
    for solver in accuracy.SOLVERS:
        mine = [m for m in runs if m.solver == solver]
        assert all(m.outcome == "PROPAGATED" and m.seconds > 0.0 for m in mine)
        assert len(mine) == 1 or mine[-1].error < mine[0].error
        assert all(m.error <= m.estimate for m in mine if solver == accuracy.OURS)
    table = "\n".join(accuracy.compare(runs))
    assert "seconds to an error of" in table
    lines = list(csv.DictReader(accuracy.as_csv(runs).splitlines()))
    assert [line["solver"] for line in lines] == [m.solver for m in runs]


def test_finer_settings_that_do_not_fit_the_budget_are_left_out() -> None:
    row = Row("short", "six", Layout.uniform(6, pitch=0.016), Physics())
    runs = list(accuracy.measure([row], budget=1e-9))
    assert len(runs) == len(accuracy.SOLVERS)


def test_a_wave_that_ends_otherwise_has_no_error() -> None:
    weak = Row("weak", "stalls", Layout.uniform(3, spacing=0.002), Physics(0.5, push=2.9))
    runs = [m for m in accuracy.measure([weak], quick=True) if m.outcome != "STALLED"]
    assert all(m.error == math.inf for m in runs)


def test_the_standard_rows_are_what_they_are_called() -> None:
    rows = {row.name: simulate(row.layout, row.physics) for row in accuracy.standard_rows()}
    assert all(wave.outcome == Outcome.PROPAGATED for wave in rows.values())
    assert rows["classic"].arrival_times[-1] == pytest.approx(1.746404, abs=5e-7)
    assert rows["flushes"].flushes > 5
    assert np.nanmin(rows["near-stall"].stall_margin) == pytest.approx(1e-3, rel=1e-2)


@pytest.mark.parametrize("name", ["sprint", "sprint-thickness"])
def test_a_scene_gives_its_best_uniform_row_and_a_random_one(name: str) -> None:
    scene = load_scene(name)
    uniform, random = accuracy.scene_rows(scene)
    assert uniform.layout.is_uniform or scene.free_thickness
    assert not random.layout.is_uniform
    assert not scene.violations(random.layout)


def test_a_complaint_names_what_is_wrong() -> None:
    case = stability.Extreme(
        "group", "name", Layout.uniform(3, pitch=0.016), Physics(), frozenset({Outcome.JAMMED})
    )
    verdict = stability.judge(case)
    assert verdict.complaints == ("the row was built for JAMMED",)
    table = list(stability.as_table([verdict]))
    assert table[-1].strip() == "!! the row was built for JAMMED"
    (line,) = csv.DictReader(stability.as_csv([verdict]).splitlines())
    assert line["complaints"] == "the row was built for JAMMED"


def test_a_row_not_recognised_as_uniform_falls_the_same() -> None:
    row = Layout.uniform(100, pitch=0.016)
    other = savings.nearly(row)
    assert not other.is_uniform
    times = [simulate(one, Physics(), rtol=1e-12).arrival_times for one in (row, other)]
    assert error_of(*times) < 1e-12


# the command ------------------------------------------------------------------------------------


def _is_png(path: Path) -> bool:
    return path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_domino_accuracy_writes_table_and_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["accuracy", "--scene", "gentle", "--quick", "--budget", "0.02", "--out", str(tmp_path)]
    assert main(words) == 0
    said = capsys.readouterr()
    assert "uniform: seconds to an error of (times ours)" in said.out
    assert said.err == ""
    rows = list(csv.DictReader((tmp_path / "accuracy.csv").read_text("utf-8").splitlines()))
    assert {row["solver"] for row in rows} == set(accuracy.SOLVERS)
    assert _is_png(tmp_path / "accuracy.png")


def test_domino_accuracy_stability(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["accuracy", "--stability", "--quick", "--out", str(tmp_path)]) == 0
    assert "all answered as they should be" in capsys.readouterr().out
    assert len((tmp_path / "stability.csv").read_text("utf-8").splitlines()) > 150
    assert _is_png(tmp_path / "stability.png")


def test_domino_accuracy_savings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["accuracy", "--savings", "--quick", "--out", str(tmp_path)]) == 0
    assert "times faster" in capsys.readouterr().out
    rows = list(csv.DictReader((tmp_path / "savings.csv").read_text("utf-8").splitlines()))
    assert {"friction", "differences between dominoes"} <= {row["left_out"] for row in rows}
    assert all(float(row["ratio"]) > 0.0 for row in rows)


def test_domino_accuracy_refuses_a_budget_of_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["accuracy", "--budget", "0"]) == 2
    assert "give seconds, more than 0" in capsys.readouterr().err
