"""search(): its arguments and its end."""

import re
import signal
from dataclasses import replace
from itertools import count
from types import SimpleNamespace

import numba
import numpy as np
import pytest

import domino_env as de
from domino_env.core.threads import allowed_threads
from domino_env.rigid import dynamics
from domino_env.scenes import uniform
from optimize import Evaluator, search
from optimize.experiments.task import Task


def test_a_length_may_leave_one_gap_inside_its_bounds():
    for length in (0.024, 0.057, 0.0621, 0.0735, 0.09):
        scene = de.Scene(
            count=3, spacing=(0.002, 0.04), thickness=(0.0075, 0.0075), length=length, name="short"
        )
        assert search(scene, "auto", budget=60).score >= scene.uniform().score


@pytest.mark.parametrize(("words", "message"), [
    ({"method": "cmaes"}, "method = 'cmaes': did you mean 'cma'? choose one of auto, cma"),
    ({"budget": 0}, "budget = 0: give a whole number, at least 1"),
    ({"seconds": 0.0}, "seconds = 0.0 s: give a finite number, more than 0"),
    ({"tolerance": 0.0}, "tolerance = 0.0: give a finite number, more than 0, less than 1"),
    ({"seed": -1}, "seed = -1: give a whole number, at least 0"),
    ({"rng": "one"}, "rng = 'one': give a whole number, at least 0"),
    ({"seed": 0, "rng": 0}, "seed and rng are both given: give one of them"),
    ({"rng": np.random.default_rng(0), "resume": True, "folder": "runs"},
     "resume = True with a generator: a search resumes from its seed, give one"),
    ({"executor": 3}, "executor = 3: give a concurrent.futures.Executor"),
    ({"callback": 3}, "callback = 3: give a function of the Evaluator"),
    ({"clock": 3}, "clock = 3: give a function that returns seconds"),
    ({"seconds_before": float("nan")}, "seconds_before = nan s: give a finite number, at least 0"),
    ({"folder": 3}, "folder = 3: give a path, as a string or a pathlib.Path"),
    ({"scene": "sprnt"}, "there is no scene 'sprnt': did you mean 'sprint'?"),
    ({"scene": replace(de.load_scene("sprint"), spacing=(0.02, 0.02))}, "leaves nothing free"),
])  # fmt: skip
def test_impossible_searches_are_rejected(words, message):
    with pytest.raises((ValueError, TypeError), match=message.replace("?", r"\?")):
        search(**({"scene": "sprint"} | words))


def test_the_seconds_of_a_search_include_its_uniform_baseline(scenes, monkeypatch):
    now, find = [0.0], uniform.best_point

    def slow(scene: de.Scene) -> object:
        now[0] += 5.0
        return find(scene)

    def clock() -> float:
        return now[0]

    monkeypatch.setattr(uniform, "best_point", slow)
    scene = replace(scenes["spacing"], count=8, name="slow")
    result = search(scene, "random", seconds=4.0, clock=clock)
    assert (result.stop_reason, result.seconds) == ("limit of 4 s reached", 5.0)
    text = replace(scene, count=9).to_toml()
    tasks = [Task(text, "random", seed, seconds=4.0) for seed in range(3)]
    assert [task.run(clock=clock).seconds for task in tasks] == [5.0] * 3
    assert now == [10.0]  # found once for all tasks


@pytest.mark.parametrize("method", ["auto", "random"])
def test_a_limit_ends_a_search_during_a_simulation_on_a_floor(scenes, monkeypatch, method):
    now, advance = [0.0], dynamics.advance

    def slow(*arguments: object) -> object:
        now[0] += 1.0  # each piece takes a second
        return advance(*arguments)

    monkeypatch.setattr(dynamics, "advance", slow)
    clock = SimpleNamespace(perf_counter=lambda: now[0])
    monkeypatch.setattr("domino_env.scenes.uniform.time", clock)
    scene = scenes["spacing"].replace(floor_friction=0.11, spacing=(0.01, 0.02))
    result = search(scene, method, seconds=100.0, clock=lambda: now[0])
    assert 100.0 <= result.seconds <= 100.0 + 2 * allowed_threads()
    assert now[0] <= 100.0 + 4 * allowed_threads()  # threads end their pieces


def test_a_baseline_on_a_floor_keeps_its_limit(scenes):
    scene = scenes["spacing"].replace(floor_friction=0.31, count=5)
    result = search(scene, "random", seconds=1e-9)
    assert result.evaluations <= allowed_threads()
    assert result.uniform is result.scene.uniform()
    assert scene.uniform().score >= result.uniform.score  # without a limit


@pytest.mark.parametrize(("method", "tolerance"), [("random", None), ("powell", 1e-2)])
def test_a_search_ends_where_its_second_half_gained_less_than_the_tolerance(
    scenes, monkeypatch, method, tolerance
):
    monkeypatch.setattr("optimize.evaluator.LEAST_EFFORT", 40_000)  # over 40 dominoes
    result = search(scenes["both"], method, tolerance=tolerance)
    half = max(score for n, _, _, score in result.trace if n <= result.evaluations // 2)
    assert result.evaluations >= 1000
    assert result.trace[-1][3] - half < (tolerance or 1e-4) * result.score
    assert re.match(r"the second half of the search gained .* \(tolerance", result.stop_reason)
    limited = search(scenes["both"], method, 2 * result.evaluations)
    assert limited.stop_reason.startswith("limit of ")
    assert limited.score >= result.score


def test_the_largest_effort_is_inverse_to_the_tolerance(scenes, monkeypatch):
    monkeypatch.setattr("optimize.evaluator.MOST_EFFORT", 40_000)
    for tolerance, effort in ((1e-4, 1000), (1e-5, 10_000)):
        monkeypatch.setattr("optimize.evaluator.LEAST_EFFORT", 40 * effort)
        result = search(scenes["both"], "random", tolerance=tolerance, budget=30_000)
        assert effort <= result.evaluations < effort + 300


def test_ctrl_c_before_the_first_layout_is_raised(scenes, monkeypatch):
    monkeypatch.setattr(Evaluator, "evaluate", lambda *_: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        search(scenes["spacing"], "random", budget=10)


def test_the_result_has_the_reason_of_the_end(scenes):
    scene = scenes["spacing"]
    assert search(scene, "uniform").stop_reason == "done: the method has nothing left to try"
    early = search(scene, "auto", 60).stop_reason
    assert early.startswith("limit of 60 layouts reached; no independent searches have ended")


def test_auto_ends_when_independent_searches_agree(bits, scenes, tmp_path):
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        alone = search(scenes["spacing"], seed=1)
    finally:
        numba.set_num_threads(threads)
    assert re.fullmatch(
        r"done: ([3-9]) of \d+ indep.* without gain; .* 0.02 % .*", alone.stop_reason
    )
    limited = search(scenes["spacing"], budget=alone.evaluations - 1, seed=1, folder=tmp_path)
    assert limited.stop_reason.startswith(f"limit of {alone.evaluations - 1} layouts reached; ")
    resumed = search(scenes["spacing"], seed=1, folder=tmp_path, resume=True)
    assert (resumed.stop_reason, bits(resumed)) == (alone.stop_reason, bits(alone))


def test_auto_uses_a_given_limit(scenes):
    now = count(step=0.002)  # seconds
    done = search(scenes["one-gap"], seed=1)
    assert done.stop_reason.startswith("done: ")
    for limit in ({"budget": done.evaluations + 100}, {"seconds": 5.0, "clock": now.__next__}):
        result = search(scenes["one-gap"], seed=1, **limit)
        assert result.stop_reason.startswith("limit of ")
        assert result.evaluations > done.evaluations


@pytest.mark.parametrize("method", ["random", "cma"])
def test_random_numbers_come_from_a_seed_or_a_generator(bits, scenes, tmp_path, method):
    generator = np.random.default_rng(3)
    seeded = search(scenes["spacing"], method, 100, 3)
    given = [{"rng": 3}, {"rng": np.int64(3)}, {"rng": generator, "folder": tmp_path}]
    results = [search(scenes["spacing"], method, 100, **words) for words in given]
    assert [bits(result) for result in results] == [bits(seeded)] * 3
    assert [result.seed for result in (seeded, *results)] == [3, 3, 3, None]
    assert bits(search(scenes["spacing"], method, 100, rng=generator)) != bits(seeded)
    unseeded = search(scenes["spacing"], method, 100)
    assert bits(unseeded) == bits(search(scenes["spacing"], method, 100, seed=0))
    with pytest.raises(ValueError, match=r"holds another search, by .* with seed None"):
        search(scenes["spacing"], method, 100, folder=tmp_path, resume=True)


def test_a_layout_that_completes_only_by_rounding_does_not_win(scenes, monkeypatch):
    """Near a stall a wave may complete at the tolerance of the search and not at a closer one."""
    scene = scenes["spacing"]
    expected = search(scene, "random", budget=300)
    original, gaps = de.Scene.evaluate, []

    def inflated(scene: de.Scene, batch, gradient=False, stop=None):
        gaps.extend(batch.spacing)
        result = original(scene, batch, gradient, stop)
        result.score[-1] = 5.0 if len(gaps) == 302 else result.score[-1]  # two of them compile
        return result

    monkeypatch.setattr(de.Scene, "evaluate", inflated)
    result = search(scene, "random", budget=300)
    assert result.trace[-1][3] == 5.0
    assert result.score == expected.score == scene.score(result.layout)


def test_auto_ends_when_a_schedule_is_met():
    result = search("tempo")
    assert result.stop_reason == "done: every domino is hit on schedule, to 1e-09 s"
    assert result.score > 1.0 - 1e-6
