"""Accuracy: error estimates against true errors, run times against errors."""

import math

import numpy as np
import pytest
from golden_layouts import batched, equal_layouts, odd_layouts, usual_layouts
from uneven_layouts import uneven_layout

import domino_env as de
from domino_env.validation import accuracy
from domino_env.validation.edge_cases import EdgeCase


def random_layouts():
    """Yield random layouts of many kinds."""
    rng = np.random.default_rng(11)
    for k in range(40):
        friction = (0.0, 0.25, 0.6, 1.0)[k % 4]
        yield odd_layouts(rng, 25, friction)
        yield usual_layouts(rng, 25, friction)
        yield equal_layouts(rng, 25, friction)
        uneven = [uneven_layout(25 * k + seed, 20, True) for seed in range(25)]
        yield "uneven ground", de.Physics(friction, push=14.0), uneven


def test_estimates_and_tolerances_hold_for_random_layouts():
    ratios, small = [], 0
    for name, physics, layouts in random_layouts():
        exact = batched(layouts, physics, 1e-13)
        struck = np.isfinite(exact.arrival_times) & (exact.arrival_times > 0.0)
        slack = exact.error_estimate
        for rtol in (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
            waves = batched(layouts, physics, rtol)
            assert not np.isnan([*waves.arrival_times.T, waves.error_estimate]).any()
            margin = np.minimum(waves.lowest_stall_margin, exact.lowest_stall_margin)
            same = (waves.outcome == exact.outcome) & (waves.hit == exact.hit)
            assert np.all(same | (margin < 1e-9)), name
            with np.errstate(invalid="ignore"):
                errors = np.abs(waves.arrival_times / exact.arrival_times - 1.0)
            error = np.max(errors, axis=1, initial=0.0, where=struck)
            assert not np.any(same & waves.converged & (error > rtol + slack)), (name, rtol)
            small += int(np.sum(same & (error > waves.error_estimate + slack)))
            ratios.extend(waves.error_estimate[same] / np.maximum(error[same], 1e-16))
    assert small <= len(ratios) // 1000
    assert np.median(ratios) < 100.0


SIX = EdgeCase("short", "six", de.Layout.uniform(6, pitch=0.016), de.Physics())


def test_every_solver_is_measured_and_finer_settings_reduce_its_error():
    runs = list(accuracy.measure([SIX], seconds=0.05, quick=True))
    assert {m.solver for m in runs} == set(accuracy.SOLVERS)
    for solver in accuracy.SOLVERS:
        of_solver = [m for m in runs if m.solver == solver]
        assert all(math.isfinite(m.error) and m.seconds > 0.0 for m in of_solver)
        assert len(of_solver) == 1 or of_solver[-1].error < of_solver[0].error
        assert all(m.error <= m.estimate for m in of_solver if solver == accuracy.SIMULATE)
    # finer settings that exceed the time are left out
    assert len(list(accuracy.measure([SIX], seconds=1e-9))) == len(accuracy.SOLVERS)


@pytest.mark.parametrize(("options", "summary", "table", "lines"), [
    ("--seconds 0.02", "classic: run time [s] to reach an error", "accuracy", 20),
    ("--stability", "edge cases: none with a fault", "stability", 200),
])  # fmt: skip
def test_the_command_writes_a_table_and_a_figure(
    options, summary, table, lines, tmp_path, output_of
):
    assert summary in output_of("accuracy", *options.split(), "--quick", "--out", tmp_path)
    assert len((tmp_path / f"{table}.csv").read_text("utf-8").splitlines()) > lines
    assert (tmp_path / f"{table}.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
