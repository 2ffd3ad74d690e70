"""The benchmark: its statistics on known numbers, and complete runs with a small budget."""

from dataclasses import astuple, dataclass, replace
from pathlib import Path

import gymnasium
import msgspec
import numpy as np
import pytest
from env_scenes import SMALL
from sampled_scenes import small_scenes
from scipy import stats

pytest.importorskip("stable_baselines3")

import domino_env as de
from agents import evaluate
from agents.benchmark import (
    BenchmarkTask,
    benchmark_tasks,
    best_known_score,
    learning_curve,
    normalised_score,
)
from agents.benchmark_report import FILES, gather, page
from agents.draw import shipped_references
from agents.evaluation import evaluate_gains
from agents.policy import ScenePolicy
from domino_env.cli.main import main
from optimize.experiments.best_known import best_known
from optimize.experiments.estimates import (
    interquartile_mean,
    optimality_gap,
    performance_profile,
)
from optimize.experiments.experiment import best_of_problems
from optimize.experiments.runner import run_experiment
from optimize.experiments.store import open_store

# normalised scores of five runs on three problems, some of them equal
SCORES = np.random.default_rng(0).normal(0.5, 0.3, (5, 3)).round(1)


def test_estimates_follow_the_definitions_of_rliable():
    """Compare with the definitions of rliable, written with functions of SciPy."""
    problems = list(SCORES.T)
    mean = interquartile_mean(problems)
    assert mean.value == pytest.approx(stats.trim_mean(SCORES.ravel(), 0.25))
    assert optimality_gap(problems) == pytest.approx(np.mean(1.0 - np.minimum(SCORES, 1.0)))

    def trimmed(*groups: np.ndarray, axis: int) -> np.ndarray:
        return stats.trim_mean(np.concatenate(groups, axis=axis), 0.25, axis=axis)

    expected = stats.bootstrap(problems, trimmed, method="percentile", rng=1).confidence_interval
    assert mean.interval == pytest.approx(tuple(expected), abs=0.02)


def test_estimates_weight_problems_equally_and_profiles_count_runs():
    few, many = np.array([0.0, 1.0]), np.repeat([2.0, 3.0], 40)
    assert interquartile_mean([few, many]).value == pytest.approx(1.5)
    assert performance_profile([few, many], np.array([0.5])).value == pytest.approx(0.75)
    runs = [np.array([0.1, 0.6, 0.7, 0.1, 0.6]), np.array([-0.5, 0.9, 0.9, -0.2, 0.9])]
    profile = performance_profile(runs, np.array([-1.0, 0.0, 0.5, 1.0]))
    assert profile.value == pytest.approx([1.0, 0.8, 0.6, 0.0])
    assert profile.interval[0][1] < 0.8 < profile.interval[1][1]


@pytest.mark.parametrize(("problems", "interval"), [
    ([np.arange(4.0)], None),
    ([np.arange(9.0), np.arange(4.0)], None),
    ([np.arange(5.0)], pytest.approx((2.0, 2.0), abs=2.0)),
    ([np.full(5, 0.2), np.full(5, 0.9)], pytest.approx((0.55, 0.55))),
    ([np.full(5, -np.inf), np.full(5, 0.9)], (-np.inf, -np.inf)),
], ids=["few", "few in a scene", "enough", "resampled within scenes", "no layout"])  # fmt: skip
def test_confidence_intervals(problems, interval):
    assert interquartile_mean(problems).interval == interval


@dataclass(frozen=True)
class KnownTask(BenchmarkTask):
    """A task with a known result."""

    def run(self, clock=None):
        seconds = 240.0 if self.method == "ppo" else 1.0
        trace = {"steps": [10, 20], "seconds": [0.5 * seconds, seconds], "score": [0.5, 1.0]}
        return self.make_result(trace, 1.0, 0.5, None)


def test_curves_are_evaluated_over_seconds_and_over_steps():
    tasks = benchmark_tasks([SMALL], ["ppo", "cma", "ramp"], seeds=3)
    known = [KnownTask(*astuple(task)) for task in tasks]
    done = run_experiment(known, known_score=best_known_score)
    assert [len(done.runs(name)) for name in ("ppo", "cma", "ramp")] == [3, 3, 1]
    learned = done.runs("ppo")[0]
    times = np.array([119.9, 120.0, 240.0])
    best = done.best_scores(learned, times)
    assert done.normalise(learned, best).tolist() == [-np.inf, 0.0, 1.0]
    assert done.best_steps(learned, "steps")[0].tolist() == [10.0, 20.0]
    assert done.score_after("cma", 0.7) == 0.0
    for known, normalised in ((0.5, 0.0), (0.75, 2.0)):  # no gain is possible; a fixed reference
        best = best_of_problems(done.results, lambda _, known=known: known, fixed=True)
        assert replace(done, best=best).normalise(learned, 1.0) == normalised
    assert best_of_problems(done.results, best_known_score, fixed=True) == {"small": 1.0}


def test_a_repeated_benchmark_trains_nothing_and_writes_the_same_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text(SMALL.to_toml(), "utf-8")
    command = "benchmark small.toml --algorithms ppo,ramp,auto --seeds 1 --steps 3000 --seconds 0.2"
    assert main(command.split()) == 0
    home = tmp_path / "runs" / "benchmark"
    first = {name: (home / name).read_bytes() for name in FILES}
    (trained,) = home.glob("small-ppo-100-*")
    assert sum(line.startswith(b"small,") for line in first["benchmark.csv"].splitlines()) == 3
    assert main([*command.split(), "--page"]) == 0
    assert {name: (home / name).read_bytes() for name in FILES} == first

    with monkeypatch.context() as patch:
        patch.setattr(BenchmarkTask, "run", None)  # nothing is left to run
        assert main([*command.split(), "--algorithms", "auto,ppo"]) == 0
    for name in {*FILES} - {"benchmark.md"}:  # ramp is still there; the page has the new command
        assert (home / name).read_bytes() == first[name]
    learned, ramp, searched = (
        open_store("runs/studies.sqlite").study("benchmark").results().values()
    )
    assert searched.work["steps"] == searched.work["evaluations"] * (SMALL.count - 1)
    assert ramp.work["simulations"] == 4059
    steps = learned.work["steps"]
    assert (learned.work["updates"], learned.work["gradients"]) == (4 * 8 * steps // 3072, 0)
    assert {"commit", "processor", "torch"} <= learned.versions.keys()
    changed = msgspec.structs.replace(ramp, scene=replace(SMALL, count=8).to_toml())
    assert gather([learned, ramp, searched, changed]).results == (changed,)  # another scene

    tasks = benchmark_tasks(["small.toml"], ["ppo"], 1, 3000, 0.2)
    (trained / "summary.json").unlink()  # as if it had been killed before its end
    line = next(one for one in first["benchmark.csv"].decode().splitlines() if ",ppo," in one)
    assert repr(tasks[0].run().score) == line.split(",")[4]


def test_the_score_with_sampled_scenes_is_the_median_gain_in_the_test_set(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    three = de.load_test_set("varied")[:3]
    monkeypatch.setattr("agents.benchmark.load_test_set", lambda name: three)
    monkeypatch.setattr("agents.sb3.training.choose_scenes", lambda *_: three)
    tasks = benchmark_tasks(["varied"], ["ars", "cma", "uniform"], 2, 4000, 0.5)
    assert [t.name for t in tasks][-1] == "varied, cma, seed 101"  # scripted policies run once
    learned, searched, plain = (task.run() for task in tasks[:3])
    assert (plain.score, plain.uniform_score) == (0.0, 0.0)
    policy = ScenePolicy.load(tasks[0].folder)
    assert learned.score == np.median([policy.build(scene).gain for scene in three]) != 0.0
    # at the tolerance of environments
    gains = evaluate_gains(policy.policy, de.load_distribution("varied"), three)
    assert learned.score == pytest.approx(np.median(gains), abs=1e-8)
    assert learned.trace["score"][-1] == learned.score
    assert learning_curve(tasks[0].folder)["score"][-1] == pytest.approx(learned.score)  # test set
    assert searched.work["simulations"] > 30
    assert searched.work["gradients"] == 0
    again = [evaluate(tasks[0].folder, scene).gain for scene in three]  # one by one
    assert gains.tolist() == pytest.approx(again, abs=1e-6)
    assert searched.trace["score"][-1] == pytest.approx(searched.score, abs=1e-6)
    assert "baselines in the test set" in page(gather([learned]), "")


@pytest.mark.parametrize("scene", ["sprint", "draw", "varied"])
def test_a_normalised_score_is_0_for_the_uniform_baseline_and_1_for_the_best_known(scene):
    if scene == "sprint":
        best = best_known()[scene].score
        threshold = gymnasium.spec("DominoChain-v2").reward_threshold
        uniform = de.load_scene(scene).uniform().score
        assert threshold == pytest.approx(50.0 * (best / uniform - 1.0), abs=0.05)
    elif scene == "draw":
        best, uniform = float(shipped_references()["hindsight"]), evaluate("uniform", scene).score
    else:
        best, uniform = 0.0204, 0.0
    scores = normalised_score(np.array([uniform, best]), scene)
    assert scores == pytest.approx([0.0, 1.0], abs=0.003)
    with pytest.raises(ValueError, match="'small' has no best known score: compare"):
        normalised_score(1.0, SMALL if scene == "sprint" else small_scenes())


def test_a_recurrent_policy_of_a_third_party_is_rejected(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "recurring.py").write_text(
        """if True:
        import numpy as np
        class Model:
            def predict(self, observations, state=None, episode_start=None, deterministic=False):
                state = np.zeros(len(observations)) if state is None else state + 1
                return 0.1 * state[:, None], state
        def fit(make_env, steps, seed):
            return Model()
        """,
        "utf-8",
    )
    (task,) = benchmark_tasks([SMALL], ["recurring:fit"], 1, 10)
    with pytest.raises(ValueError, match="recurring:fit: its policy is recurrent, but layouts"):
        task.run()


def test_random_scenes_have_the_references_that_can_build_them():
    tasks = benchmark_tasks(["jitter", "tempo-noise", "draw"], ["ramp"], 1)
    names = "plan", "plan", "controller", "plan", "rule"
    assert tuple(task.method for task in tasks) == names
    trace = {"seconds": [0.0], "score": [0.8]}
    known = [best_known_score(task.make_result(trace, 0.8, 0.7, None)) for task in tasks]
    hindsight = float(shipped_references()["hindsight"])
    assert known == [-np.inf, 1.0, 1.0, hindsight, hindsight]
    # of open-loop plans, as on docs/when-to-learn.md: a little of what hindsight allows
    assert 0.1 < normalised_score(0.2132, "tempo-noise") < 0.2
    with pytest.raises(ValueError, match="'small' has no test set: name a fixed scene, or one"):
        benchmark_tasks([small_scenes()], ["ramp"], 1)


@pytest.mark.parametrize(("given", "message"), [
    ("--seeds 0", "seeds = 0: give a whole number, at least 1"),
    ("--algorithms ppo,ppo", "algorithms = ppo, ppo: give each once"),
    ("--algorithms pppo", "algorithm = 'pppo': did you mean 'ppo'? choose one of apg, ppo, ars, "),
    ("--page", "no run has a result yet"),
])  # fmt: skip
def test_invalid_options_are_rejected(given, message, tmp_path, monkeypatch, error_of):
    monkeypatch.chdir(tmp_path)
    assert message in error_of("benchmark", "sprint", *given.split())
