"""domino sweep: points, results, the study, and how it ends and goes on."""

from __future__ import annotations

import argparse
import csv
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from optimize import search
from optimize.cli import sweeps
from optimize.studies import open_store
from optimize.studies.progress import TaskLines, in_words
from optimize.sweeps.page import FILES, page, write
from optimize.sweeps.points import Axis, axis_of, drawn, grid, scene_at
from optimize.sweeps.runner import Sweep, run_sweep, sweep, sweep_tasks

ROOT = Path(__file__).parents[3]


# points -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "values"), [
    ("physics.friction=0:0.5:6", (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    ("physics.push = 4, 8,12", (4.0, 8.0, 12.0)),
    ("row.count=10:30:3", (10, 20, 30)),
    ("robust.deviation=0.001:0.1:3:log", (0.001, 0.01, 0.1)),
    ("objective=mean_speed,toppled", ("mean_speed", "toppled")),
    ("spacing.values=[[0.01, 0.02], [0.01, 0.03]]", ([0.01, 0.02], [0.01, 0.03])),
    ("row.count=25:25:1", (25,)),
])  # fmt: skip
def test_an_axis_is_what_its_text_says(text: str, values: tuple) -> None:
    axis = axis_of(text)
    assert axis.values == values
    assert [type(v) for v in axis.values] == [type(v) for v in values]


@pytest.mark.parametrize(("text", "message"), [
    ("physics.friction", "write KEY=FROM:TO:NUMBER"),
    ("=3", "write KEY="),
    ("a..b=3", "write KEY="),
    ("row.count=", "write KEY="),
    ("row.count=3:4", "write KEY=FROM:TO:NUMBER"),
    ("row.count=3:x:4", "write KEY="),
    ("row.count=3:4:5:cubic", "write KEY="),
    ("row.count=3:4:0", "give 1 to 100000 values, not 0"),
    ("physics.push=1:2:9999999999", "give 1 to 100000 values"),
    ("physics.push=0:inf:3", "give finite numbers"),
    ("physics.push=0:1:3:log", "give finite numbers of more than 0"),
    ("physics.push=4,8,4", "give each value once"),
    ("physics.push=4,,8", "a value is empty"),
    ("physics.push=1:1:3", "give each value once"),
    ("spacing.values=[1, ", "not JSON"),
    ("spacing.values=[null]", "give a list of numbers"),
    ("spacing.values=" + "[" * 100_000, "not JSON"),
])  # fmt: skip
def test_an_axis_that_says_nothing_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=f"--set .*{message}"):
        axis_of(text)


def test_a_grid_has_every_combination_once() -> None:
    axes = [axis_of("physics.friction=0,0.1"), axis_of("physics.push=4,8,12")]
    points = grid(axes)
    assert len(points) == len({repr(p) for p in points}) == 6
    assert points[1] == (("physics.friction", 0.0), ("physics.push", 8.0))
    with pytest.raises(ValueError, match="given twice"):
        grid([axes[0], axes[0]])
    with pytest.raises(ValueError, match="nothing is swept"):
        grid([])
    many = Axis("physics.push", tuple(range(1000)))
    with pytest.raises(ValueError, match="1000000 points: a sweep has at most"):
        grid([many, replace(many, key="physics.gravity")])


def test_drawn_points_are_within_their_ranges_and_repeat_with_their_seed() -> None:
    axes = [
        axis_of("row.count=5:9", drawn=True),
        axis_of("physics.friction=0.1:0.4", drawn=True),
        axis_of("robust.deviation=1e-5:1e-3:log", drawn=True),
        axis_of("objective=mean_speed,robust", drawn=True),
    ]
    points = drawn(axes, 300, np.random.default_rng(1))
    assert points == drawn(axes, 300, np.random.default_rng(1))
    assert points != drawn(axes, 300, np.random.default_rng(2))
    counts, frictions, deviations, words = zip(*([v for _, v in p] for p in points), strict=True)
    assert set(counts) == {5, 6, 7, 8, 9}
    assert set(words) == {"mean_speed", "robust"}
    assert 0.1 <= min(frictions) < 0.12 < 0.38 < max(frictions) <= 0.4
    assert 0.3 < np.mean(np.array(deviations) < 1e-4) < 0.7
    assert len(drawn(axes[:1], 300, np.random.default_rng(1))) == 5  # each once
    with pytest.raises(ValueError, match="the first number must be less"):
        axis_of("row.count=9:5", drawn=True)
    with pytest.raises(ValueError, match="write KEY=FROM:TO,"):
        axis_of("row.count=5:9:3", drawn=True)
    with pytest.raises(ValueError, match="--random 0: give 1 to"):
        drawn(axes, 0, np.random.default_rng(1))


def test_a_point_changes_what_it_names_and_nothing_else(scenes) -> None:
    base = scenes["spacing"]
    point = (("physics.friction", 0.1), ("row.count", 8), ("thickness.fixed", 0.006))
    found = scene_at(base, point)
    expected = replace(
        base, physics=base.physics.replace(friction=0.1), count=8, thickness=(0.006, 0.006)
    )
    assert found.to_toml() == expected.to_toml()
    robust = scene_at(base, (("objective", "robust"), ("robust.deviation", 0.001)))
    assert robust.placement is not None
    free = scene_at(base, (("thickness.min", 0.005), ("thickness.max", 0.009)))
    assert free.thickness == (0.005, 0.009)
    assert scene_at(free, (("thickness.fixed", 0.008),)).thickness == (0.008, 0.008)


@pytest.mark.parametrize(("axis", "message"), [
    ("physics.friction=0.1,-1", r"physics.friction = -1.0: give a finite number from 0 to"),
    ("row.count=7,1", "row.count = 1: give a whole number from 2"),
    ("physics.frction=0.1", r"physics.frction = 0.1: unknown key 'physics.frction': did you mean"),
    ("objective=speed", "objective = speed: objective = 'speed': choose"),
    ("spacing.fixed=0.02", "spacing.fixed = 0.02: .* leaves nothing free"),
    ("row.length=0.1,100", r"row.length = 100.0: row.length = 100.0 m cannot be met"),
    ("row.count.more=1", "row.count.more = 1.0: 'row.count.more': count is no table"),
    ("physics.push=nan", "physics.push = nan: "),
])  # fmt: skip
def test_an_invalid_point_is_named_before_anything_runs(
    scenes, axis: str, message: str, monkeypatch
) -> None:
    monkeypatch.setattr("optimize.studies.running.run_task", None)
    with pytest.raises(ValueError, match=f"^{message}"):
        sweep(scenes["spacing"], [axis])


@pytest.mark.parametrize(("words", "message"), [
    ({"methods": []}, "methods = none"),
    ({"methods": ["cma", "cma"]}, "methods = cma, cma: give each once"),
    ({"methods": ["cmaes"]}, "there is no method 'cmaes'"),
    ({"seeds": 0}, "--seeds 0"),
    ({"seed": -1}, "--seed -1"),
    ({"evaluations": 0}, "--evaluations 0"),
    ({"seconds": float("nan")}, "--seconds nan"),
    ({"seeds": 10**7}, "20000000 tasks: a sweep has at most"),
])  # fmt: skip
def test_what_cannot_be_swept_is_told(scenes, words, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sweep_tasks(scenes["spacing"], ["physics.push=4,8"], **words)


# results ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swept(scenes) -> Sweep:
    axes = ["physics.friction=0.1,0.3", "physics.push=6:10:3"]
    return sweep(scenes["spacing"], axes, ["auto", "random"], 2, 40)


def test_every_method_searches_every_point_with_every_seed(scenes, swept: Sweep) -> None:
    runs = [(r.labels, r.method, r.seed) for r in swept.results]
    assert len(set(runs)) == len(runs) == 2 * 3 * 2 * 2
    assert swept.keys == ("physics.friction", "physics.push")
    assert len(swept.points) == 6
    assert swept.failures == ()
    one = swept.results[13]
    physics = de.Physics(
        dict(one.labels)["physics.friction"], 9.81, dict(one.labels)["physics.push"]
    )
    alone = search(replace(scenes["spacing"], physics=physics), one.method, 40, one.seed)
    assert (one.score, one.gain) == (alone.score, alone.gain)
    assert np.array_equal(one.spacing, alone.layout.spacing)
    for result in swept.results:
        assert result.score <= swept.best_of(result)


def test_the_folder(swept: Sweep, tmp_path: Path) -> None:
    write(swept, tmp_path / "out")
    assert sorted(f.name for f in (tmp_path / "out").iterdir()) == sorted(FILES)
    with (tmp_path / "out" / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(swept.results)
    for row, r in zip(rows, swept.results, strict=True):
        assert [float(row[key]) for key in swept.keys] == [v for _, v in r.labels]
        assert (float(row["score"]), float(row["gain"]), row["key"]) == (r.score, r.gain, r.key)
        best = swept.best_of(r)
        assert float(row["gap"]) == pytest.approx((best - r.score) / best)
    assert (tmp_path / "out" / "sweep.png").read_bytes().startswith(b"\x89PNG")
    assert page(swept).count("| `auto` |") == 6


@pytest.mark.parametrize("axes", [
    ["physics.friction=0:0.4:3"],
    ["objective=mean_speed,toppled"],
    ["physics.friction=0.1,0.2", "physics.push=6,8", "row.count=5,6"],
], ids=["line", "words", "three"])  # fmt: skip
def test_pictures_of_other_sweeps(scenes, axes: list[str], tmp_path: Path) -> None:
    found = sweep(scenes["spacing"], axes, ["uniform"], evaluations=1)
    write(found, tmp_path)
    assert (tmp_path / "sweep.png").stat().st_size > 10_000


def test_a_scene_whose_waves_all_die_has_no_gain(scenes, tmp_path: Path) -> None:
    found = sweep(scenes["dead"], ["physics.push=0.3,0.5"], ["random"], evaluations=20)
    assert all(r.gain is None for r in found.results)
    write(found, tmp_path)
    assert "–" in page(found)


def test_a_text_that_a_spreadsheet_would_run_is_no_formula(swept: Sweep, tmp_path: Path) -> None:
    odd = replace(swept.results[0], labels=(("title", "=1+1"),))
    write(replace(swept, keys=("title",), results=(odd,)), tmp_path)
    with (tmp_path / "sweep.csv").open(newline="") as file:
        assert next(csv.DictReader(file))["title"] == "'=1+1"


# the command and its study ----------------------------------------------------------------------


def run_command(*words: str) -> int:
    parser = argparse.ArgumentParser()
    sweeps.add_arguments(parser)
    return sweeps.run(parser.parse_args(list(words)))


@pytest.fixture
def here(scenes, tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(scenes["spacing"].to_toml())
    return tmp_path


WORDS = ("mine.toml", "--set", "physics.push=6,8", "--methods", "random", "--evaluations", "20")


def test_the_command(here: Path, capsys) -> None:
    assert run_command(*WORDS) == 0
    out, said = capsys.readouterr()
    assert "study 'sweep-spacing' in runs/studies.sqlite: 2 searches" in out
    assert sorted(f.name for f in (here / "runs/sweep-spacing").iterdir()) == sorted(FILES)
    # no terminal: a line a task
    assert [line.split()[0] for line in said.splitlines()] == ["1/2", "2/2"]
    study = open_store("runs/studies.sqlite").study("sweep-spacing")
    assert [r.labels for r in study.done().values()] == [
        (("physics.push", 6.0),), (("physics.push", 8.0),)
    ]  # fmt: skip


def test_names_of_studies(here: Path, capsys, monkeypatch) -> None:
    with pytest.raises(ValueError, match="has no study 'sweep-spacing' of these tasks"):
        run_command(*WORDS, "--resume")
    run_command(*WORDS)
    run_command(*WORDS)
    assert "study 'sweep-spacing-2'" in capsys.readouterr().out
    with pytest.raises(ValueError, match=r"'sweep-spacing' with 2 results already: .*--resume"):
        run_command(*WORDS, "--name", "sweep-spacing")
    with pytest.raises(ValueError, match="has no study 'other' to go on with"):
        run_command(*WORDS, "--name", "other", "--resume")
    with pytest.raises(ValueError, match="was begun with"):
        run_command(*WORDS, "--seeds", "2", "--name", "sweep-spacing", "--resume")
    monkeypatch.setattr("optimize.studies.running.run_task", None)  # nothing is left to run
    capsys.readouterr()
    assert run_command(*WORDS, "--resume") == 0
    assert "2 of them done before" in capsys.readouterr().out


@pytest.mark.parametrize("words", [("--workers", "0"), ("--dask", "nowhere")])
def test_an_executor_that_cannot_be_leaves_no_study_behind(here: Path, words: tuple) -> None:
    if "--dask" in words:
        pytest.importorskip("distributed")
    with pytest.raises(ValueError, match=r"give 1 to|give the address of a scheduler"):
        run_command(*WORDS, *words)
    assert not (here / "runs").exists()


def test_a_folder_that_cannot_be_written_is_told_at_once(here: Path, monkeypatch) -> None:
    (here / "file").write_text("")
    monkeypatch.setattr("optimize.studies.running.run_task", None)
    with pytest.raises(ValueError, match="cannot be written"):
        run_command(*WORDS, "--out", "file/below")


PROGRAM = """
import sys
from domino_env.cli import main as command
from optimize.cli import sweeps

class Entry:
    name = "sweep"
    load = staticmethod(lambda: sweeps)

command.entry_points = lambda group: [Entry]
if __name__ == "__main__":
    sys.exit(command.main())
"""


def still_there(group: int) -> bool:
    """Whether any process of a group outlives the next seconds; those that wait to be buried do
    not count."""
    for _ in range(100):
        states = []
        for file in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):
                state, _, its_group = file.read_text().rpartition(")")[2].split()[:3]
                states += [state] * (int(its_group) == group)
        if all(state == "Z" for state in states):
            return False
        time.sleep(0.05)
    return True


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_and_resume_goes_on(here: Path, scenes, number: int, status: int) -> None:
    """In a session of its own, as from a terminal: Ctrl-C reaches the workers too."""
    (here / "program.py").write_text(PROGRAM)
    words = ["mine.toml", "--set", "physics.push=6:10:9", "--methods", "random"]
    words += ["--evaluations", "15000", "--workers", "2"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_NUM_THREADS": "1"}
    with subprocess.Popen(
        [sys.executable, "program.py", "sweep", *words],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    ) as process:  # fmt: skip
        try:
            assert process.stderr is not None
            first = process.stderr.readline()
            assert first.startswith("1/9"), first + process.stderr.read()
            if number == signal.SIGINT:
                os.killpg(process.pid, number)
            else:
                process.send_signal(number)
            _, said = process.communicate(timeout=60)
            assert not still_there(process.pid)  # no worker is left
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == status, said
    assert "what is done is in study 'sweep-spacing'; the same command with --resume" in said
    assert "Traceback" not in said
    store = open_store("runs/studies.sqlite")
    kept = store.study("sweep-spacing").done()
    assert 1 <= len(kept) < 9
    assert run_command(*words[:-2], "--resume") == 0
    found = store.study("sweep-spacing").done()
    assert len(found) == 9
    assert {key: found[key].seconds for key in kept} == {k: r.seconds for k, r in kept.items()}
    fresh = run_sweep(scenes["spacing"], sweep_tasks(
        scenes["spacing"], ["physics.push=6:10:9"], ["random"], evaluations=15000
    ))  # fmt: skip
    assert {r.key: r.score for r in fresh.results} == {k: r.score for k, r in found.items()}


# progress ---------------------------------------------------------------------------------------


class Terminal:
    """Takes what is written and claims to be a terminal."""

    encoding = "utf-8"

    def __init__(self) -> None:
        self.text = ""

    def write(self, text: str) -> int:
        self.text += text
        return len(text)

    def flush(self) -> None:
        pass

    def isatty(self) -> bool:
        return True


def test_lines_on_a_terminal(scenes, monkeypatch) -> None:
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    axes = ["physics.push=6,8"]
    lines = TaskLines(2, "mine")
    sweep(scenes["spacing"], axes, ["random"], evaluations=4000, lines=lines)
    assert "mine, 0 of 2" in screen.text
    assert "mine, 2 of 2" in screen.text
    assert "physics.push = 8.0, random, seed 0" in screen.text  # the search that runs
    assert " left" in screen.text


def test_nothing_is_shown_where_there_is_no_terminal(scenes, capsys) -> None:
    sweep(scenes["spacing"], ["physics.push=6,8"], ["uniform"], evaluations=1)
    assert capsys.readouterr() == ("", "")


def test_the_time_left_is_that_of_the_pace_so_far(monkeypatch) -> None:
    clock = [100.0]
    monkeypatch.setattr("optimize.studies.progress.time.monotonic", lambda: clock[0])
    lines = TaskLines(10, "tasks", shown=False)
    lines.begin(4)
    assert lines.seconds_left is None
    clock[0] = 120.0
    lines._done = 6
    assert lines.seconds_left == pytest.approx(40.0)  # two in 20 s, four to go
    assert [in_words(t) for t in (5.0, 600.0, 7200.0 * 2)] == ["5 s", "10 min", "4.0 h"]
