"""Rigid bodies: laws of mechanics, the analytic model where it holds, honest errors."""

import math

import numpy as np
import pytest

import domino_env as de
from domino_env.rigid import simulation

PHYSICS = de.Physics(friction=0.25, push=8.0)


def random_row(seed: int, count: int = 16) -> de.Layout:
    """A row whose feet slip and whose contacts open, on most floors."""
    rng = np.random.default_rng(seed)
    return de.Layout(rng.uniform(0.004, 0.03, count - 1), rng.uniform(0.005, 0.01, count))


def test_fixed_pivots_meet_the_analytic_model() -> None:
    layout = de.Layout.uniform(25, pitch=0.02)
    wave = de.simulate(layout, PHYSICS)
    row = de.simulate_standing(layout, PHYSICS, None, rtol=3e-4)
    error = np.abs(row.arrival_times[1:] / wave.arrival_times[1:] - 1.0).max()
    assert error < row.error_estimate <= 3e-4
    assert row.converged
    assert row.toppled == 25
    assert row.mean_speed == pytest.approx(wave.mean_speed, rel=3e-4)
    assert row.slid.max() == 0.0


HILL_TILT = 0.08 * np.sin(np.linspace(0.0, 6.0, 14))
HILL_GAPS = np.linspace(0.02, 0.01, 13)
UNEVEN = {
    "uphill": de.Layout.uniform(12, spacing=0.015, slope=math.radians(-8.0)),
    "downhill": de.Layout.uniform(12, spacing=0.015, slope=math.radians(8.0)),
    "thick, downhill": de.Layout.uniform(
        12, spacing=0.015, thickness=0.012, slope=math.radians(12.0)
    ),
    "over a hill": de.Layout(
        HILL_GAPS, 0.0075, tilt=HILL_TILT,
        rise=-(HILL_GAPS + 0.0075) * np.sin(0.5 * (HILL_TILT[1:] + HILL_TILT[:-1])),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", UNEVEN)
def test_fixed_pivots_on_uneven_ground_meet_the_analytic_model(name: str) -> None:
    wave = de.simulate(UNEVEN[name], PHYSICS)
    rigid = de.simulate_standing(UNEVEN[name], PHYSICS, None)
    assert np.allclose(rigid.arrival_times, wave.arrival_times, rtol=1e-3)
    assert rigid.toppled == wave.toppled


def test_a_row_on_a_slope_is_one_under_turned_gravity() -> None:
    """Without friction below, the first domino's foot goes downhill with g sin of the slope."""
    slope, times = 0.1, np.linspace(0.0, 0.02, 5)
    layout = de.Layout.uniform(2, spacing=0.03, slope=slope)
    row = de.simulate_standing(layout, PHYSICS, 0.0, times=times)
    x, y, lean = np.moveaxis(row.poses[:, 0], -1, 0)
    centre = x - 0.00375 * np.cos(lean) + 0.024 * np.sin(lean)
    height = y + 0.00375 * np.sin(lean) + 0.024 * np.cos(lean)
    along = centre * math.cos(slope) - height * math.sin(slope)
    way = 8.0 * 0.024 * times + 0.5 * 9.81 * math.sin(slope) * times**2
    assert row.arrival_times[1] > times[-1]
    assert np.allclose(along - along[0], way, atol=2e-6)


# last hits in Chipmunk 7.3, 1 500 sweeps, steps of 80 and 40 µs extrapolated; sure to 0.15 %
@pytest.mark.parametrize(("floor", "last"), [(None, 1.2420804), (1.0, 1.2422501), (0.3, 1.2416406)])
def test_a_free_standing_layout_meets_another_engine(floor: float | None, last: float) -> None:
    layout = de.Layout.uniform(40, spacing=0.018076685065514644)
    row = de.simulate_standing(layout, PHYSICS, floor)
    assert row.arrival_times[-1] == pytest.approx(last, rel=1.5e-3)
    assert row.propagated


def test_a_domino_on_a_fixed_pivot_falls_as_a_pendulum() -> None:
    layout = de.Layout([0.03], [0.0075, 0.0075])
    angle = math.asin(0.03 / 0.048)
    half = 0.5 * math.hypot(0.048, 0.0075)
    start = math.atan2(0.0075, 0.048)
    rise = half * (1.0 - math.cos(start))  # the centre climbs before it falls
    drop = half * (math.cos(start) - math.cos(angle - start))
    assert rise > 0.0
    inertia = (0.048**2 + 0.0075**2) / 3.0  # a unit of mass
    speed = math.sqrt(8.0**2 + 2.0 * 9.81 * drop / inertia)
    row = de.simulate_standing(layout, PHYSICS, None, rtol=1e-4)
    hit = row.arrival_times[1]
    before = de.simulate_standing(layout, PHYSICS, None, rtol=1e-4, times=[hit - 1e-5, hit])
    assert before.poses[1, 0, 2] == pytest.approx(angle, rel=1e-3)
    assert np.diff(before.poses[:, 0, 2])[0] / 1e-5 == pytest.approx(speed, rel=1e-3)


def test_a_smooth_floor_lets_the_centre_go_straight_on() -> None:
    layout = de.Layout([0.03], [0.0075, 0.0075])
    times = np.linspace(0.0, 0.025, 6)
    row = de.simulate_standing(layout, PHYSICS, 0.0, times=times)
    x, lean = row.poses[:, 0, 0], row.poses[:, 0, 2]
    centre = x - 0.00375 * np.cos(lean) + 0.024 * np.sin(lean)
    assert row.arrival_times[1] > times[-1]
    assert np.allclose(np.diff(centre) / np.diff(times), 8.0 * 0.024, rtol=1e-3)


def test_lengths_times_four_take_twice_the_time() -> None:
    small = random_row(1, 8)
    large = de.Layout(4.0 * small.spacing, 4.0 * small.thickness, 4.0 * small.height)
    times = de.simulate_standing(small, PHYSICS).arrival_times
    slow = de.simulate_standing(large, de.Physics(friction=0.25, push=4.0)).arrival_times
    assert np.allclose(slow, 2.0 * times, rtol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_the_estimate_holds_against_finer_runs(seed: int) -> None:
    layout = random_row(seed)
    for floor in (None, 0.4):
        row = de.simulate_standing(layout, PHYSICS, floor)
        fine = simulation._run(layout, PHYSICS, floor, 1.0 / 16.0).arrivals
        error = np.abs(row.arrival_times[1:] / fine[1:] - 1.0).max()
        assert error <= row.error_estimate


def test_more_friction_below_holds_the_feet() -> None:
    layout = random_row(3)
    slid = [de.simulate_standing(layout, PHYSICS, floor).slid.max() for floor in (0.1, 0.4, 1.5)]
    assert slid[0] > slid[1] > slid[2]


def test_a_wave_that_dies_says_how_far_it_came() -> None:
    layout = de.Layout([0.01, 0.06, 0.01], [0.0075] * 4)
    row = de.simulate_standing(layout, PHYSICS)
    assert row.hit == 2
    assert row.mean_speed == 0.0
    assert not row.propagated
    assert "2 of 4" in repr(row)
    assert de.simulate_standing(de.Layout([], [0.0075]), PHYSICS).toppled == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"floor_friction": -0.1}, "floor_friction = -0.1"),
        ({"floor_friction": math.nan}, "floor_friction = nan"),
        ({"rtol": 0.0}, "rtol = 0.0"),
        ({"times": [0.2, 0.1]}, "in their order"),
    ],
)
def test_what_makes_no_sense_is_refused(arguments: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        de.simulate_standing(random_row(0, 3), PHYSICS, **arguments)  # type: ignore[arg-type]


def test_a_tight_row_remembers_more_of_its_stack() -> None:
    # 24 dominoes behind the leader were all that moved: this row came 0.36 % late
    row = de.Layout([0.026, 0.015, 0.012, 0.009, 0.007, *[0.004] * 64], 0.0075)
    exact = de.simulate(row, PHYSICS)
    assert exact.hit == 70
    seen = de.simulate_standing(row, PHYSICS, None).arrival_times
    assert seen[-1] == pytest.approx(exact.arrival_times[-1], rel=1e-3)
