"""Measured chains beside the model: sources, fits, predictions, reasons, the command."""

import json
import math
import re
from pathlib import Path

import msgspec
import numpy as np
import pytest

import domino_env as de
from domino_env.cli.main import main
from domino_env.validation.measured import (
    compare,
    least_squares,
    leave_out,
    row_model,
    slipping,
    speed_of,
    uneven,
    validate,
)
from domino_env.validation.measured_page import markdown
from domino_env.validation.source import Row, Source, read_source, shipped_sources

ROOT = Path(__file__).resolve().parents[3]
SOURCES = shipped_sources()


def synthetic(source: Source, friction: float, factor: float = 1.0) -> Source:
    """A source with what the model would have measured."""
    rows = []
    for row in source.rows:
        value = factor * row_model(source.setting, source.quantity, row.x)(friction)
        rows.append(Row(row.x, value, row.uncertainty, row.floor))
    return msgspec.structs.replace(source, rows=tuple(rows))


@pytest.mark.parametrize("name", SOURCES)
def test_a_source_is_complete_and_the_friction_of_synthetic_rows_is_found_again(name: str) -> None:
    source = SOURCES[name]
    assert re.search(r"https?://|\d{4}|University", source.reference)
    assert source.unknown
    for row in source.rows:  # better than a tenth of a per cent nobody measured
        assert 1e-3 < row.uncertainty / row.value < 0.5
        assert 0.3 < speed_of(source.quantity, source.setting, row.x, row.value) < 2.0
    found = compare(synthetic(source, 0.13), source.setting)
    assert found.friction == pytest.approx(0.13, abs=1e-5)
    assert found.holds
    assert found.chi_square < 1e-6
    values = [row.value for row in found.rows]
    np.testing.assert_allclose(found.predicted, values, rtol=1e-4)


def test_friction_is_found_from_frequencies() -> None:
    pitches, measured = (0.016, 0.024, 0.032), (64.4, 42.3, 28.1)
    found = de.fit_friction(pitches, measured, gravity=9.8)
    assert found.friction == pytest.approx(0.178, abs=1e-3)
    assert found.uncertainty == pytest.approx(0.016, abs=1e-3)
    for pitch, told, alone in zip(pitches, measured, found.single, strict=True):
        wave = de.steady_wave(pitch, 0.0075, physics=de.Physics(alone, 9.8))
        assert wave.frequency == pytest.approx(told, rel=1e-5)
    assert np.isnan(de.fit_friction((0.016,), (500.0,)).single[0])
    for pitches, told, said in [((0.005,), (60.0,), "more than 0"), ((0.016,), (), "give pairs")]:
        with pytest.raises(ValueError, match=said):
            de.fit_friction(pitches, told)


def test_fits_weigh_rows_by_their_uncertainty_and_predict_those_left_out() -> None:
    models = [lambda f: f, lambda f: 2.0 * f]
    best, error = least_squares(models, [0.3, 0.8], [0.1, 0.4])
    assert best == pytest.approx((0.3 / 0.01 + 2 * 0.8 / 0.16) / (1 / 0.01 + 4 / 0.16), abs=1e-6)
    assert error == pytest.approx(1.0 / math.sqrt(1 / 0.01 + 4 / 0.16), rel=1e-6)
    assert least_squares(models, [-1.0, -1.0], [0.1, 0.1])[0] == 0.0
    assert least_squares([lambda f: math.inf], [1.0], [0.1])[1] == math.inf
    # each friction follows from the other row alone
    found = leave_out([1.0, 2.0], models, [0.3, 0.8], [0.1, 0.1])
    assert found == pytest.approx((0.4, 0.6), abs=1e-5)
    assert np.isnan(leave_out([1.0, 1.0], models, [0.3, 0.8], [0.1, 0.1])).all()


def test_the_uncertainty_of_a_spacing_counts() -> None:
    source = SOURCES["chapman"]
    found = compare(source, source.setting)
    low, high = (
        de.steady_wave(p, 0.0075, physics=de.Physics(found.friction, 9.8)).frequency
        for p in (0.0158, 0.0162)
    )
    assert found.sigmas[0] == pytest.approx(math.hypot(1.3, (high - low) / 2), rel=1e-2)


def test_reasons_say_what_is_wrong() -> None:
    toronto, chapman = SOURCES["toronto"], SOURCES["chapman"]
    right = validate(synthetic(toronto, 0.2), {})
    assert (right.explained, right.reasons) == (True, ())
    fast = validate(synthetic(toronto, 0.0, 1.2), {})
    assert (fast.explained, fast.main.friction) == (False, 0.0)
    assert "faster-than-frictionless" in fast.reasons
    slow = validate(toronto, {"half as fast": lambda *_: 0.5, "none": lambda *_: 1.0})
    assert "friction-falls-with-gap" in slow.reasons
    assert "helped-by: none" not in slow.reasons
    rough = validate(
        msgspec.structs.replace(synthetic(chapman, 0.6), friction=chapman.friction), {}
    )
    assert (rough.explained, rough.reasons) == (False, ("friction-disagrees",))
    # McLachlan's abscissa is the gap rather than the pitch
    other = validate(SOURCES["mclachlan"], {})
    (pitch,) = (r for r in other.readings if r.setting.x_is == "pitch")
    assert other.main.setting.x_is == "gap"
    assert other.main.chi_square < pitch.chi_square


def test_effects_are_as_large_as_simulated_layouts_have_them() -> None:
    setting = SOURCES["toronto"].setting
    assert uneven(0.0, setting, 0.02, 0.2) == pytest.approx(1.0, abs=1e-9)
    narrow = [uneven(d, setting, 0.015, 0.2) for d in (0.005, 0.02)]
    assert 1.0 > narrow[0] > narrow[1] > 0.9
    assert narrow[1] < uneven(0.02, setting, 0.03, 0.2) < 1.001
    setting = SOURCES["camera"].setting
    assert slipping(1.0, setting, 0.024, 0.2) == pytest.approx(1.0, abs=5e-3)
    assert slipping(0.3, setting, 0.017, 0.05) > 1.02
    assert slipping(1.0, setting, 0.0508, 0.05) < 0.9


def test_the_page_shows_what_the_command_finds() -> None:
    text = (ROOT / "docs" / "measured.md").read_text("utf-8")
    lines = markdown([validate(SOURCES["walker"])])
    assert "\n".join(lines[lines.index("## walker") :]) in text
    assert all(f"## {name}\n\n**{source.title}.**" in text for name, source in SOURCES.items())


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["validate", "walker", "8=90", "--thickness", "3", "--out", str(tmp_path)]
    assert main([*words, "--json", str(tmp_path / "all.json")]) == 0
    assert "2 of 2 sources explained" in capsys.readouterr().out
    assert (tmp_path / "measured.png").read_bytes()[:4] == b"\x89PNG"
    found = json.loads((tmp_path / "all.json").read_text("utf-8"))
    assert [s["name"] for s in found["sources"]] == ["walker", "rows"]
    assert np.isfinite(found["sources"][0]["readings"][0]["friction"])

    own = tmp_path / "own.toml"
    told = (ROOT / "domino_env/validation/sources/chapman.toml").read_text("utf-8")
    own.write_text(told.replace("height = 0.048", "heihgt = 0.048"), "utf-8")
    for word, said in {
        "nobody": "give a source (camera, ", "5=60": "must be more than 0",
        "16=x": "write PITCH=FREQUENCY", str(own): "own.toml: unknown key 'setting.heihgt'",
    }.items():  # fmt: skip
        assert main(["validate", word]) == 2
        assert said in capsys.readouterr().err
    own.write_text(told, "utf-8")
    assert msgspec.structs.replace(read_source(own), name="chapman") == SOURCES["chapman"]
