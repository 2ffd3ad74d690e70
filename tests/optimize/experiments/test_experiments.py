"""Comparisons and sweeps: tasks, results, reports, the commands, and how they stop and continue."""

import csv
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import domino_env as de
from domino_env.cli.main import main
from domino_env.scenes.io.reading import scene_names
from optimize import compare, search, sweep
from optimize.experiments import best_known, pictures, report
from optimize.experiments.sweep import make_scene, parse_axis, plan_sweep


def read_csv(path):
    return list(csv.DictReader(path.read_text().splitlines()))


@pytest.fixture
def folder(scenes, tmp_path, monkeypatch):
    """A working folder with a scene."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(scenes["spacing"].to_toml())
    return tmp_path


# comparisons ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def compared(scenes):
    chosen = [scenes["spacing"], scenes["length"]]
    return compare(chosen, ["auto", "random", "uniform"], range(2), seconds=0.15)


def test_every_method_runs_on_every_scene_with_every_seed(compared):
    runs = [(r.scene_name, r.method, r.seed) for r in compared.results]
    names = [["spacing", "length"], ["auto", "random", "uniform"]]
    assert sorted(runs) == sorted(product(*names, range(2)))
    assert [compared.problems, compared.methods] == names
    for name in compared.problems:
        scores = [r.score for r in compared.results if r.scene_name == name]
        assert compared.best[name] == max(scores)  # nothing is known of such small scenes


def test_a_shortfall_is_reached_at_its_time_and_not_before(compared):
    for result in compared.results:
        for shortfall in (1e-1, 1e-2, 1e-3):
            time = compared.time_to(result, shortfall)
            if np.isfinite(time):
                times = np.array([time * (1.0 - 1e-9), time])
                earlier, reached = compared.shortfalls(result, times)
                assert reached <= shortfall * (1.0 + 1e-9)
                assert earlier > shortfall or time == result.trace["seconds"][0]
            else:
                assert compared.shortfalls(result, np.array([1e9]))[0] > shortfall


def test_the_report_of_a_comparison_has_all_runs(compared, tmp_path):
    report.write(compared, tmp_path)
    assert sorted(f.name for f in tmp_path.iterdir()) == sorted(report.COMPARISON_FILES)
    for line, result in zip(read_csv(tmp_path / "runs.csv"), compared.results, strict=True):
        assert (float(line["score"]), float(line["gain"])) == (result.score, result.gain)
        assert "seconds_to_1_percent" in line
    lines = report.table(compared, ["spacing"])[2:]
    medians = {line.split("|")[1].strip(): float(line.split("|")[2]) for line in lines}
    assert list(medians.values()) == sorted(medians.values(), reverse=True)
    scores = [r.score for r in compared.runs("random", "spacing")]
    assert medians["`random`"] == pytest.approx(np.median(scores), abs=1e-5)
    assert "\n".join(lines) in report.page(compared, "Compared", "gaps.png")


@pytest.mark.parametrize(("scene_list", "methods", "seeds", "budget", "message"), [
    ([], ["auto"], [0], 1, "scenes is empty"),
    (["sprint"], [], [0], 1, "methods is empty"),
    (["sprint"], ["cma", "cma"], [0], 1, "methods = cma, cma: give each once"),
    (["sprint"], ["cma"], [], 1, "seeds is empty"),
    (["sprint"], ["cma"], 3, 1, r"seeds = 3: give several, such as range\(5\)"),
    (["sprint"], ["cma"], ["a"], 1, "seed = 'a': give a whole number, at least 0"),
    ("sprint", "cmaes", [0], 1, "method = 'cmaes': did you mean 'cma'"),
    (["sprint"], ["cma"], [0], None, "budget = None, seconds = None: give exactly one"),
])  # fmt: skip
def test_impossible_comparisons_are_rejected(scene_list, methods, seeds, budget, message):
    with pytest.raises((ValueError, TypeError), match=message):
        compare(scene_list, methods, seeds, budget)


def test_an_interrupted_comparison_is_resumed(folder, monkeypatch, capsys, error_of, output_of):
    words = ["compare", "small.toml", "--methods", "random, uniform", "--seeds", "2"]
    words += ["--budget", "20"]
    calls = []

    def interrupt_the_third(*arguments, **options):
        calls.append(arguments)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return search(*arguments, **options)

    monkeypatch.setattr("optimize.experiments.task.search", interrupt_the_third)
    assert main(words) == 130
    output = capsys.readouterr()
    assert "2 results; written to " in output.out
    assert "interrupted: results are in study 'compare-spacing'; the same command" in output.err
    first = read_csv(folder / "runs/compare-spacing/runs.csv")
    assert len(first) == 2
    error = error_of(*words, "--out", "runs/compare-spacing")  # which holds results
    assert "runs/compare-spacing holds comparison.md already" in error
    output_of(*words, "--resume")
    assert len(calls) == 5  # the third once more, and the fourth
    lines = read_csv(folder / "runs/compare-spacing/runs.csv")
    names = [r["method"] + r["seed"] for r in lines]
    assert names == ["random0", "uniform0", "random1", "uniform1"]
    assert lines[:2] == first


# best known layouts -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", scene_names())
def test_every_scene_has_a_valid_best_known_layout(name):
    record, scene = best_known.best_known()[name], de.load_scene(name)
    assert scene.violations(record.layout) == []
    known = 1e-11 if scene.floor_friction is None else 3e-4  # as closely as a score is known
    score = best_known.accurate_score(scene, record.layout)
    assert score == pytest.approx(record.score, rel=known)
    assert score >= scene.uniform().score * (1.0 - known)


def test_only_a_better_layout_replaces_the_best_known(script, tmp_path):
    store, path = script("docs/best_known.py").store, tmp_path / "best.json"
    assert best_known.best_known(path) == {}
    for method in ("uniform", "auto"):
        better = search("sprint", method, budget=300, folder=tmp_path / method)
    kept = [store(tmp_path / run, path) for run in ("uniform", "uniform", "auto", "uniform")]
    assert kept == [True, False, True, False]
    record = best_known.best_known(path)["sprint"]
    assert (record.method, record.seed) == ("auto", 0)
    assert record.layout == better.layout
    assert record.score == pytest.approx(better.score, rel=1e-9)


# points of sweeps -------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "values"), [
    ("physics.friction=0:0.5:6", [0, 0.1, 0.2, 0.3, 0.4, 0.5]),
    ("physics.push = 4, 8.5,12", [4, 8.5, 12]),
    ("row.count=10:30:3", [10, 20, 30]),
    ("placement.deviation=0.001:0.1:3:log", [0.001, 0.01, 0.1]),
    ("objective=mean_speed,magnify", ["mean_speed", "magnify"]),
    ("stock.count=[[16, 24], [20, 20]]", [[16, 24], [20, 20]]),
])  # fmt: skip
def test_an_axis_has_the_values_of_its_text(text, values):
    key, read = parse_axis(text)
    assert key == text.partition("=")[0].strip()
    assert read == values
    assert [type(value) for value in read] == [type(value) for value in values]


@pytest.mark.parametrize(("text", "message"), [
    ("physics.friction", "a key or its values are missing; write KEY=FROM:TO:NUMBER"),
    ("row.count=3:4", "give two numbers and the number of values; write"),
    ("row.count=3:x:4", "could not convert string to float: 'x'; write KEY="),
    ("row.count=3:4:0", "NUMBER = 0: give a whole number from 1 to"),
    (r"physics.push=0:inf:3", r"FROM, TO\[1\] = inf: give a finite number"),
    ("physics.push=0:1:3:log", r"FROM, TO\[0\] = 0.0: give a finite number, more than 0"),
    ("physics.push=4,8,4", "and each value once"),
    ("spacing.values=[1, ", "Expecting value"),
])  # fmt: skip
def test_invalid_axes_are_rejected(text, message):
    with pytest.raises(ValueError, match=f"--set .*{message}"):
        parse_axis(text)


def test_a_point_changes_what_it_names_and_nothing_else(scenes):
    base = scenes["spacing"]

    def changed(scene, point):
        return make_scene(scene.document(), scene.name, point)

    scene = changed(base, {"physics.friction": 0.1, "row.count": 8, "thickness.fixed": 0.006})
    physics = base.physics.replace(friction=0.1)
    assert scene == replace(base, physics=physics, count=8, thickness=(0.006, 0.006))
    noisy = changed(base, {"placement.deviation": 0.001, "placement.draws": 8})
    assert noisy.placement == de.Placement(0.001, 8)
    free = changed(base, {"thickness.min": 0.005, "thickness.max": 0.009})
    assert free.thickness == (0.005, 0.009)
    assert changed(free, {"thickness.fixed": 0.008}).thickness == (0.008, 0.008)


@pytest.mark.parametrize(("axis", "more", "message"), [
    ("physics.friction=0.1,-1", {}, r"physics.friction = -1: give a finite number from 0 to"),
    ("physics.frction=0.1", {}, r"physics.frction = 0.1: unknown key 'physics.frction'"),
    ("spacing.fixed=0.02", {}, "spacing.fixed = 0.02: .* leaves nothing free"),
    ("row.length=0.1,100", {}, r"row.length = 100: row.length = 100 m cannot be met"),
    ("row.count.more=1", {}, "row.count.more = 1: unknown key 'row.count'"),
    ("physics.push=4,8", {"seeds": 0.5}, "seeds = 0.5: give a whole number, at least 1"),
])  # fmt: skip
def test_impossible_sweeps_are_rejected(scenes, axis, more, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        plan_sweep(scenes["spacing"], axis, **more)


def test_only_the_points_of_a_file_must_be_possible(scenes, tmp_path):
    path = tmp_path / "box.toml"
    path.write_text(scenes["length"].to_toml().replace("count = 9", "count = 40"))
    with pytest.raises(ValueError, match="cannot be met"):
        de.load_scene(path)
    tasks = plan_sweep(path, ["row.count=8:9:2"])
    names = [(task.scene_name, task.labels["row.count"]) for task in tasks]
    assert names == [("length", 8), ("length", 9)]
    message = f"{path} at row.count = 41: .*cannot be met: .* would fit"
    with pytest.raises(ValueError, match=message):
        plan_sweep(path, ["row.count=9,41"])


# sweeps -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swept(scenes):
    axes = ["physics.friction=0.1,0.3", "physics.push=6:10:3"]
    return sweep(scenes["spacing"], axes, methods=["auto", "random"], seeds=2, budget=40)


def test_every_method_searches_every_point_with_every_seed(scenes, swept):
    runs = [(r.problem, r.method, r.seed) for r in swept.results]
    assert len(set(runs)) == len(runs) == 2 * 3 * 2 * 2
    assert swept.keys == ["physics.friction", "physics.push"]
    assert len(swept.problems) == 6
    assert swept.failures == ()
    result = swept.results[13]
    friction, push = result.labels.values()
    scene = replace(scenes["spacing"], physics=de.Physics(friction, 9.81, push))
    alone = search(scene, result.method, 40, result.seed)
    assert (result.score, result.gain, result.layout) == (alone.score, alone.gain, alone.layout)
    assert all(r.score <= swept.best[r.problem] for r in swept.results)


def test_the_report_of_a_sweep_has_all_runs(scenes, swept, tmp_path):
    report.write(swept, tmp_path)
    assert sorted(f.name for f in tmp_path.iterdir()) == sorted(report.SWEEP_FILES)
    for line, r in zip(read_csv(tmp_path / "sweep.csv"), swept.results, strict=True):
        assert [float(line[key]) for key in swept.keys] == list(r.labels.values())
        assert (float(line["score"]), float(line["gain"]), line["key"]) == (r.score, r.gain, r.key)
        best = swept.best[r.problem]
        assert float(line["gap"]) == pytest.approx((best - r.score) / best)
    assert report.page(swept, "Swept", "sweep.png").count("| `auto` |") == 6


@pytest.mark.parametrize(("scene", "axes"), [
    ("spacing", ["title=short,long", "row.count=5,6"]),
    ("dead", ["physics.push=0.3,0.5"]),
    ("tempo", ["tempo.tolerance=0.001,0.002"]),
], ids=["words", "dead", "tempo"])  # fmt: skip
def test_sweeps_of_words_and_without_gains_are_drawn(scenes, scene, axes, tmp_path):
    swept_scene = scenes.get(scene) or de.load_scene(scene)
    experiment = sweep(swept_scene, axes, methods=["uniform"], budget=1)
    report.write(experiment, tmp_path)
    pictures.draw_over_time(experiment, tmp_path / "gaps.png")
    for name in ("sweep.png", "gaps.png"):
        assert (tmp_path / name).stat().st_size > 10_000
    page = report.page(experiment, "Swept", "sweep.png")
    assert ("–" in page) == (scene == "dead")  # it has no gain
    header, _, *lines = report.table(experiment, experiment.problems)
    assert ("gain" in header) == (scene != "tempo")
    if scene == "tempo":  # the tolerance changes scores, not errors
        assert len({line.split("|")[3] for line in lines}) == 1 < len(lines)
        assert "RMS error [ms]" in header


def test_two_settings_have_a_curve_for_each_value_of_the_other(scenes, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(pictures, "draw_curves", lambda *arguments: drawn.extend(arguments[-1]))
    swept = sweep(scenes["spacing"], ["physics.push=5,8", "row.count=5"], ["uniform"], budget=1)
    pictures.draw_over_settings(swept, tmp_path)
    assert drawn == ["row.count = 5", "physics.push = 5", "physics.push = 8"]


WORDS = ["sweep", "small.toml", "--set", "physics.push=6,8", "--methods", "random"]
WORDS += ["--budget", "20"]


def test_studies_are_named_and_resumed(folder, output_of, error_of, monkeypatch):
    begun = output_of(*WORDS, "--resume")  # nothing is there yet: it starts
    assert "study 'sweep-spacing' in runs/studies.sqlite: 2 searches" in begun
    assert "study 'sweep-spacing-2'" in output_of(*WORDS)
    other_tasks = "--seeds", 2, "--resume"  # a study of their own
    assert "study 'sweep-spacing-3'" in output_of(*WORDS, *other_tasks)
    named = *WORDS, "--name", "sweep-spacing"
    assert "'sweep-spacing' with 2 results already: " in error_of(*named)
    output_of(*WORDS, "--name", "other", "--resume")
    assert "was begun as sweep with" in error_of(*named, *other_tasks)
    with monkeypatch.context() as patch:
        patch.setattr("optimize.experiments.task.search", None)  # nothing is left to run
        assert "2 of them done before" in output_of(*WORDS, "--resume").splitlines()[-2]
    monkeypatch.setattr("optimize.experiments.task.installed_versions", lambda: {"numpy": "1.0"})
    assert "'numpy': '" in error_of(*named, "--resume")
    assert "study 'sweep-spacing-4'" in output_of(*WORDS, "--resume")
