"""`chain.wasm` against the kernels: waves and gradients; `test_kernels.py` has the rest."""

import numpy as np
import pytest
from golden_layouts import equal_layouts, odd_layouts, usual_layouts
from uneven_layouts import uneven_layout

import domino_env as de
from optimize.studio.wasm.build import MODULE, stamp_section

pytest.importorskip("wasmtime", reason="needs wasmtime")
from chain_module import chain


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
