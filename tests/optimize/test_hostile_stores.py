"""Stores and journals from strangers: read right, or refused with one sentence."""

from __future__ import annotations

import io
import json
import os
import sqlite3
import struct
import zlib
from contextlib import closing, redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile import DEEP, ODD, complaint, entered, mutated
from hypothesis import given, settings
from hypothesis import strategies as st

from domino_env.command import main
from optimize.journal import Journal, _packed
from optimize.runs import versions
from optimize.store import open_store
from optimize.study_export import export
from optimize.task import Task, run_task

FUZZ = settings(max_examples=int(os.environ.get("FUZZ_EXAMPLES", "60")), derandomize=True)
if "FUZZ_EXAMPLES" in os.environ:
    FUZZ = settings(FUZZ, derandomize=False)


@pytest.fixture(scope="module")
def good(scenes: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a study of two results."""
    path = tmp_path_factory.mktemp("store") / "good.sqlite"
    task = Task.of(scenes["both"], "random", 3, evaluations=20)
    result = replace(run_task(task), labels=(("physics.friction", 0.25), ("word", "=1+1")))
    study = open_store(path).begin("one", "sweep", {"evaluations": 20})
    study.add(result)
    study.add(replace(result, key="f" * 32))
    return path


def whole(path: Path) -> int:
    """All that a store holds, as every reader of it sees it; how many results."""
    store = open_store(path, create=False)
    number = 0
    for info in store.studies():
        study = store.study(info.name)
        for result in study.done().values():
            number += 1
            assert np.isfinite([result.score, result.uniform_score, result.mean_speed]).all()
            assert (result.spacing > 0.0).all()
        export(study, path.with_suffix(".csv"))
    return number


def test_the_store_as_it_is_holds_two_results(good: Path) -> None:
    assert whole(good) == 2


@FUZZ
@given(data=st.data())
def test_any_damaged_store_is_read_or_refused(good: Path, data: Any) -> None:
    path = good.with_name("damaged.sqlite")
    path.write_bytes(data.draw(mutated(good.read_bytes())))
    entered(whole, path)


_COLUMNS = {
    "studies": ("name", "kind", "settings", "begun", "number"),
    "results": (
        "study", "key", "scene", "scene_name", "method", "seed", "labels", "score",
        "uniform_score", "gain", "outcome", "mean_speed", "spacing", "thickness", "height",
        "evaluations", "falls", "seconds", "trace", "versions",
    ),
    "scenes": ("digest", "toml"),
    "domino_store": ("schema",),
}  # fmt: skip
_JSON = DEEP.map(json.dumps)
_WORDS = ["\x1b[2J", "=1+1", "a\nb", "[" * 5000, "[1e400]", "[" + "9" * 5000 + "]", "[-1]"]
_CELL: Any = st.one_of(
    ODD,
    _JSON,
    st.binary(max_size=20),
    st.sampled_from(_WORDS),
)


def tampered(good: Path, data: Any) -> Path:
    """The store with odd values in some cells."""
    path = good.with_name("tampered.sqlite")
    path.write_bytes(good.read_bytes())
    # closed whatever is drawn: what Hypothesis gives up half way would keep the file locked
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("PRAGMA synchronous = OFF")
        for _ in range(data.draw(st.integers(1, 2))):
            table = data.draw(st.sampled_from(sorted(_COLUMNS)))
            column = data.draw(st.sampled_from(_COLUMNS[table]))
            try:
                connection.execute(f"UPDATE {table} SET {column} = ?", (data.draw(_CELL),))
            except (sqlite3.Error, OverflowError, UnicodeEncodeError):
                continue  # what SQLite itself does not take
        connection.commit()
    return path


@settings(FUZZ, max_examples=FUZZ.max_examples // 2)
@given(data=st.data())
def test_any_tampered_store_is_read_or_refused(good: Path, data: Any) -> None:
    entered(whole, tampered(good, data))


@settings(FUZZ, max_examples=FUZZ.max_examples // 5)
@given(data=st.data())
def test_the_command_prints_no_escape_of_a_stranger(good: Path, data: Any) -> None:
    path = tampered(good, data)
    for words in (
        ["list"],
        ["show", "one"],
        ["export", "one", "--to", str(good.with_name("x.csv"))],
    ):
        out, err = io.StringIO(), io.StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            code = main(["studies", *words, "--store", str(path)])
        said = err.getvalue().removesuffix("\n")
        assert (code == 2) == bool(said)
        assert complaint(said, None) is None
        assert all(line.isprintable() for line in out.getvalue().split("\n")), out.getvalue()


# journals ---------------------------------------------------------------------------------------


def designs() -> np.ndarray:
    return np.linspace(0.0, 1.0, 12).reshape(3, 4)


@pytest.fixture(scope="module")
def journal(scenes: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """A scene and the journal of a search on it that asked twice."""
    path = tmp_path_factory.mktemp("journal") / "journal.bin"
    kept = Journal(path, scenes["both"], "random", 0, versions(), resume=False)
    kept.start()
    for k in range(2):
        kept.answer(("scores", designs() + k), lambda: (np.arange(3.0),))
    kept.close()
    return scenes["both"], path


def replayed(scene: Any, path: Path) -> list[np.ndarray]:
    """What the journal answers to the same two questions."""
    kept = Journal(path, scene, "random", 0, versions(), resume=True)
    try:
        return [
            kept.answer(("scores", designs() + k), lambda: (np.full(3, 7.0),))[0] for k in range(2)
        ]
    finally:
        kept.close()


@FUZZ
@given(data=st.data())
def test_any_damaged_journal_is_followed_or_refused(journal: Any, data: Any) -> None:
    scene, good = journal
    path = good.with_name("damaged.bin")
    path.write_bytes(data.draw(mutated(good.read_bytes())))
    for found in entered(lambda p: replayed(scene, p), path) or []:
        assert found.tolist() in ([0.0, 1.0, 2.0], [7.0, 7.0, 7.0])


def answered(payload: bytes, journal: tuple[Any, Path]) -> Any:
    """What a journal answers that was made, not damaged: its first record holds this payload."""
    scene, good = journal
    data = good.read_bytes()
    record = data.index(struct.pack("<I", 4 * 2 + 8 * 3)) - 12  # of the first answer
    head = data[record : record + 4] + struct.pack("<dI", 0.5, len(payload))
    crc = struct.pack("<I", zlib.crc32(payload, zlib.crc32(head)))
    path = good.with_name("made.bin")
    path.write_bytes(data[:record] + head + crc + payload)
    return entered(lambda p: replayed(scene, p), path)


@FUZZ
@given(payload=st.one_of(
    st.binary(max_size=60),
    st.tuples(st.integers(0, 2**32 - 1), st.lists(st.integers(0, 2**32 - 1), max_size=4)).map(
        lambda x: struct.pack(f"<I{len(x[1])}I", x[0], *x[1]) + bytes(24)
    ),
))  # fmt: skip
def test_any_record_with_a_right_checksum_is_followed_or_refused(
    journal: Any, payload: bytes
) -> None:
    found = answered(payload, journal)
    assert found is None or all(len(values) == 3 for values in found)


@pytest.mark.parametrize("array", [
    np.float64(7.0), np.zeros(0), np.zeros(4), np.zeros((3, 1)), np.array([0.0, np.nan, 1.0]),
    np.array([0.0, np.inf, 1.0]),
])  # fmt: skip
def test_a_record_of_another_shape_or_of_no_numbers_is_refused(journal: Any, array: Any) -> None:
    assert answered(_packed((array,)), journal) is None
    assert answered(_packed((np.arange(3.0), array)), journal) is None
    assert answered(_packed((np.arange(3.0),)), journal) is not None


def test_a_pipe_is_no_journal(journal: Any, tmp_path: Path) -> None:
    scene, _ = journal
    path = tmp_path / "journal.bin"
    os.mkfifo(path)
    assert entered(lambda p: replayed(scene, p), path) is None
