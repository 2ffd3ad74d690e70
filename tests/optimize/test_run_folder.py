"""Run folders: complete files, which no shorter search replaces."""

import csv
import json

import numpy as np
import pytest

import domino_env as de
from optimize import Evaluator, search
from optimize.run_folder import FILES, JOURNAL


def files(folder):
    return {f.name: f.read_bytes() for f in folder.iterdir()}


def test_a_folder_holds_all_of_a_run(scenes, tmp_path):
    folder = tmp_path / "new" / "run"
    result = search(scenes["both"], "l-bfgs", budget=200, seed=4, folder=folder)
    assert sorted(files(folder)) == sorted((*FILES, JOURNAL))
    assert de.load_scene(folder / "scene.toml").to_toml() == scenes["both"].to_toml()
    for layout in (de.Layout.read(folder / "layout.csv"), de.Layout.read(folder / "layout.json")):
        assert layout == result.layout
        assert scenes["both"].score(layout) == result.score
    lines = csv.DictReader((folder / "trace.csv").read_text().splitlines())
    names = ("evaluations", "simulated_falls", "seconds", "best_score")
    trace = [[float(line[name]) for name in names] for line in lines]
    assert np.array(trace) == pytest.approx(np.array(result.trace), abs=1e-6)
    assert (folder / "result.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    summary = json.loads((folder / "summary.json").read_text())
    expected = {
        "finished": True, "mean_speed": result.score, "gain": result.gain, "outcome": "PROPAGATED",
        "uniform_mean_speed": result.uniform.score, "seconds": result.seconds, "seed": 4,
        "evaluations": result.evaluations, "method": "l-bfgs", "total_time": summary["total_time"],
    }  # fmt: skip
    assert {name: summary[name] for name in expected} == expected
    packages = {"python", "domino-chains", "numpy", "scipy", "numba", "cma"}
    assert set(summary["versions"]) == packages | {"revision"}


def test_a_method_that_fails_leaves_the_best_layout(scenes, tmp_path):
    def fails(evaluator, rng):
        evaluator.evaluate(rng.random((20, evaluator.problem.dimension)))
        raise SystemExit

    with pytest.raises(ValueError, match="SystemExit None: end a method by"):
        search(scenes["spacing"], fails, folder=tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert (summary["evaluations"], summary["ended"][:18]) == (20, "the method failed:")
    layout = de.Layout.read(tmp_path / "layout.csv")
    assert scenes["spacing"].score(layout) == summary["mean_speed"]


@pytest.mark.parametrize("name", ["layout.csv", "summary.json", JOURNAL])
def test_no_file_is_replaced_by_a_new_run(scenes, monkeypatch, tmp_path, name):
    monkeypatch.setattr(Evaluator, "evaluate", lambda *_, **__: pytest.fail("time was spent"))
    (tmp_path / name).write_text("text")
    with pytest.raises(ValueError, match=f"holds {name} already: resume the same"):
        search(scenes["spacing"], "random", budget=10, folder=tmp_path)
    assert files(tmp_path) == {name: b"text"}


@pytest.mark.usefixtures("no_pictures")
def test_a_shorter_search_replaces_no_file(scenes, tmp_path):
    words = scenes["spacing"], "random"
    search(*words, budget=600, folder=tmp_path)
    before = files(tmp_path)
    message = "holds 600 evaluations of this search and stays as it is: this run ended after"
    with pytest.raises(ValueError, match=f"{message} 20; give it a larger budget"):
        search(*words, budget=20, folder=tmp_path, resume=True)

    def interrupted(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=message):
        search(*words, budget=700, folder=tmp_path, resume=True, callback=interrupted)
    after = files(tmp_path)
    assert {name: after[name] for name in FILES} == {name: before[name] for name in FILES}


@pytest.mark.usefixtures("no_pictures")
@pytest.mark.parametrize("change", [{"method": "cma"}, {"seed": 8}, {"scene": "both"}, {}], ids=str)
def test_another_search_is_not_resumed(scenes, monkeypatch, tmp_path, change):
    search(scenes["spacing"], "random", 10, folder=tmp_path)
    before = files(tmp_path)
    words = {"scene": "spacing", "method": "random", "seed": 0} | change
    words["scene"] = scenes[words["scene"]]
    if not change:
        monkeypatch.setattr("optimize.run_folder.versions", lambda: {"numpy": "1.0"})
    message = "another search, by random with seed 0 .*differ.: begin anew in another folder"
    with pytest.raises(ValueError, match=f"{message}, without --resume$"):
        search(**words, budget=30, folder=tmp_path, resume=True)
    assert files(tmp_path) == before
