"""`chain.wasm` against the kernels: waves, gradients, motion, ground, free-standing dominoes."""

import numpy as np
import pytest
from golden_layouts import equal_layouts, odd_layouts, usual_layouts
from uneven_layouts import POINTS, uneven_layout

import domino_env as de
from domino_env.physics.motion import Motion, _contacts, stack_leans
from domino_env.rigid.simulation import simulate_standing
from optimize.studio.wasm.build import MODULE, stamp_section

pytest.importorskip("wasmtime", reason="needs wasmtime")
from chain_module import chain, table


def layouts():
    """Return 500 pairs of layout and physics, of all kinds."""
    rng = np.random.default_rng(60)
    blocks = [
        *(odd_layouts(rng, 10, None if k % 2 else 0.0) for k in range(12)),
        *(usual_layouts(rng, 10, (0.25, 0.0, 0.6, 0.1)[k % 4]) for k in range(12)),
        *(equal_layouts(rng, 10, (0.25, 0.0, 0.6, 0.1)[k % 4]) for k in range(8)),
    ]
    pairs = [(layout, physics) for _, physics, block in blocks for layout in block]
    for seed in range(180):
        physics = de.Physics(friction=rng.choice([0.0, 0.2, 0.5]), push=rng.uniform(2.0, 16.0))
        pairs.append((uneven_layout(seed, int(rng.integers(2, 30)), seed % 3 == 0), physics))
    return pairs


def test_the_module_is_made_from_the_kernels_of_this_version():
    assert MODULE.read_bytes().endswith(stamp_section()), "chain.wasm is old: run make wasm"


def test_waves_and_gradients_equal_those_of_python():
    outcomes = []
    for layout, physics in layouts():
        wave = de.simulate(layout, physics, gradient=True)
        summary, arrivals, _ = chain().simulate(layout, physics)
        outcomes.append(wave.outcome)
        assert summary.outcome == wave.outcome
        assert (summary.hit, summary.toppled) == (wave.hit, wave.toppled)
        assert (summary.flushes, summary.releases) == (wave.flushes, wave.releases)
        for name in ("time", "release", "impact"):
            np.testing.assert_allclose(arrivals[name], wave.arrivals[name], rtol=1e-12)
        np.testing.assert_allclose(arrivals["margin"], wave.stall_margin, rtol=1e-9, atol=1e-12)
        bar = np.where(np.isfinite(wave.arrival_times), np.linspace(0.5, 1.0, layout.count), 0.0)
        expected = wave.pullback(bar)
        bars, by_physics = chain().gradient(layout, physics, bar)
        names = "spacing", "thickness", "height", "density", "rise", "tilt"
        for row, name in zip(bars, names, strict=True):
            values = getattr(expected, name)
            if values is not None and len(values):
                size = np.abs(values).max()
                np.testing.assert_allclose(row[: len(values)], values, rtol=1e-9, atol=1e-9 * size)
        known = expected.friction, expected.gravity, expected.push
        np.testing.assert_allclose(by_physics, known, rtol=1e-9, atol=1e-12)
    assert len(outcomes) == 500
    assert len(set(outcomes)) >= 4


@pytest.mark.parametrize("seed", [0, 3])
def test_motion_equals_that_of_python(seed):
    """Samples of the leader, and the leans that follow from one."""
    layout = uneven_layout(seed, 12, True) if seed else de.Layout.uniform(12, pitch=0.02)
    physics = de.Physics(push=14.0)
    motion = Motion(layout, physics)
    samples = chain().motion(layout, physics)
    for name in ("angle", "time", "speed"):
        np.testing.assert_allclose(samples[name], motion.samples[name], rtol=1e-12, atol=1e-14)
    leans = layout.tilt.copy()
    chain().call("lean", layout.count, _contacts(layout), 9, 0.3, leans)
    expected = stack_leans(layout, np.array([9]), np.array([0.3]))[0]
    np.testing.assert_allclose(leans, expected, rtol=1e-12)


def test_places_on_curved_ground_and_their_reverse_mode_equal_those_of_python():
    rng = np.random.default_rng(1)
    ground, gaps, thick = de.Ground(profile=POINTS), rng.uniform(0.01, 0.02, 20), np.full(21, 0.007)
    layout = ground.layout(gaps, thick)
    flat = de.Layout(gaps, thick)
    curve, rows = np.concatenate([part.ravel() for part in ground.curve]), table(flat)
    chain().call("place", 21, rows, len(POINTS), curve)
    np.testing.assert_allclose(rows[4, :-1], layout.rise, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(rows[5], layout.tilt, rtol=1e-12, atol=1e-15)
    wave = de.simulate(layout, de.Physics(push=12.0), gradient=True)
    gradient = wave.pullback(np.where(np.isfinite(wave.arrival_times), 1.0, 0.0))
    bars = table(flat)
    for row, name in zip(bars, ("spacing", "thickness", "", "", "rise", "tilt"), strict=True):
        values = getattr(gradient, name, ())
        row[: len(values)] = values
    chain().call("place_back", 21, table(layout), len(POINTS), curve, bars)
    expected = ground.along_ground(gradient, layout)
    np.testing.assert_allclose(bars[0, :-1], expected.spacing, rtol=1e-9)
    np.testing.assert_allclose(bars[1], expected.thickness, rtol=1e-9)


@pytest.mark.parametrize("floor", [0.4, None])
def test_free_standing_dominoes_are_those_of_python(floor, monkeypatch):
    layout, physics = uneven_layout(3, 6), de.Physics(push=14.0)
    known = simulate_standing(layout, physics, floor, rtol=0.1)

    def advance(bodies, setting, state, record, _):
        pairs = (bodies.pivots, bodies.slope, bodies.edge)
        pivots, slope, edge = (array.T for array in pairs)
        sizes = bodies.height, bodies.thickness, bodies.mass, bodies.inertia
        rows = np.array([*sizes, *pivots, bodies.tilt, *slope, *edge])
        results = np.zeros((5, layout.count))
        results[0, 1:] = np.inf
        status = chain().call(
            "standing", layout.count, rows, np.array(setting), physics.push, results
        )
        for values, row in zip(record, results, strict=True):
            values[:] = row[: len(values)]
        return status

    monkeypatch.setattr("domino_env.rigid.dynamics.advance", advance)
    wave = simulate_standing(layout, physics, floor, rtol=0.1)
    np.testing.assert_allclose(wave.arrival_times, known.arrival_times, rtol=1e-12)
    np.testing.assert_allclose(wave.lean, known.lean, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(wave.topples, known.topples)
