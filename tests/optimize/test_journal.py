"""A search that was stopped anywhere goes on to the same bits, and simulates nothing twice."""

from __future__ import annotations

import sqlite3
import zlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.core.results import versions
from optimize import METHODS, search
from optimize.evaluator import Budget
from optimize.journal import PAGE, Journal
from optimize.problem import Problem
from optimize.recorder import Recorder
from optimize.result import SearchResult
from optimize.run_folder import FILES, JOURNAL

FEW = 60  # evaluations


@pytest.fixture(scope="module")
def problems(scenes):
    """A scene for each kind of question that a method can ask."""
    tempo = replace(de.load_scene("tempo"), count=8)
    return {
        "both": scenes["both"],
        "dying": scenes["dying"],  # gradients by differences: questions within questions
        "length": scenes["length"],
        "tempo": tempo,  # lateness
        "stock": de.load_scene("stock"),
    }


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch) -> None:
    """They take longer than these searches."""
    monkeypatch.setattr("optimize.picture.draw", lambda result, path: path.write_bytes(b""))


def same(one: SearchResult, two: SearchResult) -> bool:
    """Whether two results agree to the bit, but for times."""
    plain = [
        (
            r.layout, r.score, r.evaluations, r.falls, r.slopes, r.interrupted,
            [(n, f, s) for n, f, _, s in r.trace],
        )
        for r in (one, two)
    ]  # fmt: skip
    return plain[0] == plain[1]


def forget_the_row(folder: Path) -> None:
    """Leave nothing of a run but its journal, which a new one may replace."""
    for name in FILES:
        (folder / name).unlink(missing_ok=True)


def stopped_after(batches: int):
    """A watch that ends a search as Ctrl-C does."""
    left = [batches]

    def watch(budget: Budget) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt

    return watch


def simulated(monkeypatch) -> list[int]:
    """From now on, the number of designs of each simulation."""
    found: list[int] = []
    before = de.Scene.evaluate

    def counted(scene, batch, gradient=False):
        found.append(len(batch))
        return before(scene, batch, gradient)

    monkeypatch.setattr(de.Scene, "evaluate", counted)
    return found


CASES = [(method, "both") for method in METHODS if method != "assign"]
CASES += [("assign", "stock"), ("auto", "dying"), ("l-bfgs", "dying"), ("gauss-newton", "tempo")]
CASES += [("scp", "length"), ("cma", "length")]


@pytest.mark.parametrize(("method", "name"), CASES)
def test_every_method_goes_on_to_the_same_bits(
    problems, tmp_path: Path, method: str, name: str
) -> None:
    scene = problems[name]
    batches: list[float] = []
    whole = search(scene, method, FEW, seed=3, watch=lambda budget: batches.append(budget.part))
    rng = np.random.default_rng(len(method))
    # stopped, stopped again, then left alone
    first = int(rng.integers(len(batches) + 1))
    second = int(rng.integers(first, len(batches) + 1))
    for stop in (first, second):
        search(scene, method, FEW, 3, folder=tmp_path, resume=True, watch=stopped_after(stop))
    again = search(scene, method, FEW, seed=3, folder=tmp_path, resume=True)
    assert same(again, whole)


def test_what_is_known_is_not_simulated_again(problems, monkeypatch, tmp_path: Path) -> None:
    words = (problems["both"], "auto", 400, 1)
    cut = search(*words, folder=tmp_path, watch=stopped_after(20))
    assert cut.interrupted
    problems["both"].uniform()
    found = simulated(monkeypatch)
    again = search(*words, folder=tmp_path, resume=True)
    warming = 2  # one score and one gradient that compile
    # what was asked for when Ctrl-C came had been answered
    assert sum(found) - warming == again.evaluations - cut.evaluations
    found.clear()
    finished = search(*words, folder=tmp_path, resume=True)
    assert sum(found) == warming
    assert same(finished, again)


@pytest.mark.parametrize("method", ["auto", "cma", "powell"])
def test_a_larger_budget_goes_on_with_a_finished_search(
    problems, monkeypatch, tmp_path: Path, method: str
) -> None:
    whole = search(problems["dying"], method, 300, seed=2)
    first = search(problems["dying"], method, 123, seed=2, folder=tmp_path)
    assert first.evaluations == 123
    found = simulated(monkeypatch)
    further = search(problems["dying"], method, 300, seed=2, folder=tmp_path, resume=True)
    assert same(further, whole)
    assert sum(found) < 300 - 123 + 130  # at most the batch that the first budget cut short again


def test_a_journal_torn_by_a_kill_goes_on_from_its_last_whole_answers(
    problems, monkeypatch, tmp_path: Path
) -> None:
    """The files as they are in the middle of a search, the end of the log half written."""
    monkeypatch.setattr("optimize.journal.PAUSE", 0.0)
    words = (problems["both"], "l-bfgs", 40, 0)
    rng = np.random.default_rng(0)
    copies: list[Path] = []

    def watch(budget: Budget) -> None:
        copy = tmp_path / f"copy{len(copies)}"
        copy.mkdir()
        for file in (tmp_path / "whole").glob(f"{JOURNAL}*"):
            data = file.read_bytes()
            torn = file.name.endswith("-wal") and len(copies) % 2
            (copy / file.name).write_bytes(
                data[: int(rng.integers(len(data) + 1)) if torn else None]
            )
        copies.append(copy)

    whole = search(*words, folder=tmp_path / "whole", watch=watch)
    for copy in copies[::3]:
        assert sorted(f.name for f in copy.iterdir()) == [JOURNAL, f"{JOURNAL}-wal"]
        assert same(search(*words, folder=copy, resume=True), whole)
        assert not (copy / f"{JOURNAL}-wal").exists()


def test_half_a_journal_and_a_damaged_one_are_followed_or_refused(problems, tmp_path: Path) -> None:
    words = (problems["both"], "l-bfgs", 400, 0)
    whole = search(*words, folder=tmp_path)
    data = (tmp_path / JOURNAL).read_bytes()
    rng = np.random.default_rng(0)
    damaged = [data[:end] for end in (*range(1, len(data), len(data) // 9), len(data) - 100)]
    for place in rng.integers(100, len(data), 20):
        damaged.append(bytearray(data))
        damaged[-1][place] ^= 1 << int(rng.integers(8))
    refused = 0
    for wrong in damaged:
        (tmp_path / JOURNAL).write_bytes(wrong)
        try:
            assert same(search(*words, folder=tmp_path, resume=True), whole)
        except ValueError as error:
            assert str(error).endswith("begin anew in another folder, without --resume")  # noqa: PT017
            refused += 1
    assert refused
    forget_the_row(tmp_path)
    assert same(search(*words, folder=tmp_path), whole)


def test_a_full_disk_costs_the_journal_and_not_the_search(
    problems, monkeypatch, tmp_path: Path, capsys
) -> None:
    """A database that may not grow is told what it is told by a disk that is full."""
    words = (problems["both"], "auto", 300, 1)
    whole = search(*words)
    monkeypatch.setattr("optimize.journal.PAUSE", 0.0)
    monkeypatch.setattr("optimize.journal.LARGEST", 4 * PAGE)
    assert same(search(*words, folder=tmp_path), whole)
    said = capsys.readouterr().err
    assert f"{JOURNAL} ends here (database or disk is full): the search goes on without" in said
    assert said.count("\n") == 1
    assert (tmp_path / JOURNAL).stat().st_size <= 4 * PAGE
    monkeypatch.setattr("optimize.journal.LARGEST", 2**30)
    assert same(search(*words, folder=tmp_path, resume=True), whole)
    assert (tmp_path / JOURNAL).stat().st_size > 4 * PAGE


@pytest.mark.parametrize("resume", [False, True])
def test_a_folder_that_cannot_have_a_journal_does_without(
    problems, monkeypatch, tmp_path: Path, capsys, resume: bool
) -> None:
    words = (problems["both"], "auto", 300, 1)
    whole = search(*words)

    def connect(path: Path, **_: object) -> None:
        raise sqlite3.OperationalError("locking protocol")

    monkeypatch.setattr("sqlite3.connect", connect)
    assert same(search(*words, folder=tmp_path, resume=resume), whole)
    said = capsys.readouterr().err
    assert "cannot be written (locking protocol): the search goes without a journal" in said
    assert said.count("\n") == 1
    assert not (tmp_path / JOURNAL).exists()


def test_seconds_go_on_from_where_they_were(problems, tmp_path: Path) -> None:
    words = (problems["both"], "random")
    first = search(*words, seconds=0.4, folder=tmp_path)
    second = search(*words, seconds=0.8, folder=tmp_path, resume=True)
    assert 0.4 <= first.seconds <= 0.8 <= second.seconds < 1.5
    assert second.evaluations > first.evaluations
    times = [t for _, _, t, _ in second.trace]
    assert times == sorted(times)
    assert [s[::3] for s in second.trace[: len(first.trace) - 1]] == [
        s[::3] for s in first.trace[:-1]
    ]
    third = search(*words, seconds=0.8, folder=tmp_path, resume=True)
    assert third.evaluations <= second.evaluations + 20_000  # there was hardly any time left


def test_an_executor_changes_nothing(problems, tmp_path: Path, monkeypatch) -> None:
    words = (problems["both"], "random", 60_000, 1)
    whole = search(*words)
    monkeypatch.setattr("optimize.bulk.TASK", 6_000)
    with ThreadPoolExecutor(2) as pool:
        cut = search(*words, folder=tmp_path, executor=pool, watch=stopped_after(100))
        assert cut.evaluations < 60_000
        assert same(search(*words, folder=tmp_path, executor=pool, resume=True), whole)


@pytest.mark.parametrize(("change", "message"), [
    ({"method": "random"}, "with method = 'cma', not 'random'"),
    ({"seed": 8}, "with seed = 7, not 8"),
    ({"scene": "length"}, "with name = 'both', not "),
    ({"scene": "other"}, "on another scene 'both'"),
], ids=lambda c: str(c)[:20])  # fmt: skip
def test_the_journal_of_another_search_is_refused(
    problems, tmp_path: Path, change: dict, message: str
) -> None:
    search(problems["both"], "cma", 30, seed=7, folder=tmp_path)
    before = {f.name: f.read_bytes() for f in tmp_path.iterdir()}
    asked = {"scene": "both", "method": "cma", "seed": 7} | change
    scene = replace(problems["both"], count=7) if asked["scene"] == "other" else None
    with pytest.raises(ValueError, match=message) as error:
        search(
            scene or problems[asked["scene"]], asked["method"], 30, asked["seed"],
            folder=tmp_path, resume=True,
        )  # fmt: skip
    assert str(error.value).endswith("begin anew in another folder, without --resume")
    assert {f.name: f.read_bytes() for f in tmp_path.iterdir()} == before


def test_a_method_that_asks_something_else_is_an_error(
    problems, monkeypatch, tmp_path: Path
) -> None:
    words = (problems["both"], "random", 1000, 1)
    search(*words, folder=tmp_path)
    before = (tmp_path / JOURNAL).read_bytes()

    def run(budget: Budget, rng: np.random.Generator) -> None:
        while True:
            budget.scores(np.nextafter(rng.random((64, budget.problem.dimension)), 1.0))

    monkeypatch.setattr("optimize.methods.registry.load", lambda name: run)
    with pytest.raises(ValueError, match=r"asked something else after .* s: the programs or"):
        search(*words, folder=tmp_path, resume=True)
    assert (tmp_path / JOURNAL).read_bytes() == before


def test_what_is_no_journal_is_refused(problems, tmp_path: Path) -> None:
    path = tmp_path / JOURNAL
    other = sqlite3.connect(tmp_path / "other")
    other.execute("CREATE TABLE mine (a)")
    other.commit()
    other.close()
    for data in (b"PK\3\4" * 99, (tmp_path / "other").read_bytes()):
        (tmp_path / "other").unlink(missing_ok=True)
        path.write_bytes(data)
        with pytest.raises(ValueError, match="is no journal of a search: begin anew in another"):
            search(problems["both"], "random", 30, folder=tmp_path, resume=True)
        forget_the_row(tmp_path)
        assert search(problems["both"], "random", 30, folder=tmp_path).evaluations == 30  # anew
        assert search(problems["both"], "random", 30, folder=tmp_path, resume=True)
    later = sqlite3.connect(path)
    later.execute("PRAGMA user_version = 9")
    later.close()
    with pytest.raises(ValueError, match="is a journal of another version: begin anew"):
        search(problems["both"], "random", 30, folder=tmp_path, resume=True)


def test_the_journal_of_version_0_1_0_is_refused_with_what_to_do(problems, tmp_path: Path) -> None:
    search(problems["both"], "random", 30, folder=tmp_path)
    (tmp_path / JOURNAL).rename(tmp_path / "journal.bin")
    with pytest.raises(ValueError, match=r"journal\.bin was written by .*: begin anew"):
        search(problems["both"], "random", 30, folder=tmp_path, resume=True)


def test_answers_of_other_shapes_are_refused(problems, tmp_path: Path) -> None:
    words = (problems["both"], "random", 30)
    search(*words, folder=tmp_path)
    for change in ("zeroblob(length(answer) + 8)", "zeroblob(1)", "zeroblob(0)"):
        database = sqlite3.connect(tmp_path / JOURNAL)
        database.create_function("crc32", 2, zlib.crc32)
        database.execute(f"UPDATE answers SET answer = {change}")
        database.execute("UPDATE answers SET crc = crc32(answer, question)")
        database.commit()
        database.close()
        with pytest.raises(ValueError, match="is damaged: begin anew in another folder"):
            search(*words, folder=tmp_path, resume=True)


def test_other_versions_are_refused_by_name(problems, monkeypatch, tmp_path: Path) -> None:
    search(problems["both"], "random", 30, folder=tmp_path)
    monkeypatch.setattr("optimize.searching.versions", lambda: versions() | {"numpy": "1.0"})
    with pytest.raises(ValueError, match=r"with versions = .*numpy 2.*, not .*numpy 1\.0"):
        search(problems["both"], "random", 30, folder=tmp_path, resume=True)


def test_two_searches_do_not_write_into_one_folder(problems, tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    words = (problems["both"], "random", 2000)
    refused: list[str] = []

    def second(budget: Budget) -> None:
        if not refused:
            with pytest.raises(ValueError, match="by a search that still runs") as error:
                search(*words, folder=tmp_path, resume=True)
            refused.append(str(error.value))

    assert same(search(*words, folder=tmp_path, watch=second), search(*words))
    assert refused


def test_answers_are_those_of_the_questions(problems, tmp_path: Path) -> None:
    """Every kind of question, answered from the file as by simulation, to the bit."""
    scene = problems["tempo"]
    rng = np.random.default_rng(5)
    designs = rng.random((9, Problem(scene).dimension))

    def asked(journal: Journal | None) -> list[np.ndarray]:
        budget = Budget(Recorder(Problem(scene), journal))
        found = [budget.scores(designs), budget.scores(designs, 1e-9)]
        found += budget.scores_and_gradients(designs)
        found += budget.scores_and_gradients(designs, at_will=True)
        found += [np.asarray(part) for part in budget.lateness(designs[0])]
        return [*found, np.array([budget.spent, budget.falls])]

    truth = asked(None)
    for resume in (False, True):
        journal = Journal(tmp_path / "j", scene, "any", 0, {}, resume=resume)
        assert journal.replaying == resume
        found = asked(journal)
        journal.close()
        assert all(a.tobytes() == b.tobytes() for a, b in zip(found, truth, strict=True))
        assert all(array.flags.writeable for array in found)
    with pytest.raises(ValueError, match="name the folder"):
        search(scene, resume=True)
