"""A run's folder: whole files, and what is there replaced by nothing that is less."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from optimize import search
from optimize.evaluator import Budget, slope_left
from optimize.problem import Problem
from optimize.run_folder import DERIVED, FILES, JOURNAL, RunFolder

PNG = b"\x89PNG\r\n\x1a\n"


def files(folder: Path) -> dict[str, bytes]:
    return {f.name: f.read_bytes() for f in folder.iterdir()}


def trace_of(folder: Path) -> list[list[float]]:
    with (folder / "trace.csv").open(newline="") as file:
        names, *rows = csv.reader(file)
    assert names == ["evaluations", "simulated_falls", "seconds", "best_score", "slope_left"]
    return [[float(cell) for cell in row[:4]] for row in rows]


def test_the_trace_shows_how_flat_it_has_become(scenes, tmp_path: Path) -> None:
    result = search(scenes["spacing"], "l-bfgs", budget=200, folder=tmp_path)
    with (tmp_path / "trace.csv").open(newline="") as file:
        slopes = [float(row["slope_left"]) for row in csv.DictReader(file)]
    assert slopes == pytest.approx(result.slopes, rel=1e-3)
    assert 0.0 <= slopes[-1] < 0.01 * slopes[0]
    problem = Problem(scenes["spacing"])
    design = problem.design(result.layout)
    gradient = problem.score_and_gradient(design)[1]
    assert slope_left(design, gradient) == pytest.approx(slopes[-1], rel=0.1, abs=1e-6)


def test_a_folder_holds_all_of_a_run(scenes, tmp_path: Path) -> None:
    result = search(scenes["both"], "cma", budget=200, seed=4, folder=tmp_path / "new" / "run")
    folder = tmp_path / "new" / "run"
    assert sorted(files(folder)) == sorted((*FILES, JOURNAL))
    assert de.load_scene(folder / "scene.toml").to_toml() == scenes["both"].to_toml()
    for layout in (de.Layout.read(folder / "layout.csv"), de.Layout.read(folder / "layout.json")):
        assert np.array_equal(layout.spacing, result.layout.spacing)
        assert np.array_equal(layout.thickness, result.layout.thickness)
        assert scenes["both"].score(layout) == result.score
    rows = trace_of(folder)
    assert [(n, f, s) for n, f, _, s in rows] == [(n, f, s) for n, f, _, s in result.trace]
    assert [t for _, _, t, _ in rows] == pytest.approx([t for _, _, t, _ in result.trace], abs=1e-6)
    assert (folder / "result.png").read_bytes().startswith(PNG)
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["finished"]
    assert summary["mean_speed"] == result.score
    assert summary["uniform_mean_speed"] == result.uniform.score
    assert summary["gain"] == result.score / result.uniform.score - 1.0
    assert summary["outcome"] == "PROPAGATED"
    assert (summary["evaluations"], summary["seed"], summary["method"]) == (200, 4, "cma")
    assert summary["seconds"] == result.seconds
    assert 0.0 <= summary["error_estimate"] < 1e-9
    assert set(summary["versions"]) == {"python", "domino-chains", "numpy", "scipy", "numba", "cma"}


def test_a_row_that_dies_is_written_too(scenes, tmp_path: Path) -> None:
    search(scenes["dead"], "random", budget=20, folder=tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["mean_speed"] == 0.0
    assert summary["score"] < 0.0
    assert summary["gain"] is None
    assert summary["total_time"] is None
    assert summary["outcome"] == "STALLED"


@pytest.mark.parametrize("name", ["layout.csv", "scene.toml", "summary.json", "result.png"])
def test_no_file_is_replaced_by_a_new_run(scenes, monkeypatch, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    monkeypatch.setattr(Budget, "scores", lambda *_: pytest.fail("time was spent"))
    with pytest.raises(ValueError, match=f"holds {name} already: go on with --resume, or name an"):
        search(scenes["spacing"], "random", budget=10, folder=tmp_path)
    assert files(tmp_path) == {name: b"mine"}


def test_other_files_are_left_alone(scenes, tmp_path: Path) -> None:
    for name in ("notes.txt", *DERIVED):  # some of them another program's then
        (tmp_path / name).write_text("mine")
    search(scenes["spacing"], "random", budget=10, folder=tmp_path)
    assert all((tmp_path / name).read_text() == "mine" for name in DERIVED)
    search(scenes["spacing"], "random", budget=20, folder=tmp_path, resume=True)
    assert sorted(files(tmp_path)) == sorted((*FILES, JOURNAL, "notes.txt"))  # those were stale


def test_a_smaller_budget_replaces_no_better_row(scenes, monkeypatch, tmp_path: Path) -> None:
    search(scenes["spacing"], "random", budget=600, folder=tmp_path)
    before = files(tmp_path)
    with pytest.raises(ValueError, match="has spent 600 evaluations: give more than 20 to go on"):
        search(scenes["spacing"], "random", budget=20, folder=tmp_path, resume=True)
    words = scenes["spacing"], "random"
    with pytest.raises(ValueError, match="holds more of this search, 600 evaluations, than"):
        search(*words, seconds=1e-9, folder=tmp_path, resume=True)

    def interrupted(_: Budget) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="what is there stays"):
        search(*words, budget=700, folder=tmp_path, resume=True, watch=interrupted)
    (tmp_path / JOURNAL).unlink()  # one that grew too large goes
    with pytest.raises(KeyboardInterrupt, match="what is there stays"):
        search(*words, budget=700, folder=tmp_path, resume=True, watch=interrupted)
    (tmp_path / JOURNAL).write_bytes(before[JOURNAL])
    after = files(tmp_path)
    assert {name: after[name] for name in FILES} == {name: before[name] for name in FILES}


def test_a_run_of_another_search_that_has_no_journal_is_refused(scenes, tmp_path: Path) -> None:
    search(scenes["spacing"], "random", budget=10, folder=tmp_path)
    (tmp_path / JOURNAL).unlink()
    for scene, seed in ((scenes["spacing"], 1), (scenes["both"], 0)):
        with pytest.raises(ValueError, match=r"another search \(random, seed 0\): name another"):
            search(scene, "random", budget=10, seed=seed, folder=tmp_path, resume=True)


def test_a_place_that_cannot_be_written_is_told_first(scenes, monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setattr(Budget, "scores", lambda *_: pytest.fail("time was spent"))
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ValueError, match="is a file: name a folder"):
        search(scenes["spacing"], "random", budget=10, folder=tmp_path / "file")
    with pytest.raises(ValueError, match="cannot be written"):
        search(scenes["spacing"], "random", budget=10, folder=tmp_path / "file" / "run")


def test_the_best_so_far_is_on_disk_while_the_search_runs(
    scenes, monkeypatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("optimize.run_folder.PAUSE", 0.0)
    seen = []

    def look(budget: Budget) -> None:
        summary = json.loads((tmp_path / "summary.json").read_text())
        layout = de.Layout.read(tmp_path / "layout.csv")
        assert not summary["finished"]
        assert summary["score"] == budget.best_score == trace_of(tmp_path)[-1][3]
        assert scenes["both"].score(layout) == pytest.approx(budget.best_score, abs=2e-6)
        assert not (tmp_path / "result.png").exists()
        seen.append(budget.best_score)

    search(scenes["both"], "cma", budget=300, folder=tmp_path, watch=look)
    assert len(set(seen)) > 3


def test_saving_is_rare(scenes, monkeypatch, tmp_path: Path) -> None:
    saved = []
    monkeypatch.setattr("optimize.run_folder.RunFolder._keep", lambda *words: saved.append(words))
    monkeypatch.setattr("optimize.run_folder.time.monotonic", lambda: 0.0)  # no time passes
    search(scenes["both"], "random", budget=2000, folder=tmp_path)
    assert len(saved) == 2  # the first, and the result


def full(*_: object) -> None:
    raise OSError(28, "No space left on device")


def test_a_full_disk_is_told_before_the_search(scenes, monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setattr("domino_env.core.files.write_text", full)
    monkeypatch.setattr(Budget, "scores", lambda *_: pytest.fail("time was spent"))
    with pytest.raises(ValueError, match="cannot be written: No space left"):
        search(scenes["both"], "random", budget=300, folder=tmp_path)


def test_a_disk_that_is_full_for_a_while_does_not_end_a_search(
    scenes, monkeypatch, tmp_path: Path
) -> None:
    result = search(scenes["both"], "random", budget=600, seed=2)
    monkeypatch.setattr("optimize.run_folder.PAUSE", 0.0)
    kept, failures = RunFolder._keep, []

    def flaky(folder: RunFolder, *words: object) -> None:
        if not failures:
            failures.append(words)
            full()
        kept(folder, *words)

    monkeypatch.setattr(RunFolder, "_keep", flaky)
    again = search(scenes["both"], "random", budget=600, seed=2, folder=tmp_path)
    assert failures
    assert again.score == result.score
    assert sorted(files(tmp_path)) == sorted((*FILES, JOURNAL))


def started(folder: Path, *words: str) -> subprocess.Popen[str]:
    """A search in a process of its own, with something on disk."""
    command = [sys.executable, "-m", "domino_env", "optimize", "sprint", "--out", str(folder)]
    process = subprocess.Popen(
        [*command, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while not (folder / "summary.json").exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    return process


def test_a_run_that_is_killed_leaves_whole_files(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    process = started(folder, "--seconds", "100")
    process.kill()
    process.communicate()
    scene = de.load_scene(folder / "scene.toml")
    layout = de.Layout.read(folder / "layout.csv")
    assert scene.violations(layout) == []
    assert np.array_equal(layout.spacing, de.Layout.read(folder / "layout.json").spacing)
    assert trace_of(folder)
    assert not json.loads((folder / "summary.json").read_text())["finished"]


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C is sent as a signal")
def test_ctrl_c_writes_the_best_so_far(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    process = started(folder, "--seconds", "100")
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "interrupted after" in out
    assert sorted(files(folder)) == sorted((*FILES, JOURNAL))
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["finished"]
    assert summary["interrupted"]
    scene = de.load_scene("sprint")
    assert summary["score"] == scene.score(de.Layout.read(folder / "layout.csv"))
