"""Friction from frequencies."""

import numpy as np
import pytest

import domino_env as de
from domino_env.validation.fit import fit_friction


def test_friction_is_found_again() -> None:
    pitches = (0.016, 0.024, 0.032)
    told = [de.steady_wave(p, 0.0075, physics=de.Physics(0.31)).frequency for p in pitches]
    found = fit_friction(pitches, told)
    assert found.friction == pytest.approx(0.31, abs=1e-5)
    assert found.uncertainty < 1e-4
    np.testing.assert_allclose(found.single, 0.31, atol=1e-5)


def test_the_articles_table_asks_for_less_friction_than_it_names() -> None:
    pitches, measured = (0.016, 0.024, 0.032), (64.4, 42.3, 28.1)
    found = fit_friction(pitches, measured, gravity=9.8)
    assert 0.1 < found.friction < 0.25
    for pitch, told, alone in zip(pitches, measured, found.single, strict=True):
        wave = de.steady_wave(pitch, 0.0075, physics=de.Physics(alone, 9.8))
        assert wave.frequency == pytest.approx(told, rel=1e-5)


def test_what_cannot_be_explained_is_nan_and_bad_rows_are_refused() -> None:
    assert np.isnan(fit_friction((0.016,), (500.0,)).single[0])
    with pytest.raises(ValueError, match="must be between"):
        fit_friction((0.005,), (60.0,))
    with pytest.raises(ValueError, match="positive"):
        fit_friction((0.016,), (0.0,))
    with pytest.raises(ValueError, match="give pairs"):
        fit_friction((0.016,), ())
