"""Verified: what the engine said of the rows that ship, kept with them.

`known.json` beside this file: under a scene's name a `Verified`.  `domino best-known --verify
--update` writes it; the documentation and `domino report` read it.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from domino_env.chain.layout import Layout
from domino_env.chain.physics import Physics
from domino_env.support.files import write_text
from domino_env.support.models import model_of
from domino_env.support.reading import naming, read_json
from domino_env.support.tables import markdown_table

if TYPE_CHECKING:
    from domino_env.rigid.comparison import Verification

PATH = Path(__file__).with_name("known.json")


@dataclass(frozen=True)
class Verified:
    """One row beside the engine, in numbers.

    Differences are engine over model - 1 [1].

    Attributes
    ----------
    digest
        Of the row and its physics.
    engine
        Name and version.
    steps
        Of the engine's time [s].
    count
        Number of dominoes.
    hinged
        Difference of the last arrival, on hinges, extrapolated; None where a wave died.
    largest
        The largest difference of any arrival, on hinges, extrapolated.
    free
        As `hinged`, of the row that stands free on a rough floor.
    spread
        How far the extrapolation reached beyond the finest step.
    toppled
        Whether the last domino toppled in the engine, on hinges.
    free_toppled
        The same of the row that stands free.
    flush_loss
        The largest of the wave.
    stall_margin
        The lowest of the wave.
    opened
        Contacts that the model keeps closed although they would open.
    lifted
        Pivots that would lift.
    verdict
        Plain words.
    """

    digest: str
    engine: str
    steps: tuple[float, ...]
    count: int
    hinged: float | None
    largest: float
    free: float | None
    spread: float
    toppled: bool
    free_toppled: bool
    flush_loss: float
    stall_margin: float
    opened: int
    lifted: int
    verdict: str


def digest(layout: Layout, physics: Physics) -> str:
    """Tell one row under one physics from another by 16 hexadecimal digits."""
    parts = (
        layout.spacing, layout.thickness, layout.height, layout.density,
        (physics.friction, physics.gravity, physics.push),
    )  # fmt: skip
    told = b"".join(np.ascontiguousarray(part, dtype="<f8").tobytes() for part in parts)
    return hashlib.sha256(told).hexdigest()[:16]


def summary(checked: Verification) -> Verified:
    """Put a verification into numbers."""
    import pymunk

    wave, found = checked.wave, checked.diagnosis
    hinged, free = (
        None if np.isnan(x) else float(x) for x in (checked.difference, checked.free_difference)
    )
    return Verified(
        digest=digest(wave.layout, wave.physics),
        engine=f"pymunk {pymunk.version}",
        steps=tuple(float(h) for h in checked.steps),
        count=wave.layout.count,
        hinged=hinged,
        largest=checked.largest_difference,
        free=free,
        spread=checked.spread,
        toppled=checked.toppled,
        free_toppled=checked.free_toppled,
        flush_loss=wave.largest_flush_loss,
        stall_margin=float(np.nanmin(wave.stall_margin)),
        opened=len(found.opened),
        lifted=len(found.lifted),
        verdict=checked.verdict,
    )


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


def markdown(found: dict[str, Verified]) -> list[str]:
    """Tabulate all in Markdown, below it the reason of every row that differs in earnest."""
    names = (
        "scene", "dominoes", "hinged, last hit", "hinged, largest", "free, last hit",
        "last topples, hinged / free", "largest flush loss", "lowest stall margin",
        "pivots lifted", "steps [µs]",
    )  # fmt: skip
    rows = [
        (
            f"`{name}`", one.count, _share(one.hinged), f"{one.largest:.3%}", _share(one.free),
            " / ".join("yes" if fell else "**no**" for fell in (one.toppled, one.free_toppled)),
            f"{one.flush_loss:.2%}", f"{one.stall_margin:.2g}", one.lifted,
            ", ".join(f"{h * 1e6:g}" for h in one.steps),
        )
        for name, one in found.items()
    ]  # fmt: skip
    lines = markdown_table(names, rows)
    differ = [
        f"- `{name}`: {one.verdict}"
        for name, one in found.items()
        if one.verdict.startswith("DIFFERS")
    ]
    return [*lines, "", *differ] if differ else lines


def _share(value: float | None) -> str:
    return "never" if value is None else f"{value:+.3%}"
