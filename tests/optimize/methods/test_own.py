"""User-defined methods: by name, as functions, in other processes."""

import sys
from pathlib import Path

import pytest

from domino_env.cli.main import main
from optimize import compare, search
from optimize.executors import ProcessExecutor
from optimize.methods.registry import load

MINE = """
import sys
import numpy as np

def run(evaluator, rng):
    while True:
        evaluator.evaluate(rng.random((7, evaluator.problem.dimension)))

def stubborn(evaluator, rng):
    while True:
        try:
            evaluator.evaluate(rng.random(evaluator.problem.dimension))
        except Exception:
            pass

def nothing(budget, rng):
    pass

def inside():
    return lambda budget, rng: None

number = 3
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch) -> Path:
    """The working folder, with a module in it; what Python has loaded is forgotten afterwards."""
    others = [path for path in sys.path if path == "" or (Path(path) / "my_methods.py").exists()]
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path not in others])
    (tmp_path / "my_methods.py").write_text(MINE)
    (tmp_path / "my_broken.py").write_text("import no_such_thing_here")
    (tmp_path / "my_typo.py").write_text("def run(")
    monkeypatch.chdir(tmp_path)
    for name in ("my_methods", "my_broken", "my_typo"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return tmp_path


def test_a_method_is_named_or_given(folder, scenes):
    named = search(scenes["spacing"], "my_methods:run", budget=40, seed=2)
    given = search(scenes["spacing"], sys.modules["my_methods"].run, budget=40, seed=2)
    assert named.method == given.method == "my_methods:run"
    assert named.evaluations == given.evaluations == 40
    assert named.layout == given.layout
    assert search(scenes["spacing"], lambda e, _: e.evaluate([0.4] * 6), budget=9).evaluations == 1


def test_a_method_that_catches_every_exception_ends(folder, scenes):
    result = search(scenes["spacing"], "my_methods:stubborn", budget=20)
    assert result.ended == "limit of 20 layouts reached"


def test_it_runs_in_other_processes(folder, scenes):
    """Spawned processes import it from the working folder."""
    chosen = [scenes["spacing"]], ["my_methods:run", "random"], range(1)
    here = compare(*chosen, budget=21)
    with ProcessExecutor(1) as executor:
        there = compare(*chosen, budget=21, executor=executor)
    assert not there.failures
    assert [r.score for r in there.results] == [r.score for r in here.results]
    given = compare([scenes["spacing"]], [load("my_methods:run")], range(1), budget=21)
    assert given.methods == ["my_methods:run"]
    assert given.results[0].score == here.results[0].score


@pytest.mark.parametrize(("method", "message"), [
    ("my_methodz:run", "No module named 'my_methodz'; name a function"),
    ("my_methods:runn", "has no attribute 'runn'; name a function"),
    ("my_methods:np", "it is not called as run(evaluator, rng)"),
    ("my_methods:number", "it is not called as run(evaluator, rng)"),
    ("my_methods:nothing", "'my_methods:nothing' ended without evaluating a layout"),
    ("my_broken:run", "No module named 'no_such_thing_here'"),
    ("my_typo:run", "'(' was never closed"),
    ("my_methods:", "method = 'my_methods:': choose one of auto, "),
])  # fmt: skip
def test_what_is_no_method_is_rejected_in_a_line(folder, capsys, method, message):
    assert main(["optimize", "sprint", "--method", method, "--budget", "9"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("domino: ")
    assert error.count("\n") == 1
    assert any(part in error for part in message.split("|"))


def test_what_other_processes_cannot_import_is_not_compared(folder, scenes):
    load("my_methods:run")
    method = sys.modules["my_methods"].inside()
    with pytest.raises(ValueError, match=r"cannot be imported from .*; name a function at the top"):
        compare([scenes["spacing"]], [method], range(1), budget=9)
