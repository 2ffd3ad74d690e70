"""Journals from strangers: read right, or refused with one sentence."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hostile import entered, mutated
from hypothesis import given, settings
from hypothesis import strategies as st

from domino_env.support.provenance import versions
from optimize.journal import Journal, _packed

FUZZ = settings(max_examples=int(os.environ.get("FUZZ_EXAMPLES", "60")), derandomize=True)
if "FUZZ_EXAMPLES" in os.environ:
    FUZZ = settings(FUZZ, derandomize=False)


# journals ---------------------------------------------------------------------------------------


def designs() -> np.ndarray:
    return np.linspace(0.0, 1.0, 12).reshape(3, 4)


@pytest.fixture(scope="module")
def journal(scenes: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """A scene and the journal of a search on it that asked twice."""
    path = tmp_path_factory.mktemp("journal") / "journal.bin"
    kept = Journal(path, scenes["both"], "random", 0, versions(), resume=False)
    kept.start()
    for k in range(2):
        kept.answer(("scores", designs() + k), lambda: (np.arange(3.0),))
    kept.close()
    return scenes["both"], path


def replayed(scene: Any, path: Path) -> list[np.ndarray]:
    """What the journal answers to the same two questions."""
    kept = Journal(path, scene, "random", 0, versions(), resume=True)
    try:
        return [
            kept.answer(("scores", designs() + k), lambda: (np.full(3, 7.0),))[0] for k in range(2)
        ]
    finally:
        kept.close()


@FUZZ
@given(data=st.data())
def test_any_damaged_journal_is_followed_or_refused(journal: Any, data: Any) -> None:
    scene, good = journal
    path = good.with_name("damaged.bin")
    path.write_bytes(data.draw(mutated(good.read_bytes())))
    for found in entered(lambda p: replayed(scene, p), path) or []:
        assert found.tolist() in ([0.0, 1.0, 2.0], [7.0, 7.0, 7.0])


def answered(payload: bytes, journal: tuple[Any, Path]) -> Any:
    """What a journal answers that was made, not damaged: its first record holds this payload."""
    scene, good = journal
    data = good.read_bytes()
    record = data.index(struct.pack("<I", 4 * 2 + 8 * 3)) - 12  # of the first answer
    head = data[record : record + 4] + struct.pack("<dI", 0.5, len(payload))
    crc = struct.pack("<I", zlib.crc32(payload, zlib.crc32(head)))
    path = good.with_name("made.bin")
    path.write_bytes(data[:record] + head + crc + payload)
    return entered(lambda p: replayed(scene, p), path)


@FUZZ
@given(payload=st.one_of(
    st.binary(max_size=60),
    st.tuples(st.integers(0, 2**32 - 1), st.lists(st.integers(0, 2**32 - 1), max_size=4)).map(
        lambda x: struct.pack(f"<I{len(x[1])}I", x[0], *x[1]) + bytes(24)
    ),
))  # fmt: skip
def test_any_record_with_a_right_checksum_is_followed_or_refused(
    journal: Any, payload: bytes
) -> None:
    found = answered(payload, journal)
    assert found is None or all(len(values) == 3 for values in found)


@pytest.mark.parametrize("array", [
    np.float64(7.0), np.zeros(0), np.zeros(4), np.zeros((3, 1)), np.array([0.0, np.nan, 1.0]),
    np.array([0.0, np.inf, 1.0]),
])  # fmt: skip
def test_a_record_of_another_shape_or_of_no_numbers_is_refused(journal: Any, array: Any) -> None:
    assert answered(_packed((array,)), journal) is None
    assert answered(_packed((np.arange(3.0), array)), journal) is None
    assert answered(_packed((np.arange(3.0),)), journal) is not None


def test_a_pipe_is_no_journal(journal: Any, tmp_path: Path) -> None:
    scene, _ = journal
    path = tmp_path / "journal.bin"
    os.mkfifo(path)
    assert entered(lambda p: replayed(scene, p), path) is None
