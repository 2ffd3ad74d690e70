"""Logs for IOHanalyzer: what was searched is in them, and they are as IOHexperimenter's own."""

from __future__ import annotations

import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from domino_env.cli.main import main
from optimize import Problem, Task, open_store
from optimize.studies.ioh_logs import WORST, write_ioh
from optimize.studies.task import run_task

SEEDS = (0, 1)
ROWS = 40


def one_by_one(budget, rng) -> None:
    """A method whose every row is an evaluation of its own."""
    while True:
        budget.score(rng.random(budget.problem.dimension))


def read(folder: Path) -> tuple[dict, list[np.ndarray]]:
    """The JSON file of a folder, and the columns evaluations and raw_y of each run's table."""
    (path,) = folder.glob("*.json")
    about = json.loads(path.read_text("utf-8"))
    (scenario,) = about["scenarios"]
    head, *lines = (folder / scenario["path"]).read_text("utf-8").splitlines()
    assert head.split() == about["attributes"]
    runs: list[list[list[float]]] = [[]]
    for line in lines:
        if line == head:
            runs.append([])
        else:
            runs[-1].append([float(word) for word in line.split()[:2]])
    return about, [np.array(run) for run in runs]


def test_the_logs_are_as_the_logger_of_the_field_writes_them(scenes, tmp_path, monkeypatch) -> None:
    ioh = pytest.importorskip("ioh", reason="needs ioh, whose logger is the reference")
    monkeypatch.setattr("optimize.methods.registry.load", lambda _: one_by_one)
    scene = replace(scenes["spacing"], name="row")
    problem = Problem(scene)
    results = [run_task(Task.of(scene, "mine:run", seed, evaluations=ROWS)) for seed in SEEDS]
    with (tmp_path / "ours.zip").open("wb") as file:
        write_ioh(results[::-1], file)
    zipfile.ZipFile(tmp_path / "ours.zip").extractall(tmp_path / "ours")

    bounds = {"dimension": 6, "lb": 0.0, "ub": 1.0}
    bigger = ioh.OptimizationType.MAX
    logged = ioh.wrap_problem(problem.score, "row", optimization_type=bigger, **bounds)
    logger = ioh.logger.Analyzer(
        root=str(tmp_path), folder_name="theirs", algorithm_name="mine:run"
    )
    logged.attach_logger(logger)
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        for _ in range(ROWS):
            logged(rng.random(6))
        logged.reset()
    logger.close()

    ours, our_runs = read(tmp_path / "ours" / "mine-run")
    theirs, their_runs = read(tmp_path / "theirs")
    assert set(theirs) <= set(ours)
    for key in ("version", "function_name", "maximization"):
        assert ours[key] == theirs[key]
    assert ours["algorithm"]["name"] == theirs["algorithm"]["name"]
    assert ours["attributes"][:2] == theirs["attributes"]
    (ours,), (theirs,) = ours["scenarios"], theirs["scenarios"]
    assert ours["dimension"] == theirs["dimension"]
    for mine, its in zip(ours["runs"], theirs["runs"], strict=True):
        assert mine["instance"] == its["instance"]
        assert mine["evals"] == its["evals"] == ROWS
        assert mine["best"]["evals"] == its["best"]["evals"]
        assert mine["best"]["y"] == pytest.approx(its["best"]["y"], abs=1e-9)
        assert mine["best"]["x"] == pytest.approx(its["best"]["x"], abs=1e-6)
    for mine, its in zip(our_runs, their_runs, strict=True):
        # their last line gives the last row's own score, ours the best so far
        assert mine == pytest.approx(np.maximum.accumulate(its), abs=1e-9)


def test_the_command_writes_a_folder_for_each_method(scenes, tmp_path: Path, capsys) -> None:
    study = open_store(tmp_path / "s.sqlite").begin("s", "comparison", {})
    result = run_task(Task.of(scenes["both"], "random", 3, evaluations=300))
    study.add(result)
    study.add(replace(result, key="1" * 32, method="a:b"))
    study.add(replace(result, key="2" * 32, method="a b"))
    file = tmp_path / "logs.zip"
    words = ["studies", "export", "s", "--to", str(file), "--store", str(tmp_path / "s.sqlite")]
    assert main(words) == 0
    assert capsys.readouterr().out == f"written to {file}: 3 results\n"
    zipfile.ZipFile(file).extractall(tmp_path)
    for folder, method in (("random", "random"), ("a-b-2", "a:b"), ("a-b-3", "a b")):
        about, (run,) = read(tmp_path / folder)
        assert about["algorithm"]["name"] == method
        assert run[0].tolist() == [1, WORST]
        assert run[1:].tolist() == [[n, score] for n, _, _, score in result.trace[:-1]] + [
            [300, result.trace[-1][3]]
        ] * (result.trace[-2][0] < 300)
