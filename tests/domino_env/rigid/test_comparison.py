"""The model against an independent rigid-body engine."""

import dataclasses
import json

import numpy as np
import pytest

import domino_env as de
from domino_env.rigid.comparison import (
    Verification,
    document,
    extrapolated,
    table,
    verify,
    write_verification,
)

pytest.importorskip("pymunk")
STEPS = (1e-4, 5e-5)


@pytest.fixture(scope="module")
def checked() -> Verification:
    return verify(de.Layout.uniform(14, pitch=0.024), de.Physics(push=5 * np.pi), STEPS)


def test_uniform_row_agrees_to_a_thousandth(checked: Verification) -> None:
    assert abs(checked.difference) < 1e-3
    assert checked.verdict.startswith("AGREES")


def test_random_rows_agree_to_a_thousandth() -> None:
    rng = np.random.default_rng(4)
    for _ in range(2):
        layout = de.Layout(rng.uniform(0.008, 0.024, 13), rng.uniform(0.005, 0.009, 14))
        assert verify(layout, de.Physics(push=10.0), STEPS).largest_difference < 1e-3


def test_free_row_stands_until_the_wave_comes_and_runs_about_as_fast(
    checked: Verification,
) -> None:
    assert abs(checked.free_difference) < 0.03
    assert not np.array_equal(checked.free, checked.hinged)


def test_wave_that_dies_dies_in_the_engine_too() -> None:
    layout = de.Layout([0.012, 0.012, 0.060, 0.012], 0.0075)
    died = verify(layout, de.Physics(push=10.0), STEPS)
    assert died.wave.hit == np.isfinite(died.limit).sum() == 3
    assert np.isnan(died.difference)
    assert document(died)["difference"] is None


def test_wrong_times_are_called_wrong(checked: Verification) -> None:
    slow = dataclasses.replace(checked, hinged=checked.hinged * 1.004)
    assert slow.verdict.startswith("DIFFERS")
    short = checked.hinged.copy()
    short[:, -1] = np.inf
    assert "13 in the engine" in dataclasses.replace(checked, hinged=short).verdict


def test_last_domino_that_barely_stands_or_falls_is_told_apart() -> None:
    physics = de.Physics(push=10.0)
    row = de.Layout([0.012, 0.012, 0.004], [0.0075, 0.0075, 0.0075, 0.03])
    heavy = verify(row, physics, STEPS)
    assert heavy.wave.hit == 4
    assert heavy.toppled == (heavy.wave.toppled == 4)
    other = dataclasses.replace(heavy, toppled=not heavy.toppled)
    assert "the last domino topples in the" in other.verdict
    assert other.verdict.startswith("DIFFERS")


def test_extrapolation_is_exact_for_errors_of_first_order() -> None:
    steps, limit = np.array([4e-5, 2e-5, 1e-5]), np.array([0.0, 0.1, 0.3, np.inf])
    times = limit + np.outer(steps, [0.0, 3.0, 7.0, 1.0])
    np.testing.assert_allclose(extrapolated(steps, times), limit, rtol=1e-13)


def test_table_and_file_say_the_same(checked: Verification, tmp_path) -> None:
    write_verification(checked, tmp_path / "verification.json")
    read = json.loads((tmp_path / "verification.json").read_text())
    assert read["verdict"] == table(checked)[-1]
    assert read["hinged"][-1] == pytest.approx(checked.limit[-1])


def test_bad_steps_are_refused() -> None:
    layout = de.Layout.uniform(3, pitch=0.024)
    with pytest.raises(ValueError, match="at least two"):
        verify(layout, de.Physics(), [1e-5, 1e-5])
    with pytest.raises(ValueError, match=r"above 0 and up to 0\.001"):
        verify(layout, de.Physics(), [1e-2, 1e-5])
    with pytest.raises(ValueError, match="no wave"):
        verify(de.Layout([], [0.0075]), de.Physics())
