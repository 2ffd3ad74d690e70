"""The benchmark: its statistics on known numbers, and its whole path with a tiny budget."""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import domino_env as de
from agents import evaluate
from agents.benchmark import BenchmarkTask, benchmark_tasks, known_in
from agents.benchmark_report import FILES
from agents.benchmark_report import page as benchmark_page
from agents.evaluation import STOPPED, gains_of
from agents.policy import ScenePolicy
from domino_env.cli.main import main
from optimize.experiments.estimates import interquartile_mean, performance_profile
from optimize.experiments.experiment import Experiment
from optimize.experiments.runner import run_experiment
from optimize.experiments.store import open_store
from optimize.experiments.task import TaskResult

SMALL = replace(de.load_scene("sprint"), name="small", count=7)


def test_an_interquartile_mean_is_that_of_the_middle_half() -> None:
    estimate = interquartile_mean(
        [np.array([-90.0, 1.0, 2.0]), np.array([3.0, 4.0, 5.0, 6.0, 700.0])]
    )
    assert estimate.value == pytest.approx((2.0 + 3.0 + 4.0 + 5.0) / 4)


def test_an_interval_covers_all_resamples_of_two_runs() -> None:
    """A quarter of the resamples of 0 and 1 are (0, 0), a quarter (1, 1)."""
    estimate = interquartile_mean([np.array([[0.0, 1.0], [5.0, 5.0]])])
    assert np.array_equal(estimate.low, [0.0, 5.0])
    assert np.array_equal(estimate.high, [1.0, 5.0])
    two = interquartile_mean([np.array([[0.0, 1.0], [5.0, 5.0]]), np.array([[0.2], [5.0]])])
    assert np.allclose(two.low, [0.2 / 3, 5.0])  # a single run stays as it is
    assert np.allclose(two.high, [2.2 / 3, 5.0])


def test_a_problem_without_a_layout_lowers_the_interval() -> None:
    estimate = interquartile_mean([np.array([-np.inf, -np.inf]), np.array([0.5, 0.7, 0.9])])
    assert estimate.low == -np.inf
    assert estimate.high <= 0.9


def test_runs_are_resampled_within_their_scene() -> None:
    """Check that the interval has no width if only the scenes differ."""
    estimate = interquartile_mean([np.full(3, 0.2), np.full(3, 0.9)])
    assert estimate.low == estimate.value == estimate.high == pytest.approx(0.55)


def test_a_profile_counts_the_runs_beyond_each_target() -> None:
    targets = np.array([-1.0, 0.0, 0.5, 1.0])
    profile = performance_profile([np.array([0.1, 0.6]), np.array([-0.5, 0.9])], targets)
    assert profile.value.tolist() == [1.0, 0.75, 0.5, 0.0]
    assert (profile.low[1], profile.high[1]) == (0.5, 1.0)


@dataclass(frozen=True)
class KnownTask(BenchmarkTask):
    """A task with a known result."""

    def run(self, callback=None, clock=None) -> TaskResult:
        seconds = 240.0 if self.method == "ppo" else 1.0
        trace = [(10, 10, 0.5 * seconds, 0.5), (20, 20, seconds, 1.0)]
        return self.result_of(trace, 1.0, 0.5, None)


def test_curves_are_read_on_both_clocks() -> None:
    tasks = benchmark_tasks([SMALL], ["ppo", "cma", "ramp"], seeds=3)
    done = run_experiment([KnownTask(*astuple(task)) for task in tasks], known_score=known_in)
    assert [len(done.runs(name)) for name in ("ppo", "cma", "ramp")] == [3, 3, 1]
    learned = done.runs("ppo")[0]
    times = np.array([119.9, 120.0, 240.0])
    best = done.best_scores(learned, times)
    assert done.normalised(learned, best).tolist() == [-np.inf, 0.0, 1.0]
    assert done.steps(learned, "evaluations")[0].tolist() == [10.0, 20.0]
    assert done.score_after("cma", 0.7) == 0.0
    assert done.seconds_past_uniform(learned) == 240.0
    without_gain = Experiment(done.tasks, done.results, {"small": 0.5})
    assert without_gain.normalised(learned, 1.0) == 0.0


def test_a_benchmark_trains_once_continues_and_writes_the_same_page_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text(SMALL.to_toml(), "utf-8")
    command = "benchmark small.toml --algorithms ppo,ramp,auto --seeds 1 --steps 3000 --seconds 0.2"
    assert main(command.split()) == 0
    home = tmp_path / "runs" / "benchmark"
    first = {name: (home / name).read_bytes() for name in FILES}
    (trained,) = home.glob("small-ppo-0-*")
    assert sum(line.startswith(b"small,") for line in first["benchmark.csv"].splitlines()) == 3
    assert main([*command.split(), "--page"]) == 0
    assert {name: (home / name).read_bytes() for name in FILES} == first

    tasks = benchmark_tasks(["small.toml"], ["ppo", "ramp", "auto"], 1, 3000, 0.2)
    with monkeypatch.context() as patch:
        patch.setattr(BenchmarkTask, "run", None)  # nothing is left to run
        study = open_store("runs/studies.sqlite").study("benchmark")
        done = run_experiment(tasks, study=study, known_score=known_in)
    assert done.runs("auto")[0].evaluations % (SMALL.count - 1) == 0  # dominoes placed

    (trained / "summary.json").unlink()  # as if it had been killed before its end
    line = next(one for one in first["benchmark.csv"].decode().splitlines() if ",ppo," in one)
    assert repr(tasks[0].run().score) == line.split(",")[4]


def test_the_score_with_sampled_scenes_is_the_median_gain_in_the_test_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    three = de.load_test_set("varied")[:3]
    monkeypatch.setattr("agents.benchmark.load_test_set", lambda name: three)
    tasks = benchmark_tasks(["varied"], ["ars", "cma", "uniform"], 2, 4000, 0.5)
    assert [t.name for t in tasks][-1] == "varied, ars, seed 1"  # searches run once
    learned, searched, plain = (task.run() for task in tasks[:3])
    assert (plain.score, plain.uniform_score) == (0.0, 0.0)
    policy = ScenePolicy.load(tasks[0].folder).policy
    gains = gains_of(policy, de.load_distribution("varied"), three)
    assert learned.score == np.median(gains)
    again = [evaluate(tasks[0].folder, scene).gain for scene in three]  # one by one
    assert gains.tolist() == pytest.approx(
        [STOPPED if gain is None else gain for gain in again], abs=1e-6
    )
    assert searched.trace[-1][3] == pytest.approx(searched.score, abs=1e-6)
    assert "baselines in the test set" in benchmark_page(
        run_experiment([KnownTask(*astuple(tasks[0]))], known_score=known_in), ""
    )


@pytest.mark.parametrize(("given", "message"), [
    ("--seeds 0", "seeds = 0: give a finite number, more than 0"),
    ("--algorithms ppo,ppo", "algorithms = ppo, ppo: give each once"),
    ("--algorithms nobody", "nobody"),
    ("--page", "there is no store"),
])  # fmt: skip
def test_invalid_options_are_rejected(
    given: str, message: str, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["benchmark", "sprint", *given.split()]) == 2
    assert message in capsys.readouterr().err
