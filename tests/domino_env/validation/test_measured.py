"""Measured chains and the model: sources, fits, predictions, reasons, the command."""

import math
import re
from pathlib import Path

import msgspec
import numpy as np
import pytest

import domino_env as de
from domino_env.validation import measured
from domino_env.validation.measured_page import (
    CHAINS,
    READINGS,
    chain_table,
    markdown,
    reading_table,
)
from domino_env.validation.source import MeasuredChain, Source, read_source, shipped_sources

ROOT = Path(__file__).resolve().parents[3]
SOURCES = shipped_sources()


def synthetic(source: Source, friction: float, factor: float = 1.0) -> Source:
    """Return a source with the values of the model."""
    chains = []
    for chain in source.chains:
        value = factor * measured.model_value(source.quantity, source.setting, chain.x, friction)
        chains.append(MeasuredChain(chain.x, value, chain.uncertainty, chain.floor))
    return msgspec.structs.replace(source, chains=tuple(chains))


@pytest.mark.parametrize("name", SOURCES)
def test_a_source_is_complete_and_the_friction_of_synthetic_chains_is_recovered(name):
    source = SOURCES[name]
    assert re.search(r"https?://|\d{4}|University", source.reference)
    assert source.unknown
    for chain in source.chains:  # no measurement is better than a tenth of a per cent
        assert 1e-3 < chain.uncertainty / chain.value < 0.5
        assert 0.3 < source.setting.speed(source.quantity, chain.x, chain.value) < 2.0
    comparison = measured.compare(synthetic(source, 0.13), source.setting)
    assert comparison.friction == pytest.approx(0.13, abs=1e-5)
    assert comparison.holds
    assert comparison.chi_square < 1e-6
    values = [chain.value for chain in comparison.chains]
    np.testing.assert_allclose(comparison.predicted, values, rtol=1e-4)


def test_friction_is_found_from_frequencies():
    pitches, hits = (0.016, 0.024, 0.032), (64.4, 42.3, 28.1)
    fitted = de.fit_friction(pitches, hits, gravity=9.8)
    assert fitted.friction == pytest.approx(0.178, abs=1e-3)
    assert fitted.uncertainty == pytest.approx(0.016, abs=1e-3)
    for pitch, value in zip(pitches, fitted.model, strict=True):
        wave = de.steady_wave(pitch, 0.0075, physics=de.Physics(fitted.friction, 9.8))
        assert wave.frequency == pytest.approx(value, rel=1e-5)


def test_fits_weigh_values_by_their_uncertainty():
    def model(friction: float) -> np.ndarray:
        return friction * np.array([1.0, 2.0])

    values, sigmas = np.array([0.3, 0.8]), np.array([0.1, 0.4])
    best, error = measured.fit(model, values, sigmas)
    assert best == pytest.approx((0.3 / 0.01 + 2 * 0.8 / 0.16) / (1 / 0.01 + 4 / 0.16), abs=1e-6)
    assert error == pytest.approx(1.0 / math.sqrt(1 / 0.01 + 4 / 0.16), rel=1e-6)
    assert measured.fit(model, values, sigmas, sigmas > 0.1)[0] == pytest.approx(0.4, abs=1e-5)
    assert measured.fit(model, -values, sigmas)[0] == 0.0
    assert measured.fit(lambda f: np.array([math.inf]), values[:1], sigmas[:1])[1] == math.inf


def test_the_uncertainty_of_a_spacing_counts():
    source = SOURCES["chapman"]
    comparison = measured.compare(source, source.setting)
    physics = de.Physics(comparison.friction, 9.8)
    low, high = (de.steady_wave(p, 0.0075, physics=physics).frequency for p in (0.0158, 0.0162))
    assert comparison.sigmas[0] == pytest.approx(math.hypot(1.3, (high - low) / 2), rel=1e-2)


def test_the_reasons_name_the_evidence():
    toronto, chapman = SOURCES["toronto"], SOURCES["chapman"]
    right = measured.validate(synthetic(toronto, 0.2), {})
    assert (right.explained, right.reasons) == (True, ())
    fast = measured.validate(synthetic(toronto, 0.0, 1.2), {})
    assert (fast.explained, fast.main.friction) == (False, 0.0)
    assert "faster-than-frictionless" in fast.reasons
    slow = measured.validate(toronto, {"half as fast": lambda *_: 0.5, "none": lambda *_: 1.0})
    assert "friction-falls-with-gap" in slow.reasons
    assert "helped-by: none" not in slow.reasons
    source = msgspec.structs.replace(synthetic(chapman, 0.6), friction=chapman.friction)
    rough = measured.validate(source, {})
    assert (rough.explained, rough.reasons) == (False, ("friction-disagrees",))
    # where a source takes its spacings as exact, the reason names an uncertainty that explains it
    setting = msgspec.structs.replace(chapman.setting, x_uncertainty=0.0)
    exact = measured.validate(msgspec.structs.replace(chapman, setting=setting), {})
    code = "explained-in-another-reading: spacings uncertain by 0.2 mm"
    assert (exact.explained, exact.reasons) == (False, (code,))
    # McLachlan's abscissa is the gap rather than the pitch
    mclachlan = measured.validate(SOURCES["mclachlan"], {})
    (pitch,) = (r for r in mclachlan.readings if r.setting.x_is == "pitch")
    assert mclachlan.main.setting.x_is == "gap"
    assert mclachlan.main.chi_square < pitch.chi_square


def test_effects_have_the_simulated_size():
    setting = SOURCES["toronto"].setting
    assert measured.uneven_gap_factor(0.0, setting, 0.02, 0.2) == pytest.approx(1.0, abs=1e-9)
    narrow = [measured.uneven_gap_factor(d, setting, 0.015, 0.2) for d in (0.005, 0.02)]
    assert 1.0 > narrow[0] > narrow[1] > 0.9
    assert narrow[1] < measured.uneven_gap_factor(0.02, setting, 0.03, 0.2) < 1.001
    setting = SOURCES["camera"].setting
    assert measured.floor_factor(1.0, setting, 0.024, 0.2) == pytest.approx(1.0, abs=5e-3)
    assert measured.floor_factor(0.3, setting, 0.017, 0.05) > 1.02
    assert measured.floor_factor(1.0, setting, 0.0508, 0.05) < 0.9


def test_the_page_shows_the_results_of_the_command():
    text = (ROOT / "docs" / "measured-sources.md").read_text("utf-8")
    validations = [measured.validate(SOURCES["walker"])]
    lines = markdown(validations)
    assert "\n".join(lines[lines.index("## walker") :]) in text
    for name, table in ((CHAINS, chain_table), (READINGS, reading_table)):
        head, *rows = table(validations).splitlines()
        stored = (ROOT / "docs" / name).read_text("utf-8").splitlines()
        assert stored[0] == head
        assert set(rows) <= set(stored)
    assert all(f"## {name}\n\n**{source.title}.**" in text for name, source in SOURCES.items())


def test_the_command_compares_sources_and_given_frequencies(tmp_path, output_of, error_of):
    words = "validate", "walker", "8=90", "--thickness", 3, "--out", tmp_path
    assert "2 of 2 sources explained" in output_of(*words)
    typed = output_of("validate", "16=64.4", "24=42.3", "32=28.1")
    shipped = output_of("validate", "chapman")
    assert all("spacings known to 0.2 mm, explained" in text for text in (typed, shipped))
    assert (tmp_path / "measured.png").read_bytes()[:4] == b"\x89PNG"

    own = tmp_path / "own.toml"
    text = (ROOT / "domino_env/validation/sources/chapman.toml").read_text("utf-8")
    own.write_text(text.replace("height = 0.048", "heihgt = 0.048"), "utf-8")
    assert "own.toml: unknown key 'setting.heihgt'" in error_of("validate", own)
    own.write_text(text, "utf-8")
    assert msgspec.structs.replace(read_source(own), name="chapman") == SOURCES["chapman"]
