"""User-defined methods: by name, as functions, in other processes."""

import sys
from pathlib import Path

import numpy as np
import pytest

from optimize import compare, search
from optimize.executors import ExecutorLost, ProcessExecutor
from optimize.methods.registry import load

MINE = """
import sys
from concurrent.futures import ThreadPoolExecutor
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

def leave(evaluator, rng):
    sys.exit("gone")

def threads(evaluator, rng):
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(evaluator.evaluate, rng.random((40, evaluator.problem.dimension))))

class Searcher:
    def run(self, evaluator, rng):
        run(evaluator, rng)

bound = Searcher().run
number = 3
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch) -> Path:
    """The working folder, with modules that are unloaded afterwards."""
    paths = [p for p in sys.path if p and not (Path(p) / "my_methods.py").exists()]
    monkeypatch.setattr(sys, "path", paths)
    (tmp_path / "my_methods.py").write_text(MINE)
    (tmp_path / "my_broken.py").write_text("import no_such_thing_here")
    (tmp_path / "my_typo.py").write_text("def run(")
    monkeypatch.chdir(tmp_path)
    for name in ("my_methods", "my_broken", "my_typo"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return tmp_path


def test_a_method_is_given_by_name_or_as_a_function(folder, scenes):
    by_name = search(scenes["spacing"], "my_methods:run", budget=40, seed=2)
    by_function = search(scenes["spacing"], sys.modules["my_methods"].run, budget=40, seed=2)
    assert by_name.method == by_function.method == "my_methods:run"
    assert by_name.evaluations == by_function.evaluations == 40
    assert by_name.layout == by_function.layout
    assert search(scenes["spacing"], lambda e, _: e.evaluate([0.4] * 6), budget=9).evaluations == 1


def test_a_method_that_catches_every_exception_ends(folder, scenes):
    result = search(scenes["spacing"], "my_methods:stubborn", budget=20)
    assert result.stop_reason == "limit of 20 layouts reached"


@pytest.mark.usefixtures("no_pictures")
def test_a_method_may_evaluate_in_threads(folder, scenes):
    result = search(scenes["spacing"], "my_methods:threads", budget=30, folder=folder / "run")
    assert result.evaluations == 30


def test_a_method_runs_in_other_processes(folder, scenes):
    """Spawned processes import it from the working folder."""
    seeds = np.arange(2)
    local = compare([scenes["spacing"]], ["my_methods:run"], seeds, np.int64(21))
    methods = [load("my_methods:run"), "my_methods:leave"]
    with ProcessExecutor(1) as executor:
        remote = compare([scenes["spacing"]], methods, seeds, 21, executor=executor)
    reason = "SystemExit gone: end a method by `return`"
    assert [failure.reason for failure in remote.failures] == [reason] * 2
    with pytest.raises(ExecutorLost, match="after shutdown"):
        compare([scenes["spacing"]], methods, seeds, 21, executor=executor)
    with pytest.raises(ValueError, match="method = 'rnd': choose one of my_methods:run"):
        remote.mean_score("rnd")
    assert remote.methods == ["my_methods:run"]
    assert [r.score for r in remote.results] == [r.score for r in local.results]


@pytest.mark.parametrize(("method", "message"), [
    ("my_methodz:run", "No module named 'my_methodz'; name a function"),
    ("my_methods:runn", "has no attribute 'runn'; name a function"),
    ("my_methods:number", "give a function run(evaluator, rng)"),
    ("my_methods:nothing", "'my_methods:nothing' ended without evaluating a layout"),
    ("my_broken:run", "No module named 'no_such_thing_here'"),
    ("my_typo:run", "'(' was never closed"),
    ("my_methods:leave", "SystemExit gone: end a method by `return` (in method 'my_meth"),
    ("my_methods:", "method = 'my_methods:': choose one of auto, "),
])  # fmt: skip
def test_impossible_methods_are_rejected_in_one_line(folder, error_of, method, message):
    assert message in error_of("optimize", "sprint", "--method", method, "--budget", 9)


def test_functions_that_other_processes_cannot_import_are_not_compared(folder, scenes):
    load("my_methods:run")
    inside, bound = (getattr(sys.modules["my_methods"], name) for name in ("inside", "bound"))
    for method in (inside(), bound):
        with pytest.raises(ValueError, match=r"name a function at the top|give a function run"):
            compare([scenes["spacing"]], [method], range(1), budget=9)
    assert search(scenes["spacing"], bound, budget=9).evaluations == 9
