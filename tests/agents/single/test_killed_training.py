"""Trainings stopped at random moments go on from their last checkpoint to the same weights."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from nursery import Nursery

import domino_env as de

KILLS = int(os.environ.get("DOMINO_KILLS", "3"))
STEPS = 10_000  # five rollouts, a checkpoint each
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    """Of few dominoes."""
    path = tmp_path_factory.mktemp("scene") / "small.toml"
    path.write_text(replace(de.load_scene("sprint"), name="small", count=7).to_toml())
    return path


@pytest.fixture(scope="module")
def nursery(scene: Path, tmp_path_factory) -> Iterator[Nursery]:
    """Warm processes, which have trained once."""
    pytest.importorskip("stable_baselines3")
    folder = tmp_path_factory.mktemp("nursery")
    nursery = Nursery()
    nursery.warm(["train", scene, "--steps", 3000, "--out", folder / "run"], folder / "log")
    yield nursery
    nursery.close()


def learned(folder: Path) -> dict[str, object]:
    """What a training came to, but for times."""
    with np.load(folder / "policy.npz") as archive:
        weights = {name: archive[name].tobytes() for name in archive.files}
    with (folder / "progress.csv").open(newline="") as file:
        rows = [
            {k: v for k, v in row.items() if "seconds" not in k} for row in csv.DictReader(file)
        ]
    built = json.loads((folder / "policy.json").read_text())
    built.pop("seconds")
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["finished"]
    return {
        "weights": weights, "curve": rows, "built": built, "score": summary["score"],
        "layout": (folder / "layout.csv").read_bytes(),
    }  # fmt: skip


def require_whole(folder: Path) -> None:
    """Every file that can be seen is all there."""
    for file in folder.iterdir() if folder.exists() else ():
        if file.name.startswith("."):
            continue
        if file.suffix == ".json" and file.name != "layout.json":
            json.loads(file.read_text("utf-8"))
        elif file.name in ("layout.csv", "layout.json"):
            de.Layout.read(file)
        elif file.suffix == ".npz":
            with np.load(file) as archive:
                assert all(np.isfinite(archive[name]).all() for name in archive.files)
        elif file.suffix == ".toml":
            de.load_scene(file)
        elif file.name == "progress.csv":
            head, *rows = file.read_text("utf-8").splitlines()
            assert all(row.count(",") == head.count(",") for row in rows)


def test_a_training_that_is_stopped_at_random_goes_on_to_the_same_weights(
    nursery: Nursery, scene: Path, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    words = ["train", scene, "--steps", STEPS, "--seed", 3]
    took = nursery.run([*words, "--out", tmp_path / "whole"], log)
    rng = np.random.default_rng(0)
    hits = 0
    for round_ in range(-(-KILLS // 3)):
        folder = tmp_path / f"cut{round_}"
        for with_ in [*SIGNALS, None]:
            begun = (folder / "config.json").exists()
            if folder.exists() and not begun:
                shutil.rmtree(folder)  # it was stopped before there was anything to go on from
            asked = [*words, "--out", folder, *["--resume"] * begun]
            if with_ is None:
                nursery.run(asked, log)
                break
            child = nursery.start(asked, log)
            code = nursery.wait(child, rng.uniform(0.0, took))
            if code is None:
                os.kill(child, with_)
                code = nursery.wait(child, 120.0)
                hits += 1
            assert code in (0, 130, 143, -signal.SIGTERM, -signal.SIGKILL), log.read_text()
            require_whole(folder)
        assert learned(folder) == learned(tmp_path / "whole")
    assert hits >= KILLS // 6
