"""Rigid bodies: laws of mechanics, the analytic model where it holds, error estimates."""

import json
import math
import signal
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.rigid import simulation

PHYSICS = de.Physics(friction=0.25, push=8.0)


def random_layout(seed: int, count: int = 16) -> de.Layout:
    """Draw a layout whose feet slip and whose contacts open, on most floors."""
    rng = np.random.default_rng(seed)
    return de.Layout(rng.uniform(0.004, 0.03, count - 1), rng.uniform(0.005, 0.01, count))


TILT, GAPS = 0.08 * np.sin(np.linspace(0.0, 6.0, 14)), np.linspace(0.02, 0.01, 13)
RISE = -(GAPS + 0.0075) * np.sin(0.5 * (TILT[1:] + TILT[:-1]))
LAYOUTS = {
    "uniform": (de.Layout.uniform(25, pitch=0.02), 3e-4),
    "thick, downhill": (
        de.Layout.uniform(12, spacing=0.015, thickness=0.012, slope=math.radians(12.0)), 1e-3
    ),
    "uphill": (de.Layout.uniform(12, spacing=0.015, slope=math.radians(-8.0)), 1e-3),
    "over a hill": (de.Layout(GAPS, 0.0075, tilt=TILT, rise=RISE), 1e-3),
    # more than 24 dominoes behind the leader move
    "tight": (de.Layout([0.026, 0.015, 0.012, 0.009, 0.007, *[0.004] * 64], 0.0075), 1e-3),
}  # fmt: skip


@pytest.mark.parametrize("name", LAYOUTS)
def test_fixed_pivots_agree_with_the_analytic_model(name):
    layout, rtol = LAYOUTS[name]
    wave = de.simulate(layout, PHYSICS)
    rigid = de.simulate_standing(layout, PHYSICS, None, rtol=rtol)
    assert rigid.converged
    assert rigid.error_estimate <= rtol
    np.testing.assert_allclose(rigid.arrival_times, wave.arrival_times, rtol=rigid.error_estimate)
    assert (rigid.hit, rigid.toppled) == (wave.hit, wave.toppled)
    assert rigid.mean_speed == pytest.approx(wave.mean_speed, rel=rtol)
    assert rigid.slid.max() == 0.0


@pytest.mark.parametrize("slope", [0.0, 0.1])
def test_a_domino_on_a_frictionless_floor_conserves_energy(slope):
    """Gravity along the ground moves the centre, gravity across it turns the domino."""
    layout = de.Layout.uniform(2, spacing=0.03, slope=slope)
    along, across = 9.81 * np.array([math.sin(slope), math.cos(slope)])
    half = np.array([0.00375, 0.024])
    lean = np.linspace(0.0, 1.2, 4001)
    height = half @ [np.sin(lean), np.cos(lean)]
    lever = half @ [np.cos(lean), -np.sin(lean)]
    inertia = half @ half / 3.0 + lever**2
    speed = np.sqrt((inertia[0] * 64.0 - 2.0 * across * (height - height[0])) / inertia)
    times = np.append(0.0, np.cumsum(0.5 * np.diff(lean) * (1.0 / speed[1:] + 1.0 / speed[:-1])))
    # the tip is half a thickness and half a height from the centre
    tip = 8.0 * half[1] * times + 0.5 * along * times**2 + half @ [np.cos(lean) - 1.0, np.sin(lean)]
    rigid = de.simulate_standing(layout, PHYSICS, 0.0, 1e-4)
    assert rigid.arrival_times[1] == pytest.approx(np.interp(0.03, tip, times), rel=1e-4)


# relative differences from the last hits of a code with the same contact law and of Chipmunk
@pytest.mark.parametrize(
    ("place", "same", "engine"), [(0, 5e-4, 3e-3), (1, 5e-4, 5e-3), (2, 5e-3, 4e-3)]
)
def test_an_edge_above_a_tip_does_not_touch_the_front_face(place, same, engine):
    """Once a tip had slipped under the next domino, a false impact took place before hit 23."""
    data = json.loads((Path(__file__).parents[2] / "data" / "disputed_layout.json").read_text())
    layout, run = de.Layout(data["spacing"], data["thickness"]), data["runs"][place]
    last = de.simulate_standing(layout, PHYSICS, run["floor_friction"], 5e-3).arrival_times[-1]
    assert last == pytest.approx(run["other_nonsmooth"][-1], rel=same)
    assert last == pytest.approx(run["engine"][-1], rel=engine)


def test_four_times_the_lengths_take_twice_the_time():
    small = random_layout(1, 8)
    large = de.Layout(4.0 * small.spacing, 4.0 * small.thickness, 4.0 * small.height)
    times = de.simulate_standing(small, PHYSICS).arrival_times
    slow = de.simulate_standing(large, de.Physics(friction=0.25, push=4.0)).arrival_times
    np.testing.assert_allclose(slow, 2.0 * times, rtol=1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("floor", [None, 0.4])
def test_the_error_estimate_covers_the_difference_from_finer_runs(seed, floor):
    layout = random_layout(seed)
    rigid = de.simulate_standing(layout, PHYSICS, floor)
    fine = simulation._run(layout, PHYSICS, floor, 1.0 / 16.0)[0].arrival_times
    np.testing.assert_allclose(rigid.arrival_times, fine, rtol=rigid.error_estimate)


def test_feet_slip_less_on_rougher_floors():
    layout = random_layout(3)
    slid = [de.simulate_standing(layout, PHYSICS, floor).slid.max() for floor in (0.1, 0.4, 1.5)]
    assert slid[0] > slid[1] > slid[2]


def test_a_wave_that_stops_has_no_speed():
    rigid = de.simulate_standing(de.Layout([0.01, 0.06, 0.01], 0.0075), PHYSICS)
    assert (rigid.hit, rigid.mean_speed, rigid.propagated) == (2, 0.0, False)
    assert "2 of 4" in repr(rigid)
    assert de.simulate_standing(de.Layout([], [0.0075]), PHYSICS).toppled == 1
    weak = de.simulate_standing(LAYOUTS["uniform"][0], de.Physics(push=1e-6))  # took 21 s once
    assert (weak.hit, weak.toppled, weak.converged) == (1, 0, True)


def test_a_long_simulation_can_be_interrupted():
    layout, calls = de.Layout.uniform(20_000, spacing=0.012), iter([False, False, True])
    with pytest.raises(simulation.StoppedError):
        de.simulate_standing(layout, PHYSICS, stop=lambda: next(calls))
    with pytest.raises(KeyboardInterrupt):
        de.simulate_standing(layout, PHYSICS, stop=lambda: signal.raise_signal(signal.SIGINT))
