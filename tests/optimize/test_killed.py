"""Real processes stopped at random moments: no torn file, nothing finished lost, the same bits.

Some fifteen kills in all; DOMINO_KILLS=100 is a number for each test, to be run by hand.
"""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from nursery import Nursery

import domino_env as de
from domino_env.cli.main import main
from optimize.run_folder import JOURNAL

KILLS = int(os.environ.get("DOMINO_KILLS", "3"))  # in each of the tests below
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
PATIENCE = 120.0  # [s] for a process to end


@pytest.fixture(scope="module")
def nursery(scenes, tmp_path_factory) -> Iterator[Nursery]:
    """Warm processes, which have searched once."""
    folder = tmp_path_factory.mktemp("nursery")
    nursery = Nursery()
    (folder / "both.toml").write_text(scenes["both"].to_toml())
    words = ["compare", folder / "both.toml", "--methods", "auto,cma", "--seeds", 1]
    nursery.warm(
        [*words, "--evaluations", 60, "--out", folder / "c", "--store", folder / "s"],
        folder / "log",
    )
    yield nursery
    nursery.close()


def require_whole(folder: Path) -> None:
    """Every file of a run that can be seen is all there."""
    for file in folder.iterdir() if folder.exists() else ():
        if file.name.startswith("."):
            continue  # what a kill left half written, under a name that nobody reads
        if file.suffix == ".json" and file.name != "layout.json":
            json.loads(file.read_text("utf-8"))
        elif file.name in ("layout.csv", "layout.json"):
            de.Layout.read(file)
        elif file.suffix == ".toml":
            de.load_scene(file)
        elif file.suffix == ".png":
            data = file.read_bytes()
            assert data.startswith(b"\x89PNG")
            assert data[-8:-4] == b"IEND"
        elif file.suffix == ".csv":
            head, *rows = file.read_text("utf-8").splitlines()
            assert all(row.count(",") == head.count(",") for row in rows)
            assert file.read_bytes().endswith(b"\n")
        else:
            assert file.name.startswith(JOURNAL) or file.name in ("comparison.md", "sweep.md"), file


def turned(round_: int) -> list[signal.Signals]:
    """All signals, each first in turn."""
    first = round_ % len(SIGNALS)
    return [*SIGNALS[first:], *SIGNALS[:first]]


def stopped(
    nursery: Nursery, words: list[object], log: Path, after: float, with_: signal.Signals
) -> int | None:
    """Start a command, stop it after some seconds; its exit code, None where it was faster."""
    child = nursery.start(words, log)
    code = nursery.wait(child, after)
    if code is not None:
        assert code == 0, log.read_text()
        return None
    os.kill(child, with_)
    code = nursery.wait(child, PATIENCE)
    assert code is not None, f"{with_.name} did not end it"
    expected = {
        signal.SIGINT: (130, 0, 1),  # 0: it had just finished
        signal.SIGTERM: (143, -signal.SIGTERM, 0),  # 0: it had just finished
        signal.SIGKILL: (-signal.SIGKILL, 0),
    }
    assert code in expected[with_], (with_.name, code, log.read_text())
    return code


def shown(folder: Path) -> dict[str, object]:
    """What a finished run's folder says, but for times and versions."""
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["finished"]
    assert not summary["interrupted"]
    rows = [line.split(",") for line in (folder / "trace.csv").read_text().splitlines()]
    left = [[cell for i, cell in enumerate(row) if i != 2] for row in rows]
    names = [name for name in summary if name not in ("seconds", "versions", "run_time")]
    return {
        "trace": left,
        "csv": (folder / "layout.csv").read_bytes(),
        "json": (folder / "layout.json").read_bytes(),
        **{name: summary[name] for name in names},
    }


@pytest.mark.parametrize(("method", "evaluations"), [("auto", 1500), ("cma", 6000)])
def test_a_search_that_is_stopped_at_random_resumes_to_the_same_bits(
    nursery: Nursery, scenes, tmp_path: Path, method: str, evaluations: int
) -> None:
    (tmp_path / "both.toml").write_text(scenes["both"].to_toml())
    log = tmp_path / "log"
    words = ["optimize", tmp_path / "both.toml", "--method", method, "--evaluations", evaluations]
    whole = tmp_path / "whole"
    took = nursery.run([*words, "--out", whole], log)
    rng = np.random.default_rng(len(method))
    hits = 0
    for round_ in range(-(-KILLS // 3)):
        folder = tmp_path / f"cut{round_}"
        for with_ in turned(round_):
            code = stopped(
                nursery, [*words, "--out", folder, "--resume"], log, rng.uniform(0, took), with_
            )
            hits += code is not None
            require_whole(folder)
        nursery.run([*words, "--out", folder, "--resume"], log)
        require_whole(folder)
        assert shown(folder) == shown(whole)
        assert not [f.name for f in folder.iterdir() if f.name.startswith(".new-")]
    assert hits >= KILLS // 6


# full disks and folders that cannot be written --------------------------------------------------


def full(*_: object, **__: object) -> None:
    raise OSError(28, "No space left on device")


def test_a_disk_that_is_full_at_the_end_leaves_the_earlier_run_as_it_was(
    capsys, monkeypatch, scenes, tmp_path: Path
) -> None:
    scene = tmp_path / "both.toml"
    scene.write_text(scenes["both"].to_toml())
    words = ["optimize", str(scene), "--method", "cma", "--out", str(tmp_path / "run")]
    assert main([*words, "--evaluations", "200"]) == 0
    words += ["--evaluations", "300", "--resume"]
    before = {f.name: f.read_bytes() for f in (tmp_path / "run").iterdir() if f.name != JOURNAL}
    monkeypatch.setattr("os.fsync", full)  # where a disk that is full is told at the latest
    monkeypatch.setattr(
        "optimize.run_folder.require_room", lambda folder: None
    )  # it filled up later
    capsys.readouterr()
    assert main(words) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"domino: {tmp_path / 'run'}: the result cannot be written: No space")
    assert "make room, and go on with --resume" in said
    assert said.count("\n") == 1
    after = {f.name: f.read_bytes() for f in (tmp_path / "run").iterdir() if f.name != JOURNAL}
    assert after == before
    monkeypatch.undo()
    assert main(words) == 0


def test_a_place_that_cannot_be_written_is_told_before_any_time_is_spent(
    capsys, monkeypatch, scenes, tmp_path: Path
) -> None:
    scene, file = tmp_path / "both.toml", tmp_path / "file"
    scene.write_text(scenes["both"].to_toml())
    file.write_text("mine")
    monkeypatch.setattr(
        "optimize.evaluator.Budget.scores", lambda *_: pytest.fail("time was spent")
    )
    inside = str(file / "x")
    store, out = str(tmp_path / "s.sqlite"), str(tmp_path / "out")
    for words in (
        ["optimize", str(scene), "--out", inside],
        ["compare", str(scene), "--methods", "cma", "--out", inside, "--store", store],
        ["compare", str(scene), "--methods", "cma", "--store", inside, "--out", out],
        ["sweep", str(scene), "--set", "physics.push=8", "--out", inside, "--store", store],
        ["sweep", str(scene), "--set", "physics.push=8", "--store", inside],
        ["sweep", str(scene), "--set", "physics.push=8", "--store", "/dev/full"],
    ):
        assert main(words) == 2, words
        said = capsys.readouterr().err
        assert "cannot be written" in said
        assert said.count("\n") == 1
    assert file.read_text() == "mine"
