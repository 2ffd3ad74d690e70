"""The command `domino optimize`: its output, its files and its messages."""

import functools
import json
import re
from pathlib import Path

import pytest

import domino_env as de
from domino_env.core.progress import progress_bar
from optimize import search
from optimize.run_folder import FILES


def test_the_output_names_the_best_layout_and_the_folder(output_of, monkeypatch, scenes, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text(scenes["both"].to_toml())
    text = output_of("optimize", "small.toml", "--budget", 400, "--seed", 5)
    summary = json.loads(Path("runs/both/summary.json").read_text())
    uniform = scenes["both"].uniform()
    assert (summary["evaluations"], summary["seed"], summary["method"]) == (400, 5, "auto")
    lines = text.splitlines()
    assert lines[0] == "both: a small scene: both"
    assert lines[1].startswith(f"uniform baseline: {uniform.wave.mean_speed:.6f} m/s, gaps ")
    assert lines[1].endswith("(PROPAGATED)")
    speed, gain = summary["mean_speed"], summary["gain"]
    assert lines[2].startswith(f"best found:       {speed:.6f} m/s, {gain:+.2%} (PROPAGATED; auto,")
    assert lines[3].startswith("the search ended: limit of 400 layouts reached; ")
    assert lines[4] == f"written to runs/both: {', '.join(FILES)}"


@pytest.mark.parametrize(("quantile", "kind"), [(None, "mean"), (0.1, "10% quantile")])
def test_the_output_names_the_statistic_over_draws(output_of, scenes, tmp_path, quantile, kind):
    scene = scenes["both"].replace(placement=de.Placement(0.001, 8, quantile))
    (tmp_path / "noisy.toml").write_text(scene.to_toml())
    text = output_of("optimize", tmp_path / "noisy.toml", "--budget", 9, "--out", tmp_path / "run")
    assert re.search(rf"mm \({kind} over 8 draws\)\nbest .* \({kind} over 8 draws; auto", text)


def test_the_output_has_the_gap_to_the_best_known(output_of, monkeypatch, tmp_path):
    words = ["optimize", "sprint", "--method", "uniform", "--budget", "9", "--out"]
    text = output_of(*words, tmp_path / "run")
    assert re.search(r"best known:       0.828\d+ m/s, by \w+: shortfall 3.08\d+%", text)
    ended = json.loads((tmp_path / "run" / "summary.json").read_text())["ended"]
    assert f"the search ended: {ended}\n" in text
    monkeypatch.setattr("optimize.experiments.best_known.PATH", tmp_path / "best.json")
    assert "best known:       none so far\n" in output_of(*words, tmp_path / "new")


def test_the_output_explains_why_a_wave_stops(output_of, scenes, tmp_path):
    (tmp_path / "dead.toml").write_text(scenes["dead"].to_toml())
    words = ["--budget", 10, "--out", tmp_path / "run"]
    text = output_of("optimize", tmp_path / "dead.toml", *words)
    assert "uniform baseline: no speed" in text
    assert "best found:       no speed (STALLED;" in text
    assert "push harder" in text
    assert "; no layout succeeds: push harder" in text
    assert "longer search" not in text
    assert "%" not in text


@pytest.mark.parametrize(("scene", "words"), [
    ("both", r"best score 0\.\d+ m/s, \d.*% (over|below) uniform"),
    ("tempo", r"best RMS error \d.* ms, 18\.73 ms with uniform"),
])  # fmt: skip
def test_the_progress_line_compares_the_best_with_uniform(
    capsys, scenes, monkeypatch, scene, words
):
    at_once = functools.partial(progress_bar, mininterval=0.0)
    monkeypatch.setattr("optimize.searching.progress_bar", at_once)
    search(scenes.get(scene, scene), "random", 4000, progress=True)
    shown = capsys.readouterr().err
    assert f"{scene}, random" in shown
    assert re.search(rf"%\|.*{words}", shown)
