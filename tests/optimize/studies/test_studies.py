"""The study store: exact, shared by processes, and honest about what it cannot read or write."""

from __future__ import annotations

import csv
import json
import multiprocessing as mp
import resource
import signal
import sqlite3
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.cli.main import main
from optimize.studies import open_store
from optimize.studies.task import Task, TaskResult, run_task, scene_of

DATA = Path(__file__).parents[2] / "data"

# the processes below only write: what threads of this one hold is nothing to them
pytestmark = pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")


@pytest.fixture(scope="module")
def result(scenes) -> TaskResult:
    """Of a real search."""
    return run_task(Task.of(scenes["both"], "random", 3, evaluations=300))


@pytest.fixture
def old(tmp_path: Path) -> Path:
    """A store that version 0.1.0 has written."""
    path = tmp_path / "old.sqlite"
    connection = sqlite3.connect(path)
    connection.executescript((DATA / "studies_0_1_0.sql").read_text("utf-8"))
    connection.close()
    return path


def other(result: TaskResult, number: int, **changes: object) -> TaskResult:
    return replace(result, key=f"{number:032x}", **changes)


def same(one: TaskResult, two: TaskResult) -> bool:
    """Whether all fields agree to the bit."""
    pairs = [(getattr(one, f.name), getattr(two, f.name)) for f in fields(one)]
    return all(
        a.tobytes() == b.tobytes() if isinstance(a, np.ndarray) else a == b and type(a) is type(b)
        for a, b in pairs
    )


def changed_copy(path: Path, to: Path, statement: str) -> Path:
    """The store with something done to it that no program of ours does."""
    to.write_bytes(path.read_bytes())
    connection = sqlite3.connect(to)
    connection.execute(statement)
    connection.commit()
    connection.close()
    return to


# what it keeps ----------------------------------------------------------------------------------


def test_what_is_kept_comes_back_to_the_bit(tmp_path: Path, result: TaskResult) -> None:
    ugly = other(
        result, 7,
        score=float(np.nextafter(0.8, 1.0)), gain=None, seconds=5e-324, seed=2**63 - 1,
        spacing=result.spacing * (1.0 + 1e-15), scene="title = 'é\U0001f600'",
        labels=(("physics.friction", 0.1), ("count", 3), ("whole", 2.0), ("name", "=Sünde\n")),
    )  # fmt: skip
    study = open_store(tmp_path / "a.sqlite").begin("one", "sweep", {})
    study.add(result)
    study.add(ugly)
    again = open_store(tmp_path / "a.sqlite").study("one").done()
    assert list(again) == [result.key, ugly.key]
    assert same(again[result.key], result)
    assert same(again[ugly.key], ugly)
    assert [type(v) for _, v in again[ugly.key].labels] == [float, int, float, str]


def test_the_first_result_of_a_key_stays_in_each_study(tmp_path: Path, result: TaskResult) -> None:
    store = open_store(tmp_path / "a.sqlite")
    one, two = store.begin("one", "sweep", {}), store.begin("two", "sweep", {})
    one.add(result)
    one.add(replace(result, score=99.0))
    two.add(replace(result, score=1.0))
    assert one.done()[result.key].score == result.score
    assert two.done()[result.key].score == 1.0
    assert [(s.name, s.tasks) for s in store.studies()] == [("one", 1), ("two", 1)]


def test_a_study_goes_on_only_with_what_it_was_begun_with(tmp_path: Path, result) -> None:
    store = open_store(tmp_path / "a.sqlite")
    store.begin("one", "sweep", {"evaluations": 100, "scenes": ["a"]}).add(result)
    assert store.begin("one", "sweep", {"scenes": ["a"], "evaluations": 100}).done()
    with pytest.raises(ValueError, match="evaluations' = 100, not 200: go on with"):
        store.begin("one", "sweep", {"evaluations": 200, "scenes": ["a"]})
    with pytest.raises(ValueError, match="kind = 'sweep', not 'comparison'"):
        store.begin("one", "comparison", {"evaluations": 100, "scenes": ["a"]})
    with pytest.raises(ValueError, match=r"has no study 'two' \(there: 'one'\)"):
        store.study("two")
    for name in ("", " ", "a\x1b[2J", "a\nb", "x" * 201):
        with pytest.raises(ValueError, match="a study cannot be called"):
            store.begin(name, "sweep", {})
    with pytest.raises(ValueError, match="must be plain JSON"):
        store.begin("nan", "sweep", {"x": float("nan")})


@pytest.mark.parametrize("change", [
    {"score": float("nan")}, {"seconds": float("inf")}, {"seed": 2**63}, {"gain": float("nan")},
    {"spacing": np.array([0.1, np.nan])}, {"trace": [(1, 1, float("nan"), 0.0)]},
    {"labels": (("a", 1), ("a", 2))}, {"labels": (("a", float("inf")),)}, {"outcome": None},
], ids=lambda change: str(next(iter(change))))  # fmt: skip
def test_what_cannot_be_kept_is_refused(tmp_path: Path, result, change) -> None:
    study = open_store(tmp_path / "a.sqlite").begin("one", "sweep", {})
    with pytest.raises(ValueError, match=r"a\.sqlite: .*(cannot be kept|NOT NULL)"):
        study.add(replace(result, **change))
    assert study.done() == {}


def test_a_store_of_version_0_1_0_is_read_and_gone_on_with(old: Path, result) -> None:
    store = open_store(old)
    assert [(s.name, s.kind, s.tasks) for s in store.studies()] == [
        ("sweep-five", "sweep", 2), ("compare-five", "comparison", 1),
    ]  # fmt: skip
    study = store.study("sweep-five")
    assert study.settings["set"] == ["physics.push=8,9"]
    first, second = study.done().values()
    assert (first.labels, second.labels) == ((("physics.push", 8.0),), (("physics.push", 9.0),))
    assert second.score == 0.598987614595916 > second.gain
    assert first.spacing.tolist()[0] == 0.025568111176584356
    assert first.trace[0] == (20, 100, 0.07232212799999616, 0.5744801916496295)
    assert Task(first.scene, "random", 0, evaluations=20).key == first.key  # --resume finds it
    scene = scene_of(first.scene)
    layout = scene.layout(first.spacing)
    assert scene.score(layout) == pytest.approx(first.score, rel=1e-6)
    study.add(result)
    assert list(open_store(old).study("sweep-five").done()) == [first.key, second.key, result.key]


def schema_of(path: Path) -> set[str]:
    connection = sqlite3.connect(path)
    statements = connection.execute("SELECT sql FROM sqlite_master WHERE sql NOT NULL").fetchall()
    connection.close()
    return {statement for (statement,) in statements}


def test_version_0_1_0_can_read_what_is_written_now(old: Path, tmp_path: Path) -> None:
    open_store(tmp_path / "a.sqlite")
    assert schema_of(tmp_path / "a.sqlite") == schema_of(old)


def test_a_server_gets_the_same_tables() -> None:
    """As PostgreSQL says them; no server is asked."""
    from sqlalchemy.dialects import postgresql
    from sqlalchemy.schema import CreateTable

    from optimize.studies.models import Base

    tables = Base.metadata.tables.values()
    said = {t.name: str(CreateTable(t).compile(dialect=postgresql.dialect())) for t in tables}
    assert "number BIGSERIAL NOT NULL" in said["results"]
    assert "score DOUBLE PRECISION NOT NULL" in said["results"]
    assert "gain DOUBLE PRECISION, " in said["results"]
    assert "spacing TEXT NOT NULL" in said["results"]
    assert "settings TEXT NOT NULL" in said["studies"]


# several processes ------------------------------------------------------------------------------


def write_many(path: Path, result: TaskResult, first: int, gate) -> None:
    gate.wait()  # all at once, the making of the tables too
    study = open_store(path).begin("shared", "sweep", {"a": 1})
    for number in range(first, first + 12):
        study.add(other(result, number, seed=first))


def test_processes_that_write_at_once_lose_nothing(tmp_path: Path, result: TaskResult) -> None:
    context = mp.get_context("fork")
    gate = context.Barrier(3)
    # 12 numbers each, half of them shared with a neighbour
    processes = [
        context.Process(target=write_many, args=(tmp_path / "a.sqlite", result, first, gate))
        for first in (0, 6, 12)
    ]
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
        assert process.exitcode == 0
    study = open_store(tmp_path / "a.sqlite").study("shared")
    assert sorted(int(key, 16) for key in study.done()) == list(range(24))


def write_for_ever(path: Path, result: TaskResult, pipe) -> None:
    study = open_store(path).begin("killed", "sweep", {})
    number = 0
    while True:
        study.add(other(result, number))
        pipe.send(number)
        number += 1


def test_a_writer_that_is_killed_leaves_every_result_it_was_told_of(
    tmp_path: Path, result: TaskResult
) -> None:
    context = mp.get_context("fork")
    rng = np.random.default_rng(0)
    path = tmp_path / "a.sqlite"
    for _ in range(6):
        path.unlink(missing_ok=True)
        mine, its = context.Pipe(duplex=False)
        process = context.Process(target=write_for_ever, args=(path, result, its))
        process.start()
        its.close()
        kept = [mine.recv()]
        while len(kept) < 3:
            kept.append(mine.recv())
        process.join(rng.uniform(0.0, 0.05))
        process.kill()
        process.join()
        while mine.poll():
            try:
                kept.append(mine.recv())
            except EOFError:
                break
        done = open_store(path).study("killed").done()
        assert len(done) in (len(kept), len(kept) + 1)  # one may be kept and not yet told
        assert all(same(other(result, int(key, 16)), found) for key, found in done.items())


# what it refuses --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def good(tmp_path_factory, result: TaskResult) -> Path:
    """A store with twenty results."""
    path = tmp_path_factory.mktemp("store") / "good.sqlite"
    study = open_store(path).begin("one", "sweep", {"a": 1})
    for number in range(20):
        study.add(other(result, number))
    return path


@pytest.mark.parametrize(("statement", "message"), [
    ("UPDATE domino_store SET schema = 9", "schema 9, written by a newer domino-chains"),
    ("UPDATE domino_store SET schema = 'x'", "does not say which schema"),
    ("DELETE FROM domino_store", "does not say which schema"),
    ("DROP TABLE results", r"or a damaged one \(there is no table 'results'\): name another"),
    ("DROP TABLE domino_store", r"is no store of studies, .*no table 'domino_store'"),
])  # fmt: skip
def test_another_schema_is_refused(good: Path, tmp_path: Path, statement, message) -> None:
    path = changed_copy(good, tmp_path / "x.sqlite", statement)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=message) as error:
        open_store(path)
    assert str(path) in str(error.value)
    assert path.read_bytes() == before


@pytest.mark.parametrize("statement", [
    "UPDATE results SET spacing = substr(spacing, 9)", "UPDATE results SET height = x'ff'",
    "UPDATE results SET score = 'fast'", "UPDATE results SET trace = '[[1,2]]'",
    "UPDATE results SET labels = '3'", "UPDATE results SET spacing = '[NaN]'",
], ids=lambda s: s[19:40])  # fmt: skip
def test_a_cell_that_no_search_has_written_is_refused(good: Path, tmp_path, statement) -> None:
    study = open_store(changed_copy(good, tmp_path / "x.sqlite", statement)).study("one")
    with pytest.raises(ValueError, match=r"x\.sqlite is damaged \(a cell holds .*bring back"):
        study.done()


def test_damaged_files_are_refused_or_read_right(good: Path, tmp_path: Path, result) -> None:
    whole = good.read_bytes()
    rng = np.random.default_rng(1)
    refused: list[str] = []
    for round_ in range(40):
        data = bytearray(whole)
        if round_ % 2:
            data = data[: int(rng.integers(16, len(whole)))]
        else:
            at = int(rng.integers(len(data) - 512))
            data[at : at + 512] = rng.bytes(512)
        path = tmp_path / "x.sqlite"
        path.write_bytes(data)
        try:
            store = open_store(path)
            done = store.study("one").done()
        except ValueError as error:
            refused.append(str(error))
            assert path.read_bytes() == data
            continue
        assert len(done) <= 20
    assert all(str(tmp_path / "x.sqlite") in sentence for sentence in refused)
    assert (
        len(refused) > 20
    )  # the others were damaged where nothing can tell: in a digit, in free space


def test_what_is_no_store_is_refused(good: Path, tmp_path: Path) -> None:
    (tmp_path / "text").write_text("spacing,thickness\n")
    (tmp_path / "short").write_bytes(b"SQLite")
    for name in ("text", "short"):
        with pytest.raises(ValueError, match="is no store of studies: name another file"):
            open_store(tmp_path / name)
    with pytest.raises(ValueError, match="is a folder: name a file"):
        open_store(tmp_path)
    with pytest.raises(ValueError, match="cannot be written: "):
        open_store(tmp_path / "text" / "a.sqlite")
    with pytest.raises(ValueError, match="there is no store"):
        open_store(tmp_path / "none.sqlite", create=False)
    with pytest.raises(ValueError, match=r"mysql://me:\*\*\*@host/x is no place for a store"):
        open_store("mysql://me:secret@host/x")
    assert sorted(f.name for f in tmp_path.iterdir()) == ["short", "text"]


def test_an_url_names_a_file_too(tmp_path: Path, result: TaskResult) -> None:
    open_store(f"sqlite:///{tmp_path}/a.sqlite").begin("one", "sweep", {}).add(result)
    assert open_store(tmp_path / "a.sqlite").studies()[0].tasks == 1


def fill(path: Path, result: TaskResult, pipe) -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 40_000,) * 2)
    study = open_store(path).study("one")
    kept = 0
    try:
        for number in range(1000, 2000):
            study.add(other(result, number))
            kept += 1
    except ValueError as error:
        pipe.send((kept, str(error)))


def test_a_full_disk_is_told_and_loses_nothing(good: Path, tmp_path: Path, result) -> None:
    path = tmp_path / "x.sqlite"
    path.write_bytes(good.read_bytes())
    context = mp.get_context("fork")
    mine, its = context.Pipe(duplex=False)
    process = context.Process(target=fill, args=(path, result, its))
    process.start()
    kept, said = mine.recv()
    process.join()
    assert kept > 0
    assert f"{path}: cannot be written" in said
    assert "what was to be written is not kept, all that was there before is" in said
    study = open_store(path).study("one")
    assert len(study.done()) == 20 + kept
    study.add(other(result, 5000))  # with room again
    assert len(study.done()) == 21 + kept


def test_a_store_that_others_hold_is_waited_for_only_so_long(
    good: Path, tmp_path: Path, result, monkeypatch
) -> None:
    from optimize.studies import database

    monkeypatch.setattr(database, "PATIENCE", 0.05)
    path = tmp_path / "x.sqlite"
    path.write_bytes(good.read_bytes())
    study = open_store(path).study("one")
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("BEGIN IMMEDIATE")
    with pytest.raises(ValueError, match="other programs have been writing it"):
        study.add(other(result, 99))
    connection.execute("ROLLBACK")
    connection.close()
    study.add(other(result, 99))
    assert len(study.done()) == 21


# the command ------------------------------------------------------------------------------------


def said(capsys, *words: object) -> str:
    assert main([str(word) for word in words]) == 0
    return capsys.readouterr().out


def test_the_command_lists_and_shows(capsys, tmp_path: Path, result: TaskResult) -> None:
    path = tmp_path / "a.sqlite"
    store = open_store(path)
    study = store.begin("friction", "sweep", {"evaluations": 300})
    store.begin("empty", "comparison", {})
    for number, score in enumerate((0.5, 0.7, 0.6)):
        gain = score / 0.5 - 1.0
        study.add(other(result, number, score=score, uniform_score=0.5, gain=gain))
    study.add(other(result, 9, scene_name="\x1b[31mred", labels=(("a", "\x9b2J"),)))
    listed = said(capsys, "studies", "--store", path)
    assert [line.split()[:3] for line in listed.splitlines()] == [
        ["study", "kind", "tasks"], ["friction", "sweep", "4"], ["empty", "comparison", "0"],
    ]  # fmt: skip
    shown = said(capsys, "studies", "show", "friction", "--store", path)
    assert "evaluations = 300" in shown
    row = next(line.split() for line in shown.splitlines() if line.startswith("both"))
    assert row[1:] == ["random", "3", "0.7", "0.6", "0.5", "+40.00%", "00000000"]
    assert "\x1b" not in shown
    assert "\x9b" not in shown
    assert "\\x1b[31mred" in shown


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_an_export_holds_every_number_to_the_bit(
    capsys, tmp_path: Path, result: TaskResult, suffix: str
) -> None:
    path = tmp_path / "a.sqlite"
    study = open_store(path).begin("=1+1", "sweep", {})
    labels = (("physics.friction", 0.1), ("score", 3), ("@mixed", -2))
    study.add(replace(result, labels=labels, gain=-0.25))
    study.add(other(result, 1, scene_name="+x", labels=(("@mixed", "-cmd"),), gain=None))
    file = tmp_path / f"all.{suffix}"
    text = said(capsys, "studies", "export", "=1+1", "--to", file, "--store", path)
    assert text == f"written to {file}: 2 results\n"
    if suffix == "parquet":
        table = pytest.importorskip("pyarrow.parquet").read_table(file)
        first, second = table.to_pylist()
        assert first["spacing"] == result.spacing.tolist()
        assert [tuple(step.values()) for step in first["trace"]] == result.trace
        assert (first["study"], second["scene_name"]) == ("=1+1", "+x")
        assert (first["@mixed"], second["@mixed"]) == ("-2", "-cmd")
        assert second["gain"] is None
    else:
        with file.open(newline="") as lines:
            first, second = csv.DictReader(lines)
        assert json.loads(first["spacing"]) == result.spacing.tolist()
        assert [tuple(step) for step in json.loads(first["trace"])] == result.trace
        # text that a spreadsheet would run is made harmless, numbers are as they are
        assert (first["study"], second["scene_name"]) == ("'=1+1", "'+x")
        assert (first["'@mixed"], second["'@mixed"]) == ("-2", "'-cmd")
        assert (first["gain"], second["gain"]) == ("-0.25", "")
    assert float(first["score"]) == result.score
    assert float(first["physics.friction"]) == 0.1
    assert int(first["label.score"]) == 3


def test_the_best_row_of_a_scene_is_a_layout(capsys, tmp_path: Path, scenes, result) -> None:
    path = tmp_path / "a.sqlite"
    study = open_store(path).begin("one", "sweep", {})
    better = run_task(Task.of(scenes["both"], "l-bfgs", 0, evaluations=200))
    study.add(result)
    study.add(better)
    assert better.score > result.score
    said(capsys, "studies", "export", "one", "--best", "both", "--to", tmp_path / "b.json",
         "--store", path)  # fmt: skip
    layout = de.Layout.read(tmp_path / "b.json")
    assert scenes["both"].score(layout) == better.score
    words = ["studies", "export", "one", "--store", path]
    said(capsys, *words, "--best", result.key[:8], "--to", tmp_path / "c.csv")
    assert np.array_equal(de.Layout.read(tmp_path / "c.csv").spacing, result.spacing)
    study.add(run_task(Task.of(replace(scenes["both"], count=7), "random", 0, evaluations=20)))
    assert main([*map(str, words), "--best", "both", "--to", str(tmp_path / "d.csv")]) == 2
    assert "has several scenes called 'both'" in capsys.readouterr().err


@pytest.mark.parametrize(("words", "message"), [
    (["show"], "name the study"), (["export", "one"], "--to FILE.csv"),
    (["show", "on\x1be"], r"has no study 'on\x1be'"), (["list", "one"], "domino studies show one"),
    (["export", "one", "--to", "x.xls"], "to a .csv, .parquet or .zip file"),
    (["export", "one", "--best", "--to", "x.txt"], "to a .csv or .json file"),
    (["export", "one", "--best", "nobody", "--to", "x.csv"], "has no scene and no single result"),
    (["export", "one", "--to", "a.sqlite/x.csv"], "cannot be written"),
])  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(
    capsys, monkeypatch, tmp_path: Path, good: Path, words, message
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.sqlite").write_bytes(good.read_bytes())
    assert main(["studies", *words, "--store", "a.sqlite"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("domino: ")
    assert message in error
    assert error.count("\n") == 1
    assert [f.name for f in tmp_path.iterdir()] == ["a.sqlite"]


def test_the_store_loads_a_database_only_when_it_is_opened() -> None:
    script = "import sys, optimize.studies, optimize.cli.studies; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert "optimize.cli.studies" in done.stdout.split()
    assert "sqlalchemy" not in done.stdout.split()
