"""domino compare, and the best layouts known."""

from __future__ import annotations

import argparse
import csv
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.scenes.io.reading import scene_names
from optimize import search
from optimize.cli import comparisons
from optimize.comparison import picture
from optimize.comparison.page import FILES, page, table, write
from optimize.comparison.runner import (
    TARGETS,
    TRIAL,
    Comparison,
    _best_scores,
    compare,
    comparison_tasks,
)
from optimize.records import shipped
from optimize.result import SearchResult
from optimize.studies.progress import in_words

RECORDS = shipped.best_known()


@pytest.fixture(scope="module")
def comparison(scenes) -> Comparison:
    chosen = [scenes["spacing"], scenes["length"]]
    return compare(chosen, ["auto", "random", "uniform"], range(2), 0.15)


def test_every_method_runs_on_every_scene_with_every_seed(comparison: Comparison) -> None:
    runs = [(r.scene.name, r.method, r.seed) for r in comparison.results]
    assert len(set(runs)) == len(runs) == 2 * 3 * 2
    assert comparison.scenes == ["spacing", "length"]
    assert comparison.methods == ["auto", "random", "uniform"]
    for name in comparison.scenes:
        of_scene = [r.score for r in comparison.results if r.scene.name == name]
        assert comparison.best[name] == max(of_scene)  # no record of such small scenes


def test_times_and_gaps_are_those_of_the_trace(comparison: Comparison) -> None:
    """The two are inverse to each other: a gap is reached at its time, and not before."""
    for result in comparison.results:
        for gap in (1e-1, 1e-2, 1e-3):
            when = comparison.time_to(result, gap)
            if np.isfinite(when):
                before, at = comparison.gaps(result, np.array([when * (1.0 - 1e-9), when]))
                assert at <= gap * (1.0 + 1e-9)
                assert before > gap or when == result.trace[0][2]
            else:
                assert comparison.gaps(result, np.array([1e9]))[0] > gap


def test_targets_reached_are_counted(comparison: Comparison) -> None:
    part = comparison.reached("random", comparison.times())
    assert np.all(np.diff(part) >= 0.0)
    runs = [r for r in comparison.results if r.method == "random"]
    counted = sum(comparison.time_to(r, t) < np.inf for r in runs for t in TARGETS)
    assert comparison.reached("random", np.array([1e9]))[0] == counted / (len(runs) * len(TARGETS))
    assert comparison.reached("random", np.array([0.0]))[0] == 0.0


def test_the_folder(comparison: Comparison, tmp_path: Path) -> None:
    write(comparison, tmp_path / "out")
    assert sorted(f.name for f in (tmp_path / "out").iterdir()) == sorted(FILES)
    with (tmp_path / "out" / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(r["score"]) for r in rows] == [r.score for r in comparison.results]
    for row, result in zip(rows, comparison.results, strict=True):
        assert float(row["gain"]) == result.gain
    with (tmp_path / "out" / "traces.csv").open(newline="") as file:
        steps = list(csv.DictReader(file))
    assert len(steps) == sum(len(r.trace) for r in comparison.results)
    for name in ("gaps.png", "targets.png"):
        assert (tmp_path / "out" / name).read_bytes().startswith(b"\x89PNG")


def test_the_page_puts_the_best_first(comparison: Comparison) -> None:
    lines = table(comparison, "spacing")[2:]
    medians = [float(line.split("|")[2]) for line in lines]
    assert medians == sorted(medians, reverse=True)
    assert "`uniform`" in "".join(lines)
    for line in lines:
        assert line in page(comparison)


def test_many_methods_have_a_panel_each_and_one_seed_is_called_so(
    comparison: Comparison, tmp_path: Path, monkeypatch
) -> None:
    drawn = []
    monkeypatch.setattr(picture, "write_png", lambda figure, path: drawn.append(figure))
    first = [r for r in comparison.results if r.seed == 0]
    many = tuple(replace(r, method=f"{r.method} {k}") for k in range(4) for r in first)
    several = replace(comparison, results=many)
    picture.draw_gaps(several, tmp_path)
    picture.draw_gaps(comparison, tmp_path)
    assert "one seed" in drawn[0].texts[1].get_text()
    assert "medians over 2 seeds" in drawn[1].texts[1].get_text()
    titles = [axes.get_title(loc="left") for axes in drawn[0].get_axes() if axes.get_visible()]
    assert sorted(titles) == sorted(2 * several.methods)
    told = page(several)
    assert "one seed" in told
    assert "seeds" not in told
    assert "worst" in table(comparison, "spacing")[0]


def test_how_long_a_comparison_takes_is_said_first(scenes, monkeypatch) -> None:
    seconds = comparison_tasks([scenes["spacing"]], ["random", "auto"], range(3), 2.0, None)
    assert list(comparisons._announced(seconds, 6, None)) == ["6 runs of 2 s: at most 12 s"]
    assert list(comparisons._announced(seconds, 3, None)) == ["3 runs of 2 s: at most 6 s"]
    rows = comparison_tasks([scenes["spacing"]], ["random", "auto"], range(3), None, 6000)
    result, tried = search(scenes["spacing"], "uniform", budget=1), []

    def trial(scene: de.Scene, method: str, budget: int, **_: object) -> SearchResult:
        tried.append(method)
        return replace(result, seconds=0.5, evaluations=budget)

    monkeypatch.setattr("optimize.comparison.runner.search", trial)
    said = list(comparisons._announced(rows, 6, None))
    assert tried == ["random", "auto"]  # each once
    assert said[0] == "6 runs of 6000 rows"
    assert said[1].startswith(f"about {in_words(6 * 6000 * 0.5 / TRIAL)}, judged by")


def test_medians_are_halfway_between_the_two_in_the_middle(comparison: Comparison) -> None:
    scores = [r.score for r in comparison.of("spacing", "random")]
    line = next(line for line in table(comparison, "spacing") if "`random`" in line)
    assert float(line.split("|")[2]) == pytest.approx(np.mean(scores), abs=1e-5)


def test_ctrl_c_keeps_what_is_complete(scenes, monkeypatch) -> None:
    seen: list[SearchResult] = []

    def stopped_after_two(*words, **more):
        if len(seen) == 2:
            raise KeyboardInterrupt
        return search(*words, **more)

    monkeypatch.setattr("optimize.studies.task.search", stopped_after_two)
    found = compare([scenes["spacing"]], ["random", "uniform"], range(5), 0.02, seen.append)
    assert list(found.results) == seen
    assert len(seen) == 2
    with pytest.raises(KeyboardInterrupt):
        compare([scenes["spacing"]], ["random"], range(5), 0.02)


@pytest.mark.parametrize(("scene_list", "methods", "seeds", "message"), [
    ([], ["auto"], [0], "scenes is empty"),
    (["sprint"], [], [0], "methods is empty"),
    (["sprint"], ["cma", "cma"], [0], "methods = cma, cma: give each once"),
    (["sprint"], ["cma"], [], "seeds is empty"),
])  # fmt: skip
def test_what_cannot_be_compared_is_told(scene_list, methods, seeds, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        compare(scene_list, methods, seeds, 1.0)


def test_the_command(scenes, tmp_path: Path, capsys, monkeypatch) -> None:
    (tmp_path / "mine.toml").write_text(replace(scenes["spacing"]).to_toml())
    monkeypatch.setattr(shipped, "PATH", tmp_path / "best.json")
    monkeypatch.chdir(tmp_path)
    parser = argparse.ArgumentParser()
    comparisons.add_arguments(parser)
    words = [str(tmp_path / "mine.toml"), "--methods", "auto, uniform", "--seeds", "1"]
    words += ["--seconds", "0.1", "--out", str(tmp_path / "out")]
    assert comparisons.run(parser.parse_args(words)) == 0
    said = capsys.readouterr().out
    assert "2 runs of 0.1 s" in said
    assert "| `auto` |" in said
    assert (tmp_path / "out" / "comparison.md").exists()
    assert not (tmp_path / "best.json").exists()  # only when it is asked for
    assert comparisons.run(parser.parse_args([*words, "--update-best"])) == 0
    assert "new records: none" in capsys.readouterr().out
    assert not (tmp_path / "best.json").exists()  # which is for scenes that ship


def test_ctrl_c_ends_the_workers_at_once(scenes, tmp_path: Path, monkeypatch) -> None:
    """What is complete is written, and nobody waits for what is not."""
    (tmp_path / "mine.toml").write_text(scenes["spacing"].to_toml())
    monkeypatch.chdir(tmp_path)
    parser = argparse.ArgumentParser()
    comparisons.add_arguments(parser)
    words = ["mine.toml", "--methods", "uniform,random", "--seeds", "1", "--workers", "2"]
    running: list[int] = []
    best = _best_scores

    def stop(result: SearchResult) -> None:
        running.extend(child.pid or 0 for child in active_children())
        raise KeyboardInterrupt

    left: list[int] = []
    monkeypatch.setattr("optimize.cli.comparisons._tell", stop)
    monkeypatch.setattr(
        "optimize.comparison.runner._best_scores",
        lambda results: left.extend(child.pid or 0 for child in active_children()) or best(results),
    )
    with pytest.raises(KeyboardInterrupt, match="interrupted: 1 runs are complete"):
        comparisons.run(parser.parse_args([*words, "--evaluations", "100000000"]))
    assert not set(left) & set(running)  # before anything is made of what is complete
    assert (tmp_path / "runs/comparison/comparison.md").exists()
    assert running
    assert not {child.pid for child in active_children()} & set(running)


def test_a_second_ctrl_c_says_what_is_done(scenes, tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "mine.toml").write_text(scenes["spacing"].to_toml())
    monkeypatch.chdir(tmp_path)

    def again(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("optimize.comparison.page.write", again)
    parser = argparse.ArgumentParser()
    comparisons.add_arguments(parser)
    words = ["mine.toml", "--methods", "uniform", "--seeds", "1", "--evaluations", "9"]
    with pytest.raises(KeyboardInterrupt, match=r"interrupted: 1 runs are complete; .*--resume"):
        comparisons.run(parser.parse_args(words))


# best known -------------------------------------------------------------------------------------


def test_every_scene_has_a_record() -> None:
    assert set(RECORDS) <= set(scene_names())
    assert {"sprint", "sprint-thickness", "ideal", "gentle", "course", "marathon"} <= set(RECORDS)


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_is_what_it_says(name: str) -> None:
    """Simulated anew at a relative error of 1e-12, within all rules, better than uniform."""
    record, scene = RECORDS[name], de.load_scene(name)
    assert scene.violations(record.layout) == []
    known = 1e-11 if scene.floor_friction is None else 3e-4  # so closely a score is known
    assert shipped.closest_score(scene, record.layout) == pytest.approx(record.score, rel=known)
    if scene.objective == "mean_speed":
        wave = scene.simulate(record.layout, rtol=1e-12)
        assert wave.outcome == de.Outcome.PROPAGATED
        assert wave.error_estimate < 2e-12
    assert record.score >= scene.uniform().score  # equal where growth is at its bound everywhere
    assert record.method
    assert record.seconds > 0.0


def test_only_what_is_better_becomes_a_record(scenes, tmp_path: Path) -> None:
    path = tmp_path / "best.json"
    assert shipped.best_known(path) == {}
    with pytest.raises(ValueError, match=r"say best_known\(\)\['sprint'\]"):
        shipped.best_known("sprint")
    mark = search(scenes["both"], "uniform", budget=1)
    found = search(scenes["both"], "auto", budget=300)
    assert shipped.update([mark], path) == ["both"]
    assert shipped.update([mark], path) == []
    assert shipped.update([found, mark], path) == ["both"]
    record = shipped.best_known(path)["both"]
    assert (record.method, record.seed) == ("auto", 0)
    assert np.array_equal(record.layout.spacing, found.layout.spacing)
    assert np.array_equal(record.layout.thickness, found.layout.thickness)
    assert record.score == pytest.approx(found.score, rel=1e-9)


def test_what_breaks_a_rule_is_no_record(scenes, tmp_path: Path) -> None:
    found = search(scenes["spacing"], "auto", budget=100)
    tighter = replace(found.scene, spacing=(0.03, 0.031))
    assert shipped.update([replace(found, scene=tighter)], tmp_path / "best.json") == []


def test_a_comparison_that_was_stopped_goes_on(scenes, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(scenes["spacing"].to_toml())
    parser = argparse.ArgumentParser()
    comparisons.add_arguments(parser)
    words = ["mine.toml", "--methods", "random,uniform", "--seeds", "2", "--evaluations", "20"]
    calls = []

    def stopped_at_the_third(*asked, **more):
        calls.append(asked)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return search(*asked, **more)

    monkeypatch.setattr("optimize.studies.task.search", stopped_at_the_third)
    with pytest.raises(KeyboardInterrupt, match=r"2 runs are complete; .*--resume goes on"):
        comparisons.run(parser.parse_args(words))
    with (tmp_path / "runs/comparison/runs.csv").open(newline="") as file:
        first = list(csv.DictReader(file))
    assert len(first) == 2
    assert "evaluations_to_1_percent" in first[0]
    assert comparisons.run(parser.parse_args([*words, "--resume"])) == 0
    assert len(calls) == 5  # the third once more, and the fourth
    with (tmp_path / "runs/comparison/runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(r["method"], r["seed"]) for r in rows] == [
        ("random", "0"), ("uniform", "0"), ("random", "1"), ("uniform", "1")
    ]  # fmt: skip
    assert [(r["score"], r["seconds"]) for r in rows[:2]] == [
        (r["score"], r["seconds"]) for r in first
    ]
