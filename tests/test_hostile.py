"""Odd files, as people really send them: each works or is refused in one sentence."""

from __future__ import annotations

import dataclasses
import json
import os
import tomllib
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile import CORPUS, DEEP, NUMBERS, ODD, all_finite, entered, mutated
from hypothesis import given, settings
from hypothesis import strategies as st

import domino_env as de
from domino_env.cli.main import main
from domino_env.core.progress import Advice
from domino_env.physics.layout import Layout
from domino_env.scenes.io.reading import parse_scene
from domino_env.view.animation import Runner, frames
from domino_env.view.race import Racer
from domino_env.view.report import read_racers, write_report
from domino_env.view.sound import Heard, clicks, listen, read_wav
from domino_env.view.template import strips
from optimize.comparison.page import _about

FUZZ = settings(max_examples=int(os.environ.get("FUZZ_EXAMPLES", "60")), derandomize=True)
if "FUZZ_EXAMPLES" in os.environ:
    FUZZ = settings(FUZZ, derandomize=False)
SHIPPED = [
    (f.name, f.read_text("utf-8"))
    for f in sorted(
        (resources.files("domino_env") / "scenes" / "shipped").iterdir(), key=lambda f: f.name
    )
    if f.name.endswith(".toml")
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("hostile")


# the corpus -------------------------------------------------------------------------------------

# the words of the refusal, or None where the file is good
EXPECTED: dict[str, str | None] = {
    "layouts/deep.json": "nested too deep",
    "layouts/empty.csv": "the file is empty",
    "layouts/escape.csv": r"'\x1b]0;owned\x07\x1b[2J' is not a number",
    "layouts/formula.csv": "line 2, column 'spacing_mm': '=2+3' is not a number",
    "layouts/formula_beside.csv": None,
    "layouts/latin_1.csv": None,
    "layouts/millimetres.csv": None,
    "layouts/missing.csv": "no column for the thickness",
    "layouts/mixed_ends.csv": None,
    "layouts/nan.json": "spacing[0] = nan: give a finite number from 1e-09 to 1e+09",
    "layouts/negative.csv": "-18 must be more than 0",
    "layouts/open_quote.csv": "is not a number",
    "layouts/twice.csv": "two columns give the spacing",
    "layouts/utf_16_torn.csv": "not utf-16-le text, or not all of it: truncated data",
    "layouts/words.json": "spacing[0] = '0.01': give a finite number",
    "scenes/formulas_in_the_title.toml": None,
    "scenes/half.toml": "not TOML",
    "scenes/huge_count.toml": "give a whole number from 2 to 100000",
    "scenes/huge_draws.toml": "are 9,000,000,000: draw at most",
    "scenes/huge_growth.toml": "8 dominoes could grow to 10^62 m",
    "scenes/huge_lists.toml": "156,032,001 pairs of listed values",
    "scenes/infinite.toml": "physics.push = inf: give a finite number from 1e-09 to 1e+09",
    "scenes/misspelt.toml": "unknown key 'spaceing': did you mean 'spacing'?",
    "scenes/path.toml": "name = '../../x': give a line of text of at most 100 characters",
    "scenes/thickness_number.toml": "thickness = 0.0075: give a table of fixed, min, max",
    "scenes/utf_16.toml": "not UTF-8 text",
    "scenes/words.toml": "physics.push = 'strong': give a finite number",
    "sounds/click.wav": "of toppling to hear",
    "sounds/compressed.wav": "Unknown wave file format: MPEGLAYER3",
    "sounds/constant.wav": "nothing begins or ends in the recording",
    "sounds/empty.wav": "not a plain WAV file",
    "sounds/head_only.wav": "it ends early or is broken",
    "sounds/promises.wav": "nothing begins or ends in the recording",
    "sounds/torn_frame.wav": "cut off amid a sample",
    "runs/trace_latin_1.csv": None,
    "runs/trace_not_finite.csv": "line 2, best_score: 'nan' is no finite number",
    "runs/trace_short_row.csv": "best_score: None is no finite number",
    "runs/trace_without_scores.csv": "best_score: None is no finite number",
    "runs/verification_list.json": "this is [1]: give a table of engine, verdict",
    "runs/verification_number.json": "engine = 1: give a line of text",
    "runs/verification_script.json": None,
    "runs/verification_times.json": "model[0] = [['<script>']]: give a finite number",
}


def report_of(path: Path) -> Any:
    """A page of a run with this trace or check in its folder."""
    run = path.parent / f"run-{path.name}"
    run.mkdir(exist_ok=True)
    Layout([0.018], 0.0075).to_csv(run / "layout.csv")
    beside = run / (path.name.split("_")[0] + path.suffix)
    beside.write_bytes(path.read_bytes())
    try:
        racers, title = read_racers([run])
    except ValueError as error:
        raise ValueError(str(error).replace(str(beside), str(path))) from None
    write_report(racers, title, run / "report.html")
    return racers[0]


def heard(path: Path) -> Heard:
    """What a recording tells."""
    samples, rate = read_wav(path)
    try:
        return listen(samples, rate)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


DOORS: dict[str, Callable[[Path], Any]] = {
    "layouts": Layout.read,
    "scenes": de.load_scene,
    "sounds": heard,
    "runs": report_of,
}


@pytest.mark.parametrize("name", EXPECTED)
def test_the_corpus_is_refused_or_read(name: str, folder: Path) -> None:
    words = EXPECTED[name]
    path = folder / Path(name).name
    path.write_bytes((CORPUS / name).read_bytes())
    made = entered(DOORS[name.split("/")[0]], path)
    assert (made is None) == (words is not None)
    if words is not None:
        with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
            DOORS[name.split("/")[0]](path)
        assert words in str(refused.value)


def test_every_file_of_the_corpus_is_expected() -> None:
    here = {f"{kind}/{path.name}" for kind in DOORS for path in (CORPUS / kind).iterdir()}
    assert here == set(EXPECTED)


def test_millimetres_that_pass_for_metres_are_seen_in_the_wave() -> None:
    with pytest.warns(Advice, match="lengths are in metres"):
        row = Layout.read(CORPUS / "layouts" / "millimetres.csv")
    wave = de.simulate(row, de.Physics())
    assert wave.outcome == de.Outcome.OUT_OF_REACH
    assert "out of reach" in wave.explanation


def test_the_command_line_prints_one_safe_line(tmp_path: Path, capsys: Any) -> None:
    path = tmp_path / "a\x1b[2J\nb.csv"
    path.write_text("spacing\n")
    assert main(["simulate", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.endswith("\n")
    assert said[:-1].isprintable()
    assert r"a\x1b[2J\nb.csv" in said


def test_a_file_too_large_to_be_one_of_ours_is_not_read(tmp_path: Path, monkeypatch: Any) -> None:
    Layout([0.02] * 9, 0.0075).to_csv(tmp_path / "row.csv")
    Layout([0.02] * 9, 0.0075).to_json(tmp_path / "row.json")
    monkeypatch.setattr("domino_env.physics.files.MOST_DOMINOES", 9)
    for name in ("row.csv", "row.json"):
        with pytest.raises(ValueError, match="it has 10 dominoes, where at most 9 are read"):
            Layout.read(tmp_path / name)
    monkeypatch.setattr("domino_env.core.reading.LARGEST_FILE", 100)
    with pytest.raises(ValueError, match=r"row\.csv: .* bytes, where files of at most 100"):
        Layout.read(tmp_path / "row.csv")


def test_what_would_take_ages_to_draw_or_hear_is_refused(tmp_path: Path) -> None:
    long = Layout([0.02] * 5000, 0.0075)
    long.to_csv(tmp_path / "long.csv")
    with pytest.raises(ValueError, match=r"long\.csv: it has 5,001 dominoes, where"):
        read_racers([tmp_path / "long.csv"])
    with pytest.raises(ValueError, match="row: it has 5,001 dominoes"):
        next(frames([Runner("row", de.simulate(long, de.Physics()))]))
    short = Runner("row", de.simulate(Layout([0.02], 0.0075), de.Physics()))
    with pytest.raises(ValueError, match=r"s of toppling take .* images"):
        next(frames([short], slow=1e6))
    far = Layout([3e5], 1e5, height=1e6, width=0.02)
    with pytest.raises(ValueError, match=r"a wave of .* s sounds for .* samples"):
        clicks(de.simulate(far, de.Physics(push=1e-3)), rate=1_000_000)
    with pytest.raises(ValueError, match=r"a row of .* m takes .* sheets of paper"):
        strips(far)


# fuzz -------------------------------------------------------------------------------------------

_CELLS = st.one_of(
    st.floats(1e-4, 50.0).map(repr),
    ODD.map(str),
    st.sampled_from(["18,0", "=1+1", "", " 7.5 ", "1e400", "inf", "1_8", "٣", '"', "-0"]),
)
_HEADS = st.sampled_from(
    ["spacing", "thickness", "spacing_mm", "thickness_mm", "height", "density", "note", "", "Ä"]
)


@st.composite
def tables(draw: Any) -> bytes:
    """Something like a spreadsheet."""
    heads = draw(st.lists(_HEADS, min_size=1, max_size=5))
    if draw(st.booleans()):
        heads = ["spacing_mm", "thickness_mm", *heads]
    rows = draw(st.lists(st.lists(_CELLS, max_size=6), max_size=6))
    sign, end = draw(st.sampled_from(",;\t|")), draw(st.sampled_from(["\n", "\r\n", "\r", "\n\n"]))
    text = end.join(sign.join(row) for row in [heads, *rows])
    coding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1", "utf-32"]))
    return text.encode(coding, "replace")


@st.composite
def documents(draw: Any) -> bytes:
    """Something like the JSON of a layout."""
    keys = st.sampled_from(["spacing", "thickness", "height", "width", "density", "unit", "hight"])
    sizes = st.one_of(st.floats(1e-4, 0.04), NUMBERS)
    values = st.one_of(sizes, st.lists(sizes, max_size=4), DEEP)
    found = draw(st.dictionaries(keys, values, max_size=6))
    if draw(st.booleans()):
        found = {"spacing": [0.01, 0.02], "thickness": 0.0075} | found
    return json.dumps(found).encode(draw(st.sampled_from(["utf-8", "utf-16", "latin-1"])))


def layout_that_topples(path: Path) -> Layout:
    """The layout of a file; its wave holds nothing that is no number."""
    layout = Layout.read(path)
    if layout.count <= 12:
        try:
            wave = de.simulate(layout, de.Physics())
        except (ValueError, OSError) as error:
            raise AssertionError("a layout that was read cannot be simulated") from error
        assert not np.isnan(wave.arrival_times).any()
        assert np.isfinite(wave.mean_speed)
        assert not np.isnan(wave.error_estimate)
    return layout


_TABLE = b"number,spacing,thickness,height,density\n0,0.018,0.0075,0.048,1040\n1,,0.0075,0.05,900\n"
_DOCUMENT = (
    b'{"unit": "SI: m, kg/m3", "spacing": [0.018], "thickness": [0.0075, 0.007], "width": 0.02}'
)


@FUZZ
@given(data=st.one_of(tables(), mutated(_TABLE), st.binary(max_size=200)))
def test_any_table_is_read_or_refused(folder: Path, data: bytes) -> None:
    path = folder / "any.csv"
    path.write_bytes(data)
    entered(layout_that_topples, path)


@FUZZ
@given(data=st.one_of(documents(), mutated(_DOCUMENT), st.binary(max_size=200)))
def test_any_document_is_read_or_refused(folder: Path, data: bytes) -> None:
    path = folder / "any.json"
    path.write_bytes(data)
    entered(layout_that_topples, path)


def toml(value: Any) -> str:
    """A value as TOML writes it, as far as TOML can."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(toml(v) for v in value) + "]"
    return repr(value)


@st.composite
def scenes(draw: Any) -> bytes:
    """A scene that ships with some of its values replaced."""
    _, text = draw(st.sampled_from(SHIPPED))
    document = tomllib.loads(text)
    small = st.sampled_from([0, 1, 2, 0.5, 0.003, 0.02, 1.5, 100, -0.01, 12])
    for _ in range(draw(st.integers(1, 3))):
        tables = [t for t in document.values() if isinstance(t, dict)]
        table = draw(st.sampled_from([document, *tables]))
        key = draw(st.sampled_from([*table, "of", "step", "values", "fixed", "length", "limits"]))
        kind = draw(st.sampled_from(["odd", "small", "several", "deep", "away"]))
        if kind == "away":
            table.pop(key, None)
        else:
            several = st.lists(small, max_size=4)
            table[key] = draw({"odd": ODD, "small": small, "several": several, "deep": DEEP}[kind])
    lines = [f"{k} = {toml(v)}" for k, v in document.items() if not isinstance(v, dict)]
    for name, table in document.items():
        if isinstance(table, dict):
            lines += [
                f"[{json.dumps(name)}]",
                *(f"{json.dumps(k)} = {toml(v)}" for k, v in table.items()),
            ]
    return "\n".join(lines).encode("utf-8", "replace")


def scene_that_is_kept(path: Path) -> de.Scene:
    """The scene of a file; it is written down and read back the same, and its name is safe."""
    scene = de.load_scene(path)
    again = parse_scene(scene.to_toml(), "x", str(path))
    told = [f.name for f in dataclasses.fields(scene)]
    assert [n for n in told if getattr(again, n) != getattr(scene, n)] == []
    assert scene.name not in ("", ".", "..")
    assert not set(scene.name) & set("/\\\n")
    assert all_finite([v for v in dataclasses.asdict(scene).values() if v is not None])
    if scene.count <= 60 and scene.plain and scene.length is None and scene.placement is None:
        middle = scene.layout(
            0.5 * sum(scene.spacing), 0.5 * sum(scene.thickness) if scene.free_thickness else None
        )
        assert np.isfinite(scene.score(scene.simulate(middle)))
    return scene


@FUZZ
@given(data=st.one_of(scenes(), st.sampled_from([t.encode() for _, t in SHIPPED]).flatmap(mutated)))
def test_any_scene_is_read_or_refused(folder: Path, data: bytes) -> None:
    path = folder / "any.toml"
    path.write_bytes(data)
    entered(scene_that_is_kept, path)


# names and pages --------------------------------------------------------------------------------


def test_names_on_a_page_are_only_names(tmp_path: Path) -> None:
    evil = "</script><!--<script>{{race}}{{title}}<img src=x onerror=alert(1)>"
    wave = de.simulate(Layout([0.018], 0.0075), de.Physics())
    check = {"engine": evil, "verdict": evil}
    racer = Racer(evil, wave, verification=check)
    write_report([racer], evil, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text("utf-8")
    data = page.split('id="data">')[1].split("</script>")[0]
    assert json.loads(data)["rows"][0]["name"] == evil
    assert "<" not in data
    assert "<img" not in page
    write_report([Racer("x", wave)], "x", tmp_path / "plain.html")
    plain = (tmp_path / "plain.html").read_text("utf-8")
    for sign in ("<script", "</script", "<!--"):
        assert page.count(sign) == plain.count(sign)


def test_a_title_in_a_comparison_is_no_markdown() -> None:
    class Of:
        """Enough of a result."""

        def __init__(self, **held: Any) -> None:
            self.__dict__ |= held

    evil = "![x](http://evil/x.png) <script> `a` | b"
    scene = Of(name="s", title=evil)
    comparison = Of(results=[Of(scene=scene, uniform=Of(score=1.0))], best={"s": 1.0})
    told = _about(comparison, "s")  # type: ignore[arg-type]
    assert "![" not in told
    assert not any(c == "<" and told[i - 1] != "\\" for i, c in enumerate(told))


def test_a_title_with_dollars_is_drawn_as_it_stands(tmp_path: Path) -> None:
    from optimize import search

    scene = de.load_scene(CORPUS / "scenes" / "formulas_in_the_title.toml")
    search(scene, "uniform", 10, folder=tmp_path / "run", progress=False)
    assert (tmp_path / "run" / "result.png").stat().st_size > 1000


def test_a_run_writes_through_no_link(tmp_path: Path) -> None:
    """A folder that a stranger prepared: what it points at outside stays as it is."""
    from optimize import search

    outside = tmp_path / "outside"
    outside.mkdir()
    run = tmp_path / "run"
    run.mkdir()
    for name in ("scene.toml", "layout.csv", "trace.csv", "report.html"):
        (outside / name).write_text("precious")
        (run / name).symlink_to(outside / name)
    (run / ".writable").symlink_to(outside / "new")
    search("sprint", "uniform", 10, folder=run, progress=False, resume=True)
    write_report(*read_racers([run]), run / "report.html")
    assert sorted(p.name for p in outside.iterdir()) == sorted(
        ["scene.toml", "layout.csv", "trace.csv", "report.html"]
    )
    assert {p.read_text() for p in outside.iterdir()} == {"precious"}
    assert not (run / "layout.csv").is_symlink()
