"""The benchmark: its statistics on known numbers, and complete runs with a small budget."""

import csv
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
    ends_of_scale,
    learning_curve,
    normalised_score,
    read_target,
    references,
    target_hash,
)
from agents.benchmark_report import (
    EARLIER,
    FILES,
    SUMMARY,
    budget_of,
    gather,
    page,
    read_runs,
    write,
)
from agents.draw import shipped_references
from agents.evaluation import evaluate_gains
from agents.policy import ScenePolicy
from agents.third_party import load_fit
from domino_env.cli.main import main
from domino_env.core.results import revision
from domino_env.core.tables import write_csv
from optimize.experiments.best_known import best_known, best_known_of
from optimize.experiments.estimates import (
    estimate,
    interquartile_mean,
    mean,
    median,
)
from optimize.experiments.experiment import best_of_problems
from optimize.experiments.runner import run_experiment
from optimize.experiments.store import open_store

# normalised scores of five runs on three problems, some of them equal
SCORES = np.random.default_rng(0).normal(0.5, 0.3, (5, 3)).round(1)


def test_estimates_follow_the_definitions_of_rliable():
    """Compare with the definitions of rliable, written with functions of SciPy."""
    problems = list(SCORES.T)
    middle = interquartile_mean(problems)
    assert middle.value == pytest.approx(stats.trim_mean(SCORES.ravel(), 0.25))
    assert estimate(mean, problems).value == pytest.approx(SCORES.mean())
    assert estimate(median, problems).value == pytest.approx(np.median(SCORES, axis=0).mean())

    def trimmed(*groups: np.ndarray, axis: int) -> np.ndarray:
        return stats.trim_mean(np.concatenate(groups, axis=axis), 0.25, axis=axis)

    expected = stats.bootstrap(problems, trimmed, method="percentile", rng=1).confidence_interval
    assert middle.interval == pytest.approx(tuple(expected), abs=0.02)


def test_estimates_weight_problems_equally():
    few, many = np.array([0.0, 1.0]), np.repeat([2.0, 3.0], 40)
    for statistic in (interquartile_mean, mean, median):
        value = statistic([few, many])
        assert getattr(value, "value", value) == pytest.approx(1.5)


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
    done = run_experiment(known)
    assert [len(done.runs(name)) for name in ("ppo", "cma", "ramp")] == [3, 3, 1]
    learned = done.runs("ppo")[0]
    times = np.array([119.9, 120.0, 240.0])
    best = done.best_scores(learned, times)
    assert done.normalise(learned, best).tolist() == [-np.inf, 0.0, 1.0]
    assert done.best_steps(learned, "steps")[0].tolist() == [10.0, 20.0]
    cut = done.until("steps", 19)  # two entries of the trace, at 10 and at 20
    assert [(r.score, r.seconds) for r in cut.runs("ppo")] == [(0.5, 120.0)] * 3
    assert [float(done.until("seconds", x).mean_score("cma").value) for x in (0.7, 1.0)] == [0, 1]
    assert not done.until("steps", 9).results
    for known, normalised in ((0.5, 0.0), (0.75, 2.0)):  # no gain is possible; a fixed reference
        best = best_of_problems(done.results, lambda _, known=known: known, fixed=True)
        assert replace(done, best=best).normalise(learned, 1.0) == normalised
    assert best_of_problems(done.results, fixed=True) == {"small": 1.0}
    assert replace(done, zero={"small": 0.75}).normalise(learned, 0.875) == 0.5


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
    assert {"revision", "processor", "torch"} <= learned.versions.keys()
    changed = msgspec.structs.replace(ramp, scene=replace(SMALL, count=8).to_toml())
    assert gather([learned, ramp, searched, changed]).results == (changed,)  # another scene

    tasks = benchmark_tasks(["small.toml"], ["ppo"], 1, 3000, 0.2)
    (trained / "summary.json").unlink()  # as if it had been killed before its end
    line = next(one for one in first["benchmark.csv"].decode().splitlines() if ",ppo," in one)
    assert repr(tasks[0].run().score) == line.split(",")[5]


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
    curve = learning_curve(tasks[0].folder)  # its scores are those in the test set
    assert curve["score"][-1] == pytest.approx(learned.score, abs=1e-8)
    assert searched.work["simulations"] > 30
    assert searched.work["gradients"] == 0
    again = [evaluate(tasks[0].folder, scene).gain for scene in three]  # one by one
    assert gains.tolist() == pytest.approx(again, abs=1e-6)
    assert searched.trace["score"][-1] == pytest.approx(searched.score, abs=1e-6)
    assert "baselines in the test set" in page(gather([learned]), "")
    target_hash.cache_clear()  # that of the three scenes


@pytest.mark.parametrize("scene", ["sprint", "draw", "varied"])
def test_a_normalised_score_is_0_for_the_uniform_baseline_and_1_for_the_best_known(scene):
    if scene == "sprint":
        best = best_known()[scene].score
        threshold = gymnasium.spec("DominoChain-v2").reward_threshold
        uniform = de.load_scene(scene).uniform().score
        assert threshold == pytest.approx(50.0 * (best / uniform - 1.0), abs=0.05)
    elif scene == "draw":
        best, uniform = references()[scene]["one"], evaluate("plan", scene).score
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


@pytest.mark.parametrize(("arguments", "learns"), [
    ("make_env, steps, seed", True), ("make_env, steps, seed, rate=1.0", True),
    ("evaluator, rng", False), ("evaluator, rng, patience=5", False),
])  # fmt: skip
def test_a_function_of_three_arguments_is_a_learning_algorithm(
    arguments, learns, tmp_path, monkeypatch
):
    monkeypatch.syspath_prepend(str(tmp_path))
    name = f"method_{abs(hash(arguments))}"
    (tmp_path / f"{name}.py").write_text(f"def run({arguments}): ...\n", "utf-8")
    assert (load_fit(f"{name}:run") is not None) == learns


def test_random_scenes_have_the_references_that_can_build_them():
    tasks = benchmark_tasks(["jitter", "tempo-noise", "draw"], ["ramp"], 1)
    names = "plan", "plan", "controller", "plan", "rule"
    assert tuple(task.method for task in tasks) == names
    for name, reacting in (("varied-draw", "rule"), ("varied-tempo", "controller")):
        tasks = benchmark_tasks([name], ["apg", "ppo", "cma"], 1)  # APG cannot learn there
        assert [task.method for task in tasks] == ["ppo", "plan", reacting]
    jitter = read_target(de.load_scene("jitter").to_toml())
    assert ends_of_scale(jitter) == (de.load_scene("jitter").uniform().score, -np.inf)
    for name, numbers in references().items():
        scores = np.array([numbers[key] for key in ("zero", "one", "hindsight")])
        zero, one, hindsight = normalised_score(scores, name)
        assert (zero, one) == (0.0, 1.0) < (hindsight, hindsight)
    assert references()["draw"]["hindsight"] == float(shipped_references()["hindsight"])
    with pytest.raises(ValueError, match="scenes = small, small: give each once"):
        benchmark_tasks([SMALL, SMALL.replace(physics=de.Physics(0.1))], ["ramp"], 1)
    with pytest.raises(ValueError, match="'small' has no test set: name a fixed scene, or one"):
        benchmark_tasks([small_scenes()], ["ramp"], 1)


@pytest.mark.parametrize(("given", "message"), [
    ("--seeds 0", "seeds = 0: give a whole number, at least 1"),
    ("--algorithms ppo,ppo", "algorithms = ppo, ppo: give each once"),
    ("--algorithms pppo", "algorithm = 'pppo': did you mean 'ppo'? choose one of apg, ppo, ars, "),
    ("--page", "runs/studies.sqlite holds no store: give the file of one (--store)"),
])  # fmt: skip
def test_invalid_options_are_rejected(given, message, tmp_path, monkeypatch, error_of):
    monkeypatch.chdir(tmp_path)
    assert message in error_of("benchmark", "sprint", *given.split())


@pytest.fixture(scope="module")
def lines():
    """Return the lines of ten trainings of docs/benchmark.csv, by column."""
    with Path("docs/benchmark.csv").open(newline="", encoding="utf-8") as file:
        runs = [run for run in csv.DictReader(file) if run["scene"] == "sprint"]
    return [run for run in runs if run["algorithm"] == "ppo"]


@pytest.mark.parametrize(("change", "message"), [
    ({"scene": "sprnt"}, "line 4: scene = 'sprnt': did you mean 'sprint'?"),
    ({"seed": "7"}, "line 4: seed = '7': give a whole number from 100 to"),
    ({"seed": "100"}, "ppo on sprint: seed 100 has several lines; keep one"),
    ({"score": "nan"}, "line 4: score = 'nan': give a number from -1 to"),
    ({"steps": "1.5"}, "line 4: steps = '1.5': give a whole number from 0 to"),
    ({"revision": "0123456789ab"}, "line 4: revision = '0123456789ab': these are environments of"),
    ({"scene_hash": "0"}, "line 4: scene_hash = '0': scene 'sprint' has 8d8f695cfedc; run it"),
    ({"normalised_score": "0.99"}, "line 4: normalised_score = 0.99: in scene 'sprint' it is 0.9"),
    ({"uniform": "0.8"}, "line 4: uniform = 0.8: in scene 'sprint' it is 0.80300"),
    ({"trace": ""}, "line 4: trace"),
    ({"versions": "3"}, "line 4: versions: not JSON ('int' object is not iterable); copy the"),
], ids=lambda value: " ".join(value) if isinstance(value, dict) else "")  # fmt: skip
def test_the_check_of_a_table_names_line_column_value_and_accepted_values(
    lines, change, message, tmp_path, error_of
):
    path = tmp_path / "own.csv"
    write_csv(
        path, lines[0], (line.values() for line in [*lines[:2], lines[2] | change, *lines[3:]])
    )
    error = error_of("benchmark", "--check", str(path))
    assert f"{path}: 1 error: {message}" in error


def test_the_check_of_a_table_accepts_what_a_benchmark_wrote(lines, tmp_path, output_of, error_of):
    path = tmp_path / "own.csv"
    write_csv(path, lines[0], (line.values() for line in lines))
    output = output_of("benchmark", "--check", str(path), "--page", "--out", str(tmp_path / "page"))
    assert output.startswith(f"{path}: 10 runs, no error\n\nTrainings until 30,000 steps:")
    assert {run.versions["revision"] for run in read_runs(path)} <= {EARLIER, revision()}
    written = read_runs(tmp_path / "page" / "benchmark.csv")
    assert [run.score for run in written] == [float(line["score"]) for line in lines]
    write_csv(path, lines[0], (line.values() for line in lines[:3]))
    message = "ppo on sprint: 3 seeds; run at least 5 (--seeds 5, better 10)"
    assert message in error_of("benchmark", "--check", str(path))
    text = path.read_text("utf-8").rstrip()
    path.write_text(text[: text.rindex(',"[[')], "utf-8")
    assert "line 4: trace: not JSON" in error_of("benchmark", "--check", str(path))
    path.write_text("scene,algorithm\n", "utf-8")
    assert "without the columns seed, revision," in error_of("benchmark", "--check", str(path))


@pytest.mark.parametrize(("steps", "scores"), [(39_936, [0.7]), (60_000, [0.6, 0.7])])
def test_a_training_counts_for_its_budget_with_the_rest_of_its_last_rollout(
    steps, scores, tmp_path, monkeypatch
):
    for name in ("draw_intervals", "draw_over_steps"):
        monkeypatch.setattr(f"optimize.experiments.pictures.{name}", lambda *_: None)
    run, *_ = read_runs(Path("docs/benchmark.csv"))
    trace = {"steps": [0, 20_000, 38_000, steps], "seconds": [0.0, 1.0, 2.0, 3.0]}
    run = msgspec.structs.replace(
        run, method="sac", score=0.7, work={"steps": steps}, seconds=3.0,
        trace=trace | {"score": [0.5, 0.6, 0.7, 0.7]},
    )  # fmt: skip
    runs = [msgspec.structs.replace(run, seed=100 + i) for i in range(5)]
    write(gather(runs), tmp_path, "domino benchmark")
    with (tmp_path / SUMMARY).open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    assert [float(line["best_score"]) for line in lines] == scores
    # when the best policy was found, not the end
    assert [float(line["steps"]) for line in lines] == [20_000, 38_000][-len(scores) :]


def test_only_a_shipped_scene_has_a_best_known_layout():
    sprint = de.load_scene("sprint")
    assert best_known_of(sprint).score == best_known()["sprint"].score
    assert best_known_of(sprint.replace(physics=de.Physics(friction=0.1))) is None


def test_the_table_of_the_documentation_is_accepted():
    runs = read_runs(Path("docs/benchmark.csv"))
    keys = {(run.scene_name, run.method, run.seed, budget_of(run)) for run in runs}
    assert len(keys) == len(runs) > 400
