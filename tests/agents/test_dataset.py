"""Datasets: layouts and episodes of the scenes, continuation after an interruption."""

import gymnasium
import numpy as np
import pytest

import domino_env as de
from agents import dataset
from domino_env.cli.main import main


def test_a_random_episode_follows_from_its_generator():
    distribution = de.load_distribution("varied-tempo")
    scene, env = de.load_test_set("varied-tempo")[0], de.DominoChainVector(1, distribution)
    words = env, scene, scene.uniform().layout, 0.1
    first, again, other = (
        dataset.build_episode(*words, np.random.default_rng(seed))["rewards"] for seed in (1, 1, 2)
    )
    assert first == again != other


def test_an_interrupted_dataset_continues_and_matches_its_scenes(tmp_path, monkeypatch, capsys):
    parquet = pytest.importorskip("pyarrow.parquet")
    minari = pytest.importorskip("minari")
    run_experiment = dataset.run_experiment

    def interrupted(tasks, *given, **options):
        run_experiment(tasks[:2], *given, **options)
        raise KeyboardInterrupt

    words = f"dataset {tmp_path} --distribution varied-course --scenes 3 --budget 30".split()
    with monkeypatch.context() as patched:
        patched.setattr(dataset, "run_experiment", interrupted)
        assert main(words) != 0
    monkeypatch.delitem(gymnasium.registry, "DominoChain-v2")  # as in the command
    assert main(words) == 0
    assert "3 scenes of `varied-course`" in capsys.readouterr().out
    table = parquet.read_table(tmp_path / dataset.LAYOUTS).to_pylist()
    assert [line["label.scene"] for line in table] == [0, 1, 2]
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / dataset.EPISODES))
    returns = {}
    for quality in ("uniform", "noisy", "searched"):
        data = minari.load_dataset(f"varied-course/{quality}-v0")
        assert data.recover_environment().spec.kwargs == {"scene": "varied-course"}
        returns[quality] = [np.sum(one.rewards) for one in data.iterate_episodes()]
        assert data.recover_environment(eval_env=True).spec.kwargs == {"scene": "varied-course"}
        about = data.storage.metadata
        assert about["ref_min_score"] == pytest.approx(np.mean(returns["uniform"]))
    for i, line in enumerate(table):
        assert about["ref_max_score"] == pytest.approx(np.mean(returns["searched"]))
        gain = 100.0 * (line["score"] / line["uniform_score"] - 1.0)
        assert returns["searched"][i] == pytest.approx(gain, abs=1e-2)
        assert returns["uniform"][i] == pytest.approx(0.0, abs=1e-2)
        assert returns["noisy"][i] != pytest.approx(gain, abs=1e-3)
    assert main(words) != 0  # an existing dataset is not overwritten
    assert "finished: name another folder" in capsys.readouterr().err
    with pytest.raises(ValueError, match=r"test_dataset\.py is a file: name a folder"):
        dataset.make_dataset(__file__)
