"""Verified: what the judges saw of the rows that ship, kept with them.

`known.json` beside this file: under a scene's name a `Verified`.  `domino best-known --verify
--update` writes it; the documentation and `domino report` read it.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.models import model_of
from domino_env.core.reading import naming, read_json
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics

PATH = Path(__file__).with_name("known.json")


@dataclass(frozen=True)
class Seen:
    """One row on one floor, as a judge saw it, in numbers.

    Attributes
    ----------
    last
        Judge over the hinged model - 1 when the last domino is hit [1]; None where it never is.
    largest
        The largest such difference of any hit.
    doubt
        How far the judge itself may be off, by its own estimate [1]; None where it cannot tell.
    staying_up
        How many dominoes do not topple.
    speed
        First pivot to last over the last hit [m/s]; None where there was none.
    score
        What the row is worth in its scene, in words.
    """

    last: float | None
    largest: float
    doubt: float | None
    staying_up: int
    speed: float | None
    score: str


@dataclass(frozen=True)
class OnFloor:
    """A scene's best row beside its best uniform row on the same floor.

    Attributes
    ----------
    floor
        Its friction; None where the rows are hinged.
    best
        The best row known.
    uniform
        The best uniform row of this floor.
    gap
        Mean gap of that [m].
    gain
        How much faster the first is [1]; None in a scene that counts no speed, and where a wave
        died.
    engine
        The best row, as the rigid-body engine saw it; None where it was not asked.
    """

    floor: float | None
    best: Seen
    uniform: Seen
    gap: float
    gain: float | None
    engine: Seen | None = None


@dataclass(frozen=True)
class Verified:
    """What the judges saw of one row that ships.

    Attributes
    ----------
    digest
        Of the row and its physics.
    count
        Number of dominoes.
    first
        So many of them were looked at, from the first.
    judge
        Name and version of the built-in simulator.
    engine
        The same of the rigid-body engine; None where it was not asked.
    floors
        What they saw, hinged first.
    verdict
        Plain words on the hinged row.
    uniform_verdict
        The same of the best uniform row.
    flush_loss
        The largest of the wave.
    stall_margin
        The lowest of the wave.
    lifted
        Pivots that would lift, as the model's forces say.
    """

    digest: str
    count: int
    first: int
    judge: str
    engine: str | None
    floors: tuple[OnFloor, ...]
    verdict: str
    uniform_verdict: str
    flush_loss: float
    stall_margin: float
    lifted: int

    @property
    def hinged(self) -> OnFloor:
        """What they saw of the hinged rows."""
        return self.floors[0]


def digest(layout: Layout, physics: Physics) -> str:
    """Tell one row under one physics from another by 16 hexadecimal digits."""
    parts = (
        layout.spacing, layout.thickness, layout.height, layout.density,
        (physics.friction, physics.gravity, physics.push),
    )  # fmt: skip
    ground = () if layout.is_flat else (layout.rise, layout.tilt)
    told = b"".join(np.ascontiguousarray(part, dtype="<f8").tobytes() for part in (*parts, *ground))
    return hashlib.sha256(told).hexdigest()[:16]


def read_verified(path: Path = PATH) -> dict[str, Verified]:
    """Read all that is kept, by the name of the scene; nothing where there is no such file."""
    if not path.exists():
        return {}
    document = read_json(path)
    with naming(path):
        return {name: model_of(Verified, told, name) for name, told in document.items()}


def write_verified(found: dict[str, Verified], path: Path = PATH) -> None:
    """Write all down, whole, in the order of the names."""
    document = {name: asdict(found[name]) for name in sorted(found)}
    write_text(path, json.dumps(document, indent=1, allow_nan=False) + "\n")


@cache
def _by_digest() -> dict[str, Verified]:
    return {one.digest: one for one in read_verified().values()}


def known_verification(layout: Layout, physics: Physics) -> Verified | None:
    """Return what is kept of exactly this row under exactly this physics, if it is one of ours."""
    return _by_digest().get(digest(layout, physics))
