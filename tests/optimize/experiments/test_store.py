"""The study store: exact results, damaged files, and the command."""

import csv
import json
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import msgspec
import numpy as np
import pytest

import domino_env as de
from optimize.experiments.store import TABLES, open_store
from optimize.experiments.task import Task, TaskResult


@pytest.fixture(scope="module")
def result(scenes) -> TaskResult:
    """Result of a search."""
    return Task(scenes["both"].to_toml(), "random", 3, budget=300).run()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.sqlite"


def numbered(result: TaskResult, number: int, **changes: object) -> TaskResult:
    """Return a result with another key."""
    return msgspec.structs.replace(result, key=f"{number:032x}", **changes)


# results ----------------------------------------------------------------------------------------


def test_results_read_back_bitwise(path, result):
    ugly = numbered(
        result, 7,
        score=float(np.nextafter(0.8, 1.0)), gain=None, seconds=5e-324, seed=2**63 - 1,
        spacing=tuple(x * (1.0 + 1e-15) for x in result.spacing), scene="title = 'é\U0001f600'",
        labels={"physics.friction": 0.1, "count": 3, "whole": 2.0, "name": "=Sünde\n"},
    )  # fmt: skip
    study = open_store(path).begin("one", "sweep", {})
    study.add(result)
    study.add(ugly)
    again = open_store(path).study("one").results()
    assert again == {result.key: result, ugly.key: ugly}
    assert [type(v) for v in again[ugly.key].labels.values()] == [float, int, float, str]


def test_the_first_result_of_a_key_stays_in_each_study(path, result):
    store = open_store(path)
    one, two = store.begin("one", "sweep", {}), store.begin("two", "sweep", {})
    one.add(result)
    one.add(msgspec.structs.replace(result, score=99.0))
    two.add(msgspec.structs.replace(result, score=1.0))
    assert one.results()[result.key].score == result.score
    assert two.results()[result.key].score == 1.0
    assert [(s.name, s.result_count) for s in store.studies()] == [("one", 1), ("two", 1)]


def test_a_study_continues_only_with_what_it_was_begun_with(path):
    store = open_store(path)
    settings = {"evaluations": 100, "scenes": ["a"]}
    assert store.begin("one", "sweep", settings) == store.begin("one", "sweep", settings)
    for kind, changed in (("sweep", {"evaluations": 200}), ("comparison", {})):
        with pytest.raises(ValueError, match=r"was begun as sweep with \{.*\}: give"):
            store.begin("one", kind, settings | changed)
    with pytest.raises(ValueError, match=r"has no study 'two': choose one of 'one'"):
        store.study("two")
    for name in ("", "..", "../one", "a\\b", "a\nb", 201 * "a"):
        with pytest.raises(ValueError, match=r"study name = '.*': give 1 to 200 printable"):
            store.begin(name, "sweep", settings)


def test_results_that_are_not_finite_are_rejected(path, result):
    study = open_store(path).begin("one", "sweep", {})
    with pytest.raises(ValueError, match="not JSON compliant"):
        study.add(msgspec.structs.replace(result, score=float("nan")))
    assert study.results() == {}


# faults -----------------------------------------------------------------------------------------

WRITERS = """
import os, signal, sys, time
import msgspec
from optimize.experiments.store import TABLES, open_store
from optimize.experiments.task import TaskResult
path, text = sys.argv[1:]
result = msgspec.json.decode(text, type=TaskResult)
writers = []
for i in range(8):
    read, write = os.pipe()
    if not (process := os.fork()):
        study = open_store(path).begin("one", "sweep", {})
        for number in range(1000):
            study.add(msgspec.structs.replace(result, key=f"{i}-{number}"))
            os.write(write, f"{i}-{number}\\n".encode())
    os.close(write)
    writers.append((process, read))
keys = [os.read(read, 1000) for _, read in writers]  # each has stored a result
for kind in (0, 1):  # half of them, then the others
    for process, read in writers[kind::2]:
        os.kill(process, signal.SIGKILL)
    time.sleep(0.1)
keys += [open(read, "rb").read() for _, read in writers]
print(b"".join(keys).decode())
"""


def test_writers_that_are_killed_lose_no_stored_result(path, result):
    command = [sys.executable, "-c", WRITERS, path, msgspec.json.encode(result).decode()]
    stored = subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout
    study = open_store(path).study("one")
    assert study.results().keys() >= set(stored.split())
    study.add(result)
    assert result.key in study.results()


def test_a_store_has_all_tables_or_none(path, monkeypatch, result):
    with monkeypatch.context() as patch:
        patch.setattr("optimize.experiments.store.TABLES", (TABLES[0], "CREATE"))
        with pytest.raises(ValueError, match="incomplete input"):
            open_store(path)
    study = open_store(path).begin("one", "sweep", {})
    study.add(result)
    assert study.results() == {result.key: result}


@pytest.fixture(scope="module")
def good(tmp_path_factory, result: TaskResult) -> bytes:
    """Content of a store with twenty results."""
    path = tmp_path_factory.mktemp("store") / "good.sqlite"
    study = open_store(path).begin("one", "sweep", {"a": 1})
    for number in range(20):
        study.add(numbered(result, number))
    return path.read_bytes()


@pytest.mark.parametrize(("statement", "message"), [
    ("DROP TABLE results", "no such table: results.* name another file"),
    ("UPDATE results SET data = substr(data, 9)", "is damaged or no store"),
    ("UPDATE results SET data = '{}'", "missing required field.* is damaged"),
])  # fmt: skip
def test_damaged_stores_are_rejected(good, path, statement, message):
    path.write_bytes(good)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(statement)
        connection.commit()
    before = path.read_bytes()
    with pytest.raises(ValueError, match=message) as error:
        open_store(path).study("one").results()
    assert str(path) in str(error.value)
    assert path.read_bytes() == before


def test_other_files_are_rejected(tmp_path):
    (tmp_path / "text").write_text("spacing,thickness\n" * 99)
    for name, message in {
        "text": r"is not a database: .* no store of studies, name",
        ".": "is a folder: name the file",
        "text/a.sqlite": "text is a file: name a folder",
    }.items():
        with pytest.raises(ValueError, match=message):
            open_store(tmp_path / name)
    with pytest.raises(ValueError, match="holds no store"):
        open_store(tmp_path / "none.sqlite", create=False)
    assert [f.name for f in tmp_path.iterdir()] == ["text"]


# the command ------------------------------------------------------------------------------------


def test_the_command_lists_studies_and_shows_results(output_of, path, result):
    study = open_store(path).begin("friction", "sweep", {"evaluations": 300})
    for number, score in enumerate((0.5, 0.7, 0.6)):
        gain = score / 0.5 - 1.0
        study.add(numbered(result, number, score=score, uniform_score=0.5, gain=gain))
    study.add(numbered(result, 8, scene_name="\x1b[31mred"))
    study.add(numbered(result, 9, labels={"a": "\x9b2J"}))
    names, line = output_of("studies", "--store", path).splitlines()
    assert names.split() == ["study", "kind", "results", "begun"]
    assert line.split()[:3] == ["friction", "sweep", "5"]
    shown = output_of("studies", "show", "friction", "--store", path)
    assert "evaluations = 300" in shown
    cells = next(line.split() for line in shown.splitlines() if line.startswith("both"))
    assert cells[1:] == ["random", "3", "score", "[m/s]", "0.7", "0.6", "0.5", "+40.00%"]
    assert not {"\x1b", "\x9b"} & set(shown)
    assert "\\x1b[31mred" in shown


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_an_export_holds_every_number_bitwise(output_of, path, result, suffix):
    study = open_store(path).begin("=1+1", "sweep", {})
    labels = {"physics.friction": 0.1, "score": 3, "@word": "-1", "physics.push": 4.0}
    study.add(msgspec.structs.replace(result, labels=labels, gain=-0.25))
    study.add(
        numbered(
            result,
            1,
            scene_name="+x",
            labels={"@word": "-cmd", "physics.push": "released"},
            gain=None,
        )
    )
    file = path.with_name(f"all.{suffix}")
    text = output_of("studies", "export", "=1+1", "--to", file, "--store", path)
    assert text == f"written to {file}: 2 results\n"
    if suffix == "parquet":
        first, second = pytest.importorskip("pyarrow.parquet").read_table(file).to_pylist()
        assert tuple(first["spacing"]) == result.spacing
        assert (first["study"], first["@word"], second["@word"]) == ("=1+1", "-1", "-cmd")
        assert second["gain"] is None
        assert (first["physics.push"], second["physics.push"]) == ("4.0", "released")
    else:
        first, second = csv.DictReader(file.read_text().splitlines())
        assert tuple(json.loads(first["spacing"])) == result.spacing
        assert (first["study"], second["@word"]) == ("=1+1", "-cmd")
        assert (first["gain"], second["gain"]) == ("-0.25", "")
    assert float(first["score"]) == result.score
    assert float(first["physics.friction"]) == 0.1
    assert int(first["label.score"]) == 3


def test_the_best_layout_of_a_scene_is_exported(output_of, error_of, path, scenes, result):
    study = open_store(path).begin("one", "sweep", {})
    better = Task(scenes["both"].to_toml(), "l-bfgs", 0, budget=200).run()
    study.add(result)
    study.add(better)
    assert better.score > result.score
    words = "studies", "export", "one", "--store", path, "--best", "both", "--to"
    output_of(*words, path.with_name("b.json"))
    layout = de.Layout.read(path.with_name("b.json"))
    assert scenes["both"].score(layout) == better.score
    assert de.load_scene(path.with_name("b.scene.toml")) == scenes["both"]
    study.add(numbered(result, 1, scene="another"))
    assert "has 2 scenes called 'both'" in error_of(*words, "d.csv")


@pytest.mark.parametrize(("words", "message"), [
    (["show"], "name the study"), (["export", "one"], "--to FILE.csv"),
    (["show", "on\x1be"], r"has no study 'on\x1be'"),
    (["export", "one", "--to", "x.xls"], "name a .csv or .parquet file"),
    (["export", "one", "--best", "both", "--to", "x.txt"], "name a .csv or .json file"),
    (["export", "one", "--best", "nobody", "--to", "x.csv"], "has no scenes called 'nobody': name"),
])  # fmt: skip
def test_errors_are_one_line(error_of, monkeypatch, tmp_path, good, words, message):
    monkeypatch.chdir(tmp_path)
    Path("a.sqlite").write_bytes(good)
    assert message in error_of("studies", *words, "--store", "a.sqlite")
    assert [f.name for f in tmp_path.iterdir()] == ["a.sqlite"]
