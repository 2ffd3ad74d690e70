"""Energy balances of waves."""

import numpy as np
import pytest
from uneven_layouts import uneven_layout

import domino_env as de
from domino_env.view.energy import energies


@pytest.mark.parametrize(("layout", "push"), [
    (de.Layout(np.random.default_rng(3).uniform(0.003, 0.03, 39), 0.008), 10.0),
    (uneven_layout(3, 12), 14.0),
], ids=["flat", "hills"])  # fmt: skip
def test_energies_balance_and_small_friction_takes_little_energy(layout, push):
    smooth, hardly, rough = (
        energies(de.Motion(layout, de.Physics(friction=mu, push=push))) for mu in (0.0, 1e-3, 0.25)
    )
    for one in (smooth, hardly, rough):
        spent = one.kinetic + one.hits + one.flushes + one.friction
        np.testing.assert_allclose(one.pushed + one.released, spent, rtol=1e-12)
    if not layout.rise.any():  # the first hit of equal dominoes takes half the energy
        at = int(np.argmax(smooth.hits > 0.0))
        assert smooth.hits[at] == pytest.approx(smooth.kinetic[at - 1] / 2.0, rel=1e-3)
    given = smooth.released[-1]
    assert smooth.flushes[-1] > 0.02 * given  # face impacts take energy from this wave
    # with friction, this loss comes from the recorded face impacts instead
    assert hardly.flushes[-1] == pytest.approx(smooth.flushes[-1], rel=0.02)
    assert hardly.hits[-1] == pytest.approx(smooth.hits[-1], rel=0.005)
    assert 0.0 < hardly.friction[-1] < 0.01 * given < rough.friction[-1]
    assert np.diff(rough.friction).min() > -1e-4 * given
