"""Examples: trainings improve the policy, notebooks run, pages have the tables of programs."""

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from domino_env import load_scene, load_test_set
from domino_env.core.tables import fill_tables

CLAIMS = {  # what a notebook shows
    "speed_over_spacing": "abs(fit.friction - 0.178) < 1e-3",
    "error_and_run_time": "measurements['euler'][-1][1] > 1e-5 > measurements['rk4'][0][1]",
    "design_by_hand": "result.score > score > uniform.score",
    "train_compare_build": "1.002 * found.score > policy.score > 1.02 * equal.score"
    " and min(speeds['search']) > max(speeds['equal gaps'])",
}
ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "examples"


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("name", "longer"), [("ppo_in_one_file", 8), ("ppo_of_stable_baselines3", 30 * 64 * 64)]
)
def test_an_example_learns(name, longer, monkeypatch, script):
    pytest.importorskip("stable_baselines3")
    example, scenes = script(f"examples/{name}.py"), load_test_set("varied")[:20]
    monkeypatch.setattr(example, "NUM_ENVS", 64)
    before, after = (example.gains(example.train(much), scenes) for much in (1, longer))
    assert after.shape == (20,)
    assert after.mean() > before.mean()
    assert np.all((after >= -1.0) & (after < 0.1))


def test_a_third_party_algorithm_is_benchmarked(tmp_path, monkeypatch):
    pytest.importorskip("stable_baselines3")
    from agents.benchmark import benchmark_tasks

    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(EXAMPLES)
    three = load_test_set("varied")[:3]
    monkeypatch.setattr("agents.benchmark.load_test_set", lambda name: three)
    fixed, sampled = benchmark_tasks(["sprint", "varied"], ["outside_algorithm:fit"], 1, 320)
    result, again = fixed.run(), fixed.run()
    assert (result.work["steps"], result.work["simulations"]) == (320, 8)
    assert result.score == again.score
    assert load_scene("sprint").score(result.layout) == pytest.approx(result.score)
    assert -1.0 <= sampled.run().score < 0.1
    with pytest.raises(ValueError, match="its arguments are neither"):
        benchmark_tasks(["sprint"], ["outside_algorithm:DummyVecEnv.close"])


def test_the_file_for_rl_zoo3_has_arguments_of_the_environment_and_of_ppo():
    yaml, sb3 = pytest.importorskip("yaml"), pytest.importorskip("stable_baselines3")
    ((name, chosen),) = yaml.safe_load((EXAMPLES / "rl_zoo3_ppo.yml").read_text("utf-8")).items()
    env = gymnasium.make(name, **chosen.pop("env_kwargs"))
    for key in ("n_envs", "n_timesteps", "normalize"):  # of rl-zoo3
        chosen.pop(key)
    assert sb3.PPO(env=env, device="cpu", **chosen).n_steps == 128


def test_the_page_of_the_bathtub_has_the_numbers_of_its_program(script):
    """`python examples/why_the_bathtub_wins.py --write` updates it."""
    example = script("examples/why_the_bathtub_wins.py")
    page = (ROOT / "docs" / "why.md").read_text("utf-8")
    assert fill_tables(page, example.cheap_tables()) == page
    assert example.other_scenes(cases={"40 dominoes": example.SPRINT})[-1] in page
    assert all(words in page.replace("\n", " ") for words in example.quoted())
    assert abs(example.clock_started_late() - example.endless_gap(0.25)) < 1e-4
    assert len(example.draw_map(8).axes) == 2
    assert len(example.draw_gaps(budget=20).axes[0].lines) == 2 * len(example.FRICTIONS)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs_and_has_its_outputs(path: Path, script) -> None:
    """`python docs/notebooks.py` stores them."""
    learns = "from agents" in path.read_text("utf-8")
    if learns:
        pytest.importorskip("stable_baselines3")
    notebook, names = script("docs/notebooks.py").run(path)
    stored = json.loads(path.read_text("utf-8"))
    for cell, again in zip(stored["cells"], notebook["cells"], strict=True):
        outputs = zip(cell.get("outputs", ()), again.get("outputs", ()), strict=True)
        for before, after in outputs:
            assert before["output_type"] == after["output_type"]
            if not learns and "text" in before:
                assert before["text"] == after["text"]
    assert path.stat().st_size < 300_000
    assert eval(CLAIMS[path.stem], names)


@pytest.mark.filterwarnings("ignore")
def test_ten_lines_train_draw_and_show_an_episode(monkeypatch, script):
    pytest.importorskip("stable_baselines3")
    example = script("examples/reinforcement_learning_in_ten_lines.py")
    monkeypatch.setattr(example, "NUM_ENVS", 2)
    model, steps, returns = example.train(steps=512)
    assert list(steps) == [0, 256, 512]
    assert np.all(returns < 3.2)
    assert len(example.draw_curve(steps, returns).axes[0].lines) == 3
    act = script("docs/films.py").act_of(model)
    assert len({image.size for image in script("docs/films.py").episode("sprint", act)}) == 1
