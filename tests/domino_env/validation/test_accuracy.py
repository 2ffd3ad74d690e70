"""Accuracy: error estimates against true errors, run times against errors."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from domino_env.cli.main import main
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import simulate_batch
from domino_env.rigid.simulation import largest_difference
from domino_env.validation import accuracy
from domino_env.validation.accuracy import Measurement, time_to_reach
from domino_env.validation.edge_cases import EdgeCase


def _random_layouts(batch: int = 250, n: int = 30) -> Iterator[tuple[str, Physics, Any]]:
    """Yield batches of random layouts of many kinds."""
    rng, equal = np.random.default_rng(11), np.full((batch, n), 0.0075)
    draw = rng.uniform
    wide, mixed = draw(0.002, 0.040, (batch, n - 1)), draw(0.003, 0.012, (batch, n))
    yield "no friction", Physics(0.0), {"spacing": wide, "thickness": equal}
    yield "rough", Physics(0.8, push=60.0), {"spacing": wide, "thickness": equal}
    tall = {"height": draw(0.0476, 0.0485, (batch, n)), "density": 10 ** draw(2, 4, (batch, n))}
    gaps = draw(0.01, 0.03, (batch, n - 1))
    yield "all parts", Physics(push=20.0), {"spacing": gaps, "thickness": mixed} | tall
    size = 0.048 * np.cumprod(draw(1.0, 1.2, (batch, n)), axis=1)  # a higher one always stands
    gaps_far, odd = 10 ** draw(-6, -0.001, (batch, n - 1)), 10 ** draw(-4, 0.3, (batch, n))
    wild = {"spacing": size[:, :-1] * gaps_far, "thickness": size * odd, "height": size}
    wild["density"] = 10 ** draw(-2, 2, (batch, n))
    for mu in (0.3, 0.0):
        yield f"many powers of ten, {mu}", Physics(mu, push=60.0), wild
    runs = np.repeat(draw(0.002, 0.035, (batch, 6)), 5, axis=1)[:, : n - 1]
    yield "runs of equal gaps", Physics(push=10.0), {"spacing": runs, "thickness": equal}
    reach = 0.048 * (1.0 - 10 ** draw(-8, -0.3, (batch, n - 1)))
    yield "nearly out of reach", Physics(0.0, push=10.0), {"spacing": reach, "thickness": equal}
    same = np.repeat(draw(0.001, 0.045, (batch, 1)), n - 1, axis=1)
    yield "uniform", Physics(push=15.0), {"spacing": same, "thickness": equal}
    tilt = 0.1 * np.sin(draw(0, 6, (batch, 1)) + draw(0.02, 0.3, (batch, 1)) * np.arange(n))
    rise = -(gaps + 0.0075) * np.sin(0.5 * (tilt[:, 1:] + tilt[:, :-1]))
    rise += draw(0, 0.001, (batch, n - 1))
    uneven = {"spacing": gaps, "thickness": equal, "rise": rise, "tilt": tilt}
    yield "uneven ground", Physics(push=10.0), uneven


def test_estimates_are_honest_and_tolerances_kept_over_random_layouts():
    small = runs = 0
    for name, physics, layouts in _random_layouts():
        exact = simulate_batch(**layouts, physics=physics, rtol=1e-13)
        struck = np.isfinite(exact.arrival_times) & (exact.arrival_times > 0.0)
        slack = exact.error_estimate
        for rtol in (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
            got = simulate_batch(**layouts, physics=physics, rtol=rtol)
            assert not np.isnan([*got.arrival_times.T, got.error_estimate]).any()
            margin = np.minimum(got.lowest_stall_margin, exact.lowest_stall_margin)
            same = (got.outcome == exact.outcome) & (got.hit == exact.hit)
            assert np.all(same | (margin < 1e-9)), name
            with np.errstate(invalid="ignore"):
                errors = np.abs(got.arrival_times / exact.arrival_times - 1.0)
            error = np.max(errors, axis=1, initial=0.0, where=struck)
            assert not np.any(same & got.converged & (error > rtol + slack)), (name, rtol)
            small += int(np.sum(same & (error > got.error_estimate + slack)))
            runs += len(same)
            if rtol >= 1e-10:  # below, the true error is rounding
                ratio = got.error_estimate / np.maximum(error, 1e-16)
                assert np.median(ratio[same]) < 1000.0, (name, rtol)
    assert small <= runs // 1000


def _run(seconds: float, error: float) -> Measurement:
    return Measurement("example", "rk4", 1e-3, error, math.nan, seconds)


def test_the_error_is_the_largest_over_the_dominoes_hit():
    exact = np.array([0.0, 1.0, 2.0, np.inf])
    assert largest_difference(np.array([0.0, 1.01, 2.04, np.inf]), exact) == pytest.approx(0.02)
    assert largest_difference(np.array([0.0, 1.0, 2.0, 3.0]), exact) == math.inf


def test_the_run_time_to_an_error_is_that_of_the_fastest_run():
    runs = [_run(1.0, 1e-2), _run(2.0, 1e-4), _run(3.0, 1e-5), _run(0.5, math.inf)]
    found = [time_to_reach(runs, level) for level in (1e-2, 1e-3, 1e-5, 1e-6)]
    assert found == pytest.approx([1.0, 2.0, 3.0, math.nan], nan_ok=True)


SIX = EdgeCase("short", "six", Layout.uniform(6, pitch=0.016), Physics())


def test_every_solver_is_measured_and_finer_is_better():
    runs = list(accuracy.measure([SIX], seconds=0.05, quick=True))
    assert {m.solver for m in runs} == set(accuracy.SOLVERS)
    for solver in accuracy.SOLVERS:
        mine = [m for m in runs if m.solver == solver]
        assert all(math.isfinite(m.error) and m.seconds > 0.0 for m in mine)
        assert len(mine) == 1 or mine[-1].error < mine[0].error
        assert all(m.error <= m.estimate for m in mine if solver == accuracy.SIMULATE)
    # finer settings that exceed the time are left out
    assert len(list(accuracy.measure([SIX], seconds=1e-9))) == len(accuracy.SOLVERS)


@pytest.mark.parametrize(
    ("options", "summary", "table", "lines"),
    [
        ("--seconds 0.02", "classic: seconds to an error", "accuracy", 20),
        ("--stability", "edge cases: none with a fault", "stability", 200),
    ],
)
def test_domino_accuracy_writes_table_and_picture(
    options, summary, table, lines, tmp_path,
    capsys,
):  # fmt: skip
    assert main(["accuracy", *options.split(), "--quick", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert summary in printed.out
    assert printed.err == ""
    assert len((tmp_path / f"{table}.csv").read_text("utf-8").splitlines()) > lines
    assert (tmp_path / f"{table}.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert main(["accuracy", "--seconds", "0"]) == 2
    assert "--seconds = 0.0 s: give a finite number, more than 0" in capsys.readouterr().err
