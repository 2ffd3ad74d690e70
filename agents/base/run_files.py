"""Run files: what every training keeps in its folder.

config.json     what it was begun with           progress.csv   the learning curve
policy.npz      weights, as plain arrays         summary.json   what it came to
checkpoint.pt   all that going on needs (no pickled code)
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, field

from domino_env.core.models import Document, model_of
from domino_env.core.reading import naming, read_json

CONFIG, PROGRESS, POLICY = "config.json", "progress.csv", "policy.npz"
SUMMARY, CHECKPOINT = "summary.json", "checkpoint.pt"
FILES = (CONFIG, PROGRESS, POLICY, SUMMARY, CHECKPOINT)

Seed = Annotated[int, Meta(ge=0, le=2**32 - 1)]
Count = Annotated[int, Meta(ge=0, le=10**15)]
Score = Annotated[float, Meta(le=1e15)]
"""Of a row; -inf where none was built."""
Seconds = Annotated[float, Meta(ge=0, le=1e15)]


class ProgressDocument(Document, kw_only=True):
    """How far a training had come, in its checkpoint."""

    seconds: Seconds
    processor_seconds: Seconds
    curve: list[tuple[Score, ...]]
    next_evaluation: Count = field(name="next_look", default=0)
    next_checkpoint: Count = field(name="next_keep", default=0)


class SummaryDocument(Document):
    """What is needed of summary.json, and of the policy.json of a policy that ships."""

    finished: bool = True
    seconds: Annotated[float, Meta(ge=0, le=1e9)] = 0.0


@contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Keep a folder to one training at a time; who dies lets go of it, however that came.

    Raises
    ------
    ValueError
        Where another one runs in it.
    """
    from filelock import FileLock, Timeout

    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / ".lock", timeout=0.0)
    try:
        with lock:
            yield
    except Timeout:
        raise ValueError(f"{folder} is being written by a training that still runs") from None


def require_begun(folder: Path) -> None:
    """Raise ValueError for a folder without a training that could go on."""
    if not (folder / CONFIG).exists():
        raise ValueError(
            f"{folder} holds no training that had begun, so there is nothing to go on from: train "
            "without --resume, into another folder if this one holds files of a run"
        )


def require_columns(curve: list[tuple[float, ...]], columns: tuple[str, ...]) -> None:
    """Raise ValueError for a learning curve of other columns: of another version."""
    for row in curve:
        if len(row) != len(columns):
            raise ValueError(f"curve holds {list(row)}: expected {', '.join(columns)}")


def algorithm_of(folder: Path) -> str | None:
    """Read which algorithm trained the policy in a folder; None where nothing says so."""
    try:
        document: Any = read_json(folder / CONFIG)
    except (ValueError, OSError):
        return None
    return document.get("algorithm") if isinstance(document, dict) else None


def is_finished(folder: Path) -> bool:
    """Tell whether the training in a folder ran to its end."""
    path = folder / SUMMARY
    if not path.exists():
        return False
    with naming(path):
        return model_of(SummaryDocument, read_json(path)).finished


def training_seconds(folder: Path) -> float:
    """Read how long the training of a policy took [s]; 0 where nobody wrote it down."""
    for name in (SUMMARY, "policy.json"):
        path = folder / name
        if path.exists():
            with naming(path):
                return model_of(SummaryDocument, read_json(path)).seconds
    return 0.0
