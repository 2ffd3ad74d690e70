"""A training's folder from a stranger: settings, weights and checkpoints, each refused or used."""

from __future__ import annotations

import copy
import io
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile import CORPUS, DEEP, NUMBERS, entered, mutated
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("stable_baselines3")

import torch

import domino_env as de
from agents import evaluate
from agents.base.arrays import read_weights
from agents.base.checkpoint import read_checkpoint
from agents.sb3.learner import learner
from agents.sb3.presets import preset
from agents.sb3.state import restore
from agents.sb3.vec_env import DominoVecEnv
from agents.single.documents import read_config
from agents.single.training import _as_begun, train

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning")
FUZZ = settings(max_examples=int(os.environ.get("FUZZ_EXAMPLES", "60")), derandomize=True)
if "FUZZ_EXAMPLES" in os.environ:
    FUZZ = settings(FUZZ, derandomize=False)
FEW = settings(FUZZ, max_examples=FUZZ.max_examples // 2)
WANTED = {"w": ((2, 3), np.dtype("float32"))}


def weights(path: Path) -> dict[str, Any]:
    found = read_weights(path, WANTED)
    assert found["w"].shape == (2, 3)
    assert np.isfinite(found["w"]).all()
    return found


EXPECTED = {
    "weights/empty.npz": "no archive of arrays",
    "weights/good.npz": None,
    "weights/not_finite.npz": "no finite number",
    "weights/objects.npz": "allow_pickle=False",
    "weights/other_shape.npz": "shape (3, 2), not float32 of (2, 3)",
    "weights/short.npz": "expected 24 bytes got 23",
    "settings/code.json": "unknown key 'preset.options.policy_kwargs'",
    "settings/good.json": None,
    "settings/nan_rate.json": "preset.rate = nan: give 0 to a million",
    "settings/no_preset.json": "preset is missing: give a table of rows, steps",
    "settings/unknown_algorithm.json": "choose apg, ars, ppo",
    "settings/wide.json": "at most 16 layers of 4096",
}


@pytest.mark.parametrize("name", EXPECTED)
def test_the_corpus_is_refused_or_read(name: str, tmp_path: Path) -> None:
    words = EXPECTED[name]
    settings_ = name.startswith("settings")
    path = tmp_path / ("config.json" if settings_ else "policy.npz")
    path.write_bytes((CORPUS / name).read_bytes())

    def door(path: Path) -> Any:
        return read_config(path.parent) if settings_ else weights(path)

    assert (entered(door, path) is None) == (words is not None)
    if words is not None:
        with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
            door(path)
        assert words in str(refused.value)


def test_every_file_of_the_corpus_is_expected() -> None:
    files = [p for kind in ("weights", "settings") for p in (CORPUS / kind).iterdir()]
    assert {f"{p.parent.name}/{p.name}" for p in files} == set(EXPECTED)


@FUZZ
@given(data=mutated((CORPUS / "weights" / "good.npz").read_bytes()))
def test_any_weights_are_read_or_refused(tmp_path_factory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.npz"
    path.write_bytes(data)
    entered(weights, path)


# a whole folder ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small() -> de.Scene:
    return replace(de.load_scene("sprint"), name="small", count=4)


@pytest.fixture(scope="module")
def run(small: de.Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A training of a moment."""
    tiny = preset("ppo", 3)
    options = {**tiny.options, "n_steps": 6, "batch_size": 12, "n_epochs": 1}
    plan = replace(tiny, rows=2, steps=24, width=4, depth=1, options=options)
    folder = tmp_path_factory.mktemp("run") / "run"
    train(small, "ppo", folder=folder, plan=plan)
    return folder


def used(path: Path) -> Any:
    """What the agent in the folder of this file builds."""
    built = evaluate(path.parent)
    assert np.isfinite(built.score)
    assert built.scene.violations(built.layout) == []
    return built


def in_place_of(run: Path, name: str, data: bytes) -> Path:
    """A copy of the folder with another file of this name."""
    copied = run.with_name("copy")
    shutil.rmtree(copied, ignore_errors=True)
    shutil.copytree(run, copied)
    (copied / name).write_bytes(data)
    return copied / name


def test_the_folder_as_it_is_works(run: Path) -> None:
    assert used(run / "policy.npz").score > 0.0


@FEW
@given(name=st.sampled_from(["policy.npz", "config.json", "policy.json"]), data=st.data())
def test_any_damaged_file_is_used_or_refused(run: Path, name: str, data: Any) -> None:
    damaged = data.draw(mutated((run / name).read_bytes()))
    path = in_place_of(run, name, damaged)
    entered(lambda folder: used(folder / name), path.parent)


@FUZZ
@given(data=st.data())
def test_any_settings_are_used_or_refused(run: Path, data: Any) -> None:
    document = json.loads((run / "config.json").read_text())
    plan = document["preset"]
    for _ in range(data.draw(st.integers(1, 3))):
        table = data.draw(st.sampled_from([document, plan, plan["options"]]))
        keys = [*(k for k in table if k not in ("preset", "options")), "gamma", "verbose", "env"]
        table[data.draw(st.sampled_from(keys))] = data.draw(
            st.one_of(st.sampled_from([0, 1, 2, 3, 0.5, 10**9]), NUMBERS, DEEP)
        )
    path = in_place_of(run, "config.json", json.dumps(document).encode())
    entered(lambda folder: used(folder / "config.json"), path.parent)


@FEW
@given(value=st.one_of(NUMBERS, DEEP))
def test_any_reference_is_used_or_refused(run: Path, value: Any) -> None:
    text = json.dumps({"reference_over_uniform": value}).encode()
    entered(used, in_place_of(run, "policy.json", text))


def test_a_network_of_enormous_weights_builds_a_row_or_is_refused(run: Path) -> None:
    with np.load(run / "policy.npz") as held:
        arrays = {name: np.full_like(held[name], 3e38) for name in held.files}
    for name in arrays:
        if "log_std" not in name:
            arrays[name].flat[::2] *= -1.0
    out = io.BytesIO()
    np.savez(out, **arrays)
    entered(used, in_place_of(run, "policy.npz", out.getvalue()), named=False)


# checkpoints ------------------------------------------------------------------------------------


def load_state(model: Any, path: Path) -> Any:
    """Take a learner back to a checkpoint, and give what it holds."""
    with read_checkpoint(path) as state:
        restore(model, state)
        return state


@pytest.fixture(scope="module")
def begun(run: Path) -> tuple[Any, Path]:
    """A learner and its checkpoint."""
    scene, algorithm, seed, plan, _ = _as_begun(run)
    return learner(algorithm, plan, DominoVecEnv(scene, plan.rows), seed), run / "checkpoint.pt"


def test_a_checkpoint_as_it_is_works(begun: Any) -> None:
    load_state(*begun)


def _changed(state: Any, kind: str) -> None:
    weights = state["parameters"]["policy"]
    name = next(iter(weights))
    if kind == "nan":
        weights[name] = torch.full_like(weights[name], float("nan"))
    elif kind == "shape":
        weights[name] = torch.zeros(3)
    elif kind == "missing":
        del state["parameters"]
    elif kind == "words":
        state["steps"] = "many"
    else:
        state["torch"] = torch.zeros(3)


@pytest.mark.parametrize("kind", ["nan", "shape", "missing", "words", "random"])
def test_a_state_of_another_learner_is_refused(begun: Any, tmp_path: Path, kind: str) -> None:
    model, path = begun
    kept = copy.deepcopy(model.policy.state_dict())
    state = torch.load(path, weights_only=True)
    _changed(state, kind)
    torch.save(state, tmp_path / "checkpoint.pt")
    assert entered(lambda p: load_state(model, p), tmp_path / "checkpoint.pt") is None
    model.policy.load_state_dict(kept)


@FEW
@given(data=st.data())
def test_any_damaged_checkpoint_is_taken_up_or_refused(
    begun: Any, tmp_path_factory: Any, data: Any
) -> None:
    model, path = begun
    new = tmp_path_factory.getbasetemp() / "damaged.pt"
    new.write_bytes(data.draw(mutated(path.read_bytes())))
    entered(lambda p: load_state(model, p), new)


class _Code:
    """Says when a pickle runs it."""

    def __reduce__(self) -> Any:
        return Path.touch, (Path("ran"),)


@pytest.mark.parametrize("new_kind", [True, False])
def test_code_in_a_checkpoint_is_not_run(
    begun: Any, tmp_path: Path, monkeypatch: Any, new_kind: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "checkpoint.pt"
    torch.save({"parameters": _Code()}, path, _use_new_zipfile_serialization=new_kind)
    assert entered(lambda p: load_state(begun[0], p), path) is None
    assert [p.name for p in tmp_path.iterdir()] == ["checkpoint.pt"]


def test_a_resumed_run_of_a_stranger_is_refused_with_a_sentence(run: Path) -> None:
    state = torch.load(run / "checkpoint.pt", weights_only=True)
    state["more"]["curve"] = [[1.0]]
    out = io.BytesIO()
    torch.save(state, out)
    path = in_place_of(run, "checkpoint.pt", out.getvalue())
    with pytest.raises(ValueError, match=r"checkpoint\.pt: curve holds \[1.0\]: expected steps"):
        train("sprint", folder=path.parent, resume=True)


def test_an_archive_that_no_one_vouches_for_is_not_opened(tmp_path: Path) -> None:
    path = tmp_path / "agent.zip"
    path.write_bytes(b"PK")
    with pytest.raises(ValueError, match="runs code that it holds: say --trust"):
        evaluate(path, "sprint")
    for data in (b"", b"PK", b"PK\x05\x06" + bytes(18)):
        path.write_bytes(data)
        with pytest.raises(ValueError, match="is no archive of"):
            evaluate(path, "sprint", trust=True)
