"""How exact the answers are, and how that is measured: estimates against true errors."""

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
from domino_env.validation import accuracy
from domino_env.validation.accuracy import Example, Measurement, time_to_reach
from domino_env.validation.edge_cases import error_of


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


# how errors are measured --------------------------------------------------------------------------


def _run(seconds: float, error: float) -> Measurement:
    return Measurement("example", "rk4", 1e-3, error, math.nan, seconds, 7, "PROPAGATED")


def test_the_error_is_the_largest_over_the_dominoes_hit() -> None:
    exact = np.array([0.0, 1.0, 2.0, np.inf])
    assert error_of(exact, exact) == 0.0
    assert error_of(np.array([0.0, 1.01, 2.04, np.inf]), exact) == pytest.approx(0.02)
    assert error_of(np.array([0.0, 1.0, 2.0, 3.0]), exact) == math.inf
    assert error_of(np.array([0.0, 1.0, np.inf, np.inf]), exact) == math.inf


def test_run_times_at_a_level_lie_between_those_measured() -> None:
    runs = [_run(1.0, 1e-2), _run(2.0, 1e-4), _run(0.5, math.inf)]
    assert time_to_reach(runs, 1e-2) == 1.0
    assert time_to_reach(runs, 1e-3) == pytest.approx(math.sqrt(2.0))
    assert time_to_reach(runs, 1e-4) == 2.0
    assert math.isnan(time_to_reach(runs, 1e-6))
    assert math.isnan(time_to_reach([], 1e-6))


SIX = Example("short", "six", Layout.uniform(6, pitch=0.016), Physics())


def test_every_solver_is_measured_and_finer_is_better() -> None:
    runs = list(accuracy.measure([SIX], budget=0.05, quick=True))
    assert {m.solver for m in runs} == set(accuracy.SOLVERS)
    for solver in accuracy.SOLVERS:
        mine = [m for m in runs if m.solver == solver]
        assert all(m.outcome == "PROPAGATED" and m.seconds > 0.0 for m in mine)
        assert len(mine) == 1 or mine[-1].error < mine[0].error
        assert all(m.error <= m.estimate for m in mine if solver == accuracy.SIMULATE)


def test_finer_settings_that_do_not_fit_the_budget_are_left_out() -> None:
    assert len(list(accuracy.measure([SIX], budget=1e-9))) == len(accuracy.SOLVERS)


def test_a_wave_that_ends_otherwise_has_no_error() -> None:
    weak = Example("weak", "stalls", Layout.uniform(3, spacing=0.002), Physics(0.5, push=2.9))
    runs = [m for m in accuracy.measure([weak], quick=True) if m.outcome != "STALLED"]
    assert all(m.error == math.inf for m in runs)


def test_the_standard_examples_are_what_they_are_called() -> None:
    waves = {one.name: simulate(one.layout, one.physics) for one in accuracy.standard_examples()}
    assert all(wave.outcome == Outcome.PROPAGATED for wave in waves.values())
    assert waves["classic"].arrival_times[-1] == pytest.approx(1.746404, abs=5e-7)
    assert waves["face-impacts"].flushes > 5
    assert np.nanmin(waves["near-stall"].stall_margin) == pytest.approx(1e-3, rel=1e-2)


@pytest.mark.parametrize("name", ["sprint", "sprint-thickness"])
def test_a_scene_gives_its_uniform_baseline_and_a_random_layout(name: str) -> None:
    scene = load_scene(name)
    uniform, random = accuracy.scene_examples(scene)
    assert uniform.layout.is_uniform or scene.free_thickness
    assert not random.layout.is_uniform
    assert not scene.violations(random.layout)


@pytest.mark.parametrize(
    ("options", "said", "table", "lines"),
    [
        (["--scene", "gentle", "--budget", "0.02"], "uniform: seconds to an error", "accuracy", 20),
        (["--stability"], "edge cases: none not answered as they should be", "stability", 200),
    ],
)
def test_domino_accuracy_writes_table_and_picture(
    options: list[str], said: str, table: str, lines: int, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    assert main(["accuracy", *options, "--quick", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert said in printed.out
    assert printed.err == ""
    rows = list(csv.DictReader((tmp_path / f"{table}.csv").read_text("utf-8").splitlines()))
    assert len(rows) > lines
    assert (tmp_path / f"{table}.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_domino_accuracy_refuses_a_budget_of_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["accuracy", "--budget", "0"]) == 2
    assert "give seconds, more than 0" in capsys.readouterr().err
