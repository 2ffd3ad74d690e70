"""Unusual and damaged files: each is read, or rejected in one sentence with its name."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import domino_env as de
from domino_env.core.progress import Advice
from domino_env.scenes.io.reading import parse_scene
from domino_env.view.animation import frames
from domino_env.view.compared import ComparedLayout, read_compared
from domino_env.view.sound import clicks, read_recording
from domino_env.view.template import strips
from optimize.studio.report import write_report

CORPUS = Path(__file__).parent / "data" / "hostile"
TRICKS = [
    b"\0", b"\xff", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\n", b'"', b'"""', b",", b";", b"\t",
    b"=1+1", b"1e400", b"-1", b"nan", b"1e-320", b"true", b"[" * 20, b"#", b"\x1b[2J", b"../x",
]  # fmt: skip
# words of the message, or None for a good file
EXPECTED = {
    "layouts/deep.json": "nested too deeply",
    "layouts/empty.csv": "the file is empty",
    "layouts/escape.csv": r"'\x1b]0;owned\x07\x1b[2J' is not a number",
    "layouts/latin_1.csv": None,
    "layouts/nan.json": "spacing[0] = nan: give a finite number from 1e-09 to 1e+09",
    "layouts/negative.csv": "-18: give a number more than 0",
    "layouts/twice.csv": "two columns give the spacing",
    "layouts/utf_16_torn.csv": "not valid utf-16-le text (truncated data): save it as UTF-8",
    "scenes/formulas_in_the_title.toml": None,
    "scenes/half.toml": "not TOML",
    "scenes/huge_count.toml": "give a whole number from 2 to 100000",
    "scenes/huge_growth.toml": "8 dominoes could grow to 10^62 m",
    "scenes/infinite.toml": "physics.push = inf: give a finite number",
    "scenes/misspelt.toml": "unknown key 'spaceing': did you mean 'spacing'?",
    "scenes/path.toml": "name = '../../x': give a line of text of at most 100 characters",
    "sounds/compressed.wav": "Unknown wave file format: MPEGLAYER3",
    "sounds/constant.wav": "the recording is silent",
    "sounds/head_only.wav": "it ends early or is broken",
    "sounds/torn_frame.wav": "cut off amid a sample",
    "runs/trace_not_finite.csv": "best_score[0] = nan: give a finite number",
    "runs/trace_without_scores.csv": "best_score",
}


@st.composite
def mutated(draw, data):
    """Return valid bytes with some damage: cut, doubled, with unusual bytes."""
    for _ in range(draw(st.integers(1, 5))):
        at = draw(st.integers(0, len(data)))
        to = at + draw(st.integers(0, 30) | st.just(len(data)))
        doubled = 2 * data[at:to]
        new = draw(st.sampled_from([b"", doubled, *TRICKS]) | st.binary(max_size=4))
        data = data[:at] + new + data[to:]
    return data


def rejection(read, path):
    """Return the message with which a reader rejects a file, one line with its name, or None."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", Advice)  # of a length that is read as it stands
        try:
            read(path)
        except (ValueError, OSError) as error:
            message = str(error)
        else:
            return None
    assert message.isprintable()
    assert str(path) in message
    assert len(message) < 500 + len(str(path))
    return message


def read_layout(path):
    """Read a layout whose wave has numbers only."""
    layout = de.Layout.read(path)
    if layout.count <= 12:
        wave = de.simulate(layout, de.Physics())
        assert not np.isnan([*wave.arrival_times, wave.error_estimate]).any()
        assert np.isfinite(wave.mean_speed)
    return layout


def read_scene(path):
    """Read a scene that survives writing and reading, and whose name is safe."""
    scene = de.load_scene(path)
    assert parse_scene(scene.to_toml(), "x", str(path)) == scene
    assert scene.name not in ("", ".", "..")
    assert not set(scene.name) & set("/\\\n")
    return scene


def read_sound(path):
    samples, rate = read_recording(path)
    try:
        return de.measure(samples, rate, de.Layout.uniform(20, pitch=0.024))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def read_run(path):
    """Write the page of a run with this trace in its folder."""
    run = path.parent / f"run-{path.name}"
    run.mkdir(exist_ok=True)
    de.Layout([0.018], 0.0075).to_csv(run / "layout.csv")
    beside = run / (path.name.split("_")[0] + path.suffix)
    beside.write_bytes(path.read_bytes())
    try:
        compared = read_compared([run])
        write_report(compared, run / "report.html")
    except ValueError as error:
        raise ValueError(str(error).replace(str(beside), str(path))) from None
    return compared[0]


READERS = {
    "layouts": read_layout, "scenes": read_scene, "sounds": read_sound, "runs": read_run,
}  # fmt: skip


@pytest.mark.parametrize("name", EXPECTED)
def test_the_corpus_is_rejected_or_read(name, tmp_path):
    words, read = EXPECTED[name], READERS[name.split("/")[0]]
    path = tmp_path / Path(name).name
    path.write_bytes((CORPUS / name).read_bytes())
    message = rejection(read, path)
    assert message is None if words is None else words in message


SPRINT = Path(de.__file__).parent / "scenes" / "shipped" / "sprint.toml"
TABLE = b"number,spacing,thickness,height,density\n0,0.018,0.0075,0.048,1040\n1,,0.0075,0.05,900\n"
DOCUMENT = b'{"spacing": [0.018], "thickness": [0.0075, 0.007], "width": 0.02}'


@given(table=mutated(TABLE), document=mutated(DOCUMENT), scene=mutated(SPRINT.read_bytes()))
def test_damaged_files_are_read_or_rejected(tmp_path_factory, table, document, scene):
    folder = tmp_path_factory.getbasetemp()
    for name, data in (("any.csv", table), ("any.json", document), ("any.toml", scene)):
        (folder / name).write_bytes(data)
        rejection(read_scene if name == "any.toml" else read_layout, folder / name)


def test_the_command_line_prints_one_safe_line(tmp_path, error_of):
    path = tmp_path / "a\x1b[2J\nb.csv"
    path.write_text("spacing\n")
    assert r"a\x1b[2J\nb.csv" in error_of("simulate", path)


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    de.Layout([0.02] * 9, 0.0075).to_csv(tmp_path / "row.csv")
    monkeypatch.setattr("domino_env.core.files.LARGEST_FILE", 100)
    with pytest.raises(ValueError, match=r"row\.csv: .* bytes: give one of at most 100"):
        de.Layout.read(tmp_path / "row.csv")


LONG, FAR = de.Layout([0.02] * 5000, 0.0075), de.Layout([3e5], 1e5, height=1e6, width=0.02)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: next(frames([ComparedLayout("long", de.simulate(LONG, de.Physics()))])),
     "long: 5,001 dominoes: give at most"),
    (lambda: clicks(de.simulate(FAR, de.Physics(gravity=1e-3, push=1e-5))), "a wave of .* samples"),
    (lambda: de.measure(np.zeros(9000), 44100, LONG), "the recording is silent"),
    (lambda: strips(FAR), "a layout of .* m takes .* sheets of paper"),
    (lambda: strips(de.Layout([0.1], 0.1, height=1.0, width=0.5)), "width = 0.5 m: give at most"),
])  # fmt: skip
def test_undrawable_layouts_and_invalid_sounds_are_rejected(call, words):
    with pytest.raises(ValueError, match=words):
        call()
