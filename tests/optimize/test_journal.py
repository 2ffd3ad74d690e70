"""A search that was stopped anywhere resumes bitwise, and simulates nothing twice."""

import errno
import os
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
from optimize.experiments.store import open_store
from optimize.journal import Journal
from optimize.methods.search import long_layouts
from optimize.run_folder import JOURNAL

pytestmark = pytest.mark.usefixtures("no_pictures")


@pytest.fixture(scope="module")
def problems(scenes):
    """A scene for each kind of request of a method."""
    tempo = replace(de.load_scene("tempo"), count=8)  # lateness
    return scenes | {"tempo": tempo, "stock": de.load_scene("stock")}


def stopped_after(batches: int):
    """Return a callback that ends a search as Ctrl-C does."""
    calls = count()

    def callback(_: Evaluator) -> None:
        if next(calls) == batches:
            raise KeyboardInterrupt

    return callback


CASES = [(method, "both") for method in METHODS if method != "assign"]
CASES += [("assign", "stock"), ("auto", "dying"), ("l-bfgs", "dying"), ("gauss-newton", "tempo")]
CASES += [("scp", "length"), ("cma", "length")]


@pytest.mark.parametrize(("method", "name"), CASES)
def test_every_method_resumes_bitwise(bits, problems, tmp_path, method, name):
    words = (problems[name], method, 40, 3)
    batches: list[float] = []
    whole = search(*words, callback=lambda e: batches.append(e.progress))
    stops = np.random.default_rng(len(method)).integers(len(batches) + 1, size=2)
    for stop in sorted(stops.tolist()):
        search(*words, folder=tmp_path, resume=True, callback=stopped_after(stop))
    assert bits(search(*words, folder=tmp_path, resume=True)) == bits(whole)


def test_the_best_layout_is_written_if_the_journal_cannot_be(problems, tmp_path, monkeypatch):
    save, calls = Journal._save, count()

    def save_once(journal):
        if next(calls):
            raise ValueError("no space left")
        save(journal)

    monkeypatch.setattr(Journal, "_save", save_once)
    with pytest.raises(ValueError, match="no space left"):
        search(problems["both"], "random", 20, folder=tmp_path)
    lines = (tmp_path / "layout.csv").read_text("utf-8").splitlines()
    assert len(lines) == 1 + problems["both"].count


def test_known_answers_are_not_simulated_again(bits, problems, simulated, tmp_path):
    words = (problems["both"], "auto", 300, 1)
    first = search(*words, folder=tmp_path, callback=stopped_after(20))
    assert first.interrupted
    problems["both"].uniform()
    simulated.clear()
    resumed = search(*words, folder=tmp_path, resume=True)
    # the request that Ctrl-C interrupted has its answer
    assert len(simulated) == resumed.evaluations - first.evaluations
    simulated.clear()
    assert bits(search(*words, folder=tmp_path, resume=True)) == bits(resumed)
    assert not simulated


@pytest.mark.parametrize("method", ["auto", "cma", "powell"])
def test_a_larger_budget_continues_a_finished_search(bits, problems, simulated, tmp_path, method):
    whole = search(problems["dying"], method, 300, seed=2)
    assert search(problems["dying"], method, 123, 2, folder=tmp_path).evaluations == 123
    simulated.clear()
    further = search(problems["dying"], method, 300, seed=2, folder=tmp_path, resume=True)
    assert bits(further) == bits(whole)
    # at most the batch that the first budget cut short again
    assert len(simulated) < 300 - 123 + 130


def test_a_search_of_long_layouts_resumes_bitwise_and_beats_uniform(bits, monkeypatch, tmp_path):
    """It stretches shorter layouts, which count by their dominoes."""
    monkeypatch.setattr(long_layouts, "SHORT_EVALUATIONS", 40)
    scene = replace(de.load_scene("marathon"), count=512)
    expected = search(scene, budget=36, seed=3)
    assert expected.evaluations == 36
    assert expected.gain > 0.02  # uniform layouts start slowly or are slow
    search(scene, budget=28, seed=3, folder=tmp_path)
    assert bits(search(scene, budget=36, seed=3, folder=tmp_path, resume=True)) == bits(expected)


def test_a_search_of_long_layouts_ends_when_a_round_gains_little(monkeypatch):
    """Its refinement; here every gain is little."""
    monkeypatch.setattr(long_layouts, "SHORT_EVALUATIONS", 40)
    monkeypatch.setattr(long_layouts, "LEAST_GAIN", 1.0)
    result = search(replace(de.load_scene("marathon"), count=512), seed=3)
    assert result.stop_reason.startswith("done: a stretched and refined layout")
    assert long_layouts.ROUND_GRADIENTS <= result.evaluations < 40
    assert result.gain > 0.02


def test_a_killed_process_resumes_bitwise(bits, problems, tmp_path):
    scene = problems["both"]
    (tmp_path / "both.toml").write_text(scene.to_toml())
    words = ["optimize", tmp_path / "both.toml", "--method", "random", "--budget", 4_000_000]
    command = [sys.executable, "-m", "domino_env", *words, "--out", tmp_path / "run"]
    process = subprocess.Popen([*map(str, command)], stdout=subprocess.DEVNULL)
    journal = tmp_path / "run" / f"{JOURNAL}-wal"
    while not journal.exists() or journal.stat().st_size < 100_000:  # some answers
        assert process.poll() is None
        time.sleep(0.01)
    process.kill()
    process.wait(60)
    again = search(scene, "random", 40_000, folder=tmp_path / "run", resume=True)
    assert bits(again) == bits(search(scene, "random", 40_000))


def test_a_resumed_search_continues_its_seconds(problems, tmp_path):
    def run(seconds: float):
        ticks = count()  # a clock that advances by a second whenever it is read
        options = {"folder": tmp_path, "resume": True, "clock": lambda: float(next(ticks))}
        return search(problems["both"], "random", seconds=seconds, **options)

    first, second = run(400.0), run(800.0)
    assert 400.0 <= first.seconds < 410.0
    assert 800.0 <= second.seconds < 810.0
    assert second.evaluations > first.evaluations
    shared = len(first.trace) - 1
    assert [s[::3] for s in second.trace[:shared]] == [s[::3] for s in first.trace[:-1]]


def swap_a_bit(answer: bytes) -> bytes:
    return answer[:-9] + bytes([answer[-9] ^ 1]) + answer[-8:]


@pytest.mark.parametrize(
    "change",
    ["answer = substr(answer, 9)", "answer = swap_a_bit(answer)", "seconds = seconds + 1.0"],
)
def test_a_damaged_journal_is_rejected(problems, tmp_path, change):
    words = (problems["both"], "random", 30)
    search(*words, folder=tmp_path)
    with closing(sqlite3.connect(tmp_path / JOURNAL)) as database:
        database.create_function("swap_a_bit", 1, swap_a_bit)
        database.execute(f"UPDATE answers SET {change}")
        database.commit()
    with pytest.raises(ValueError, match=r"cannot be used .*begin anew in another"):
        search(*words, folder=tmp_path, resume=True)


def test_two_searches_do_not_write_one_journal(tmp_path):
    first = Journal(tmp_path / "j", "any", resume=False)
    for resume in (True, False):
        with pytest.raises(ValueError, match=r"is locked.*: end the search that still writes it"):
            Journal(tmp_path / "j", "any", resume=resume)
    first.close()


def test_a_file_system_without_locks_is_named(monkeypatch, tmp_path):
    fcntl = pytest.importorskip("fcntl", reason="no locks of POSIX there")

    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "lockf", refuse)
    message = r"refuses locks \(No locks available\): name a folder"
    with pytest.raises(ValueError, match=message):
        Journal(tmp_path / "j", "any", resume=False)
    with pytest.raises(ValueError, match=message):
        open_store(tmp_path / "s")
    assert not any(tmp_path.iterdir())
