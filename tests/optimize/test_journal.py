"""A search that was stopped anywhere resumes to the same bits, and simulates nothing twice."""

import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from itertools import count

import numpy as np
import pytest

import domino_env as de
from optimize import METHODS, Evaluator, search
from optimize.journal import Journal
from optimize.result import SearchResult
from optimize.run_folder import JOURNAL

FEW = 60  # evaluations
pytestmark = pytest.mark.usefixtures("no_pictures")


@pytest.fixture(scope="module")
def problems(scenes):
    """A scene for each kind of question that a method can ask."""
    tempo = replace(de.load_scene("tempo"), count=8)  # lateness
    return scenes | {"tempo": tempo, "stock": de.load_scene("stock")}


def plain(result: SearchResult) -> list[object]:
    """Everything but times."""
    trace = [(n, f, s) for n, f, _, s in result.trace]
    spent = result.evaluations, result.falls, result.interrupted
    return [result.layout, result.score, spent, trace]


def stopped_after(batches: int):
    """A callback that ends a search as Ctrl-C does."""
    left = [batches]

    def callback(_: Evaluator) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt

    return callback


def simulated(monkeypatch) -> list[int]:
    """From now on, the number of design vectors of each simulation."""
    found: list[int] = []
    before = de.Scene.evaluate

    def counted(scene, batch, **more):
        found.append(len(batch))
        return before(scene, batch, **more)

    monkeypatch.setattr(de.Scene, "evaluate", counted)
    return found


CASES = [(method, "both") for method in METHODS if method != "assign"]
CASES += [("assign", "stock"), ("auto", "dying"), ("l-bfgs", "dying"), ("gauss-newton", "tempo")]
CASES += [("scp", "length"), ("cma", "length")]


@pytest.mark.parametrize(("method", "name"), CASES)
def test_every_method_resumes_to_the_same_bits(problems, tmp_path, method, name):
    scene = problems[name]
    batches: list[float] = []
    whole = search(scene, method, FEW, seed=3, callback=lambda e: batches.append(e.progress))
    rng = np.random.default_rng(len(method))
    # stopped, stopped again, then left alone
    first = int(rng.integers(len(batches) + 1))
    second = int(rng.integers(first, len(batches) + 1))
    for stop in (first, second):
        search(scene, method, FEW, 3, folder=tmp_path, resume=True, callback=stopped_after(stop))
    again = search(scene, method, FEW, seed=3, folder=tmp_path, resume=True)
    assert plain(again) == plain(whole)


def test_what_is_known_is_not_simulated_again(problems, monkeypatch, tmp_path):
    words = (problems["both"], "auto", 400, 1)
    cut = search(*words, folder=tmp_path, callback=stopped_after(20))
    assert cut.interrupted
    problems["both"].uniform()
    found = simulated(monkeypatch)
    again = search(*words, folder=tmp_path, resume=True)
    warming = 2  # one score and one gradient that compile
    # what was asked for when Ctrl-C came had been answered
    assert sum(found) - warming == again.evaluations - cut.evaluations
    found.clear()
    assert plain(search(*words, folder=tmp_path, resume=True)) == plain(again)
    assert sum(found) == warming


@pytest.mark.parametrize("method", ["auto", "cma", "powell"])
def test_a_larger_budget_continues_a_finished_search(problems, monkeypatch, tmp_path, method):
    whole = search(problems["dying"], method, 300, seed=2)
    assert search(problems["dying"], method, 123, 2, folder=tmp_path).evaluations == 123
    found = simulated(monkeypatch)
    further = search(problems["dying"], method, 300, seed=2, folder=tmp_path, resume=True)
    assert plain(further) == plain(whole)
    assert sum(found) < 300 - 123 + 130  # at most the batch that the first budget cut short again


def test_a_process_that_is_killed_resumes_to_the_same_bits(problems, tmp_path):
    scene = problems["both"]
    (tmp_path / "both.toml").write_text(scene.to_toml())
    words = ["optimize", tmp_path / "both.toml", "--method", "random", "--budget", 40_000]
    command = [sys.executable, "-m", "domino_env", *words, "--out", tmp_path / "run"]
    process = subprocess.Popen([*map(str, command)], stdout=subprocess.DEVNULL)
    while not (tmp_path / "run" / "summary.json").exists():
        assert process.poll() is None
        time.sleep(0.01)
    time.sleep(0.2)
    process.kill()
    process.wait(60)
    assert scene.violations(de.Layout.read(tmp_path / "run" / "layout.csv")) == []
    again = search(scene, "random", 40_000, folder=tmp_path / "run", resume=True)
    assert plain(again) == plain(search(scene, "random", 40_000))


def test_seconds_continue_from_where_they_were(problems, tmp_path):
    def run(seconds: float) -> SearchResult:
        ticks = count()  # a clock that advances by a second whenever it is read
        how = {"folder": tmp_path, "resume": True, "clock": lambda: float(next(ticks))}
        return search(problems["both"], "random", seconds=seconds, **how)

    first, second = run(400.0), run(800.0)
    assert 400.0 <= first.seconds < 410.0
    assert 800.0 <= second.seconds < 810.0
    assert second.evaluations > first.evaluations
    shared = len(first.trace) - 1
    assert [s[::3] for s in second.trace[:shared]] == [s[::3] for s in first.trace[:-1]]


def test_answers_of_another_scene_are_not_used(problems, tmp_path):
    """A journal without the other files of its run, beside another scene."""
    words = ("random", 30)
    search(problems["both"], *words, folder=tmp_path / "one")
    (tmp_path / "two").mkdir()
    (tmp_path / "one" / JOURNAL).rename(tmp_path / "two" / JOURNAL)
    scene = replace(problems["both"], physics=de.Physics(0.3))
    again = search(scene, *words, folder=tmp_path / "two", resume=True)
    assert plain(again) == plain(search(scene, *words))


@pytest.mark.parametrize("damage", ["no database", "zeroblob(9)", "substr(answer, 9)"])
def test_a_damaged_journal_is_refused(problems, tmp_path, damage):
    words = (problems["both"], "random", 30)
    search(*words, folder=tmp_path)
    path = tmp_path / JOURNAL
    if damage == "no database":
        path.write_bytes(b"PK\3\4" * 99)
    else:
        with closing(sqlite3.connect(path)) as database:
            database.execute(f"UPDATE answers SET answer = {damage}")
            database.commit()
    with pytest.raises(ValueError, match=r"cannot be used .*begin anew in another"):
        search(*words, folder=tmp_path, resume=True)


def test_a_full_disk_ends_a_search_that_resumes(problems, monkeypatch, tmp_path):
    words = (problems["both"], "auto", 300, 1)
    connect = sqlite3.connect

    class Full(sqlite3.Connection):
        def executemany(self, *_: object) -> sqlite3.Cursor:
            raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr("sqlite3.connect", lambda path, **kw: connect(path, factory=Full, **kw))
        with pytest.raises(ValueError, match=r"disk is full\).*make room"):
            search(*words, folder=tmp_path)
    assert plain(search(*words, folder=tmp_path, resume=True)) == plain(search(*words))


def test_two_searches_do_not_write_one_journal(tmp_path):
    first = Journal(tmp_path / "j", "any", resume=False)
    for resume in (True, False):
        with pytest.raises(ValueError, match=r"is locked.*: end the search that still writes it"):
            Journal(tmp_path / "j", "any", resume=resume)
    first.close()
