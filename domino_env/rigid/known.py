"""Verifications of the layouts that ship, kept with them, and their table.

`known.json` beside this file has a `Verified` under each scene's name. ``domino best-known --verify
--update`` writes it; the documentation and `domino report` read it.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

from domino_env.core.files import naming, read_json, write_text
from domino_env.core.models import model_of
from domino_env.core.tables import markdown_table
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.rigid.simulation import floor_name

PATH = Path(__file__).with_name("known.json")
NAMES = (
    "scene", "on", "best known", "best uniform", "gain", "last hit over model", "uncertainty",
    "engine over reference",
)  # fmt: skip


@dataclass(frozen=True)
class Check:
    """One layout on one floor, in numbers.

    Attributes
    ----------
    layout
        The best known, or the best uniform layout of this floor.
    simulator
        Name and version.
    floor
        Its friction; None for fixed pivots.
    last
        Simulator over the model of fixed pivots - 1 at the last hit; None where it never comes.
    largest
        The largest such difference of any hit.
    uncertainty
        Error estimate of the simulator; None where it has none.
    staying_up
        Dominoes that do not topple.
    gap
        Mean gap [m].
    score
        Of the layout in its scene, in words.
    gain
        Speed over that of the best uniform layout of this floor - 1; None for that layout, for a
        scene that scores something else, and where a wave ended.
    """

    layout: Literal["best", "uniform"]
    simulator: str
    floor: float | None
    last: float | None
    largest: float
    uncertainty: float | None
    staying_up: int
    gap: float
    score: str
    gain: float | None = None


@dataclass(frozen=True)
class Verified:
    """Checks of one layout that ships and of its uniform baselines.

    Attributes
    ----------
    digest
        Of the layout and its physics.
    count
        Number of dominoes.
    first
        So many of them were simulated, from the first.
    verdict
        On the layout with fixed pivots.
    checks
        Best known, uniform baseline, and engine where it was run; fixed pivots first.
    """

    digest: str
    count: int
    first: int
    verdict: str
    checks: tuple[Check, ...]

    @property
    def floors(self) -> tuple[Check, ...]:
        """Those of the best known layout by the reference simulator, fixed pivots first."""
        first = self.checks[0]
        mine = (one for one in self.checks if one.simulator == first.simulator)
        return tuple(one for one in mine if one.layout == "best")


def digest(layout: Layout, physics: Physics) -> str:
    """Tell one layout under one physics from another by 16 hexadecimal digits."""
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
    """Return what is kept of exactly this layout under exactly this physics, if it ships."""
    return _by_digest().get(digest(layout, physics))


def known_table(found: dict[str, Verified]) -> list[str]:
    """Tabulate in Markdown every layout that ships on every floor, beside the best uniform one."""
    rows = []
    for name, one in found.items():
        first = "" if one.first == one.count else f" (first {one.first} of {one.count})"
        for best in one.floors:
            here = [check for check in one.checks if check.floor == best.floor]
            uniform = next(check for check in here if check.layout == "uniform")
            engine = next((check for check in here if check.simulator != best.simulator), None)
            rows.append((
                f"`{name}`{first}", floor_name(best.floor), _score(best), _score(uniform),
                "" if best.gain is None else f"**{best.gain:+.2%}**", percent(best.last),
                percent(best.uncertainty, sign=""), _apart(best, engine),
            ))  # fmt: skip
    return markdown_table(NAMES, rows)


def _score(check: Check) -> str:
    return check.score + (f" ({check.staying_up} stay up)" if check.staying_up else "")


def _apart(reference: Check, engine: Check | None) -> str:
    """How far the engine is from the reference simulator at the last hit."""
    if engine is None or engine.last is None or reference.last is None:
        return ""
    apart = (1.0 + engine.last) / (1.0 + reference.last) - 1.0
    if engine.uncertainty is None or reference.uncertainty is None:
        return f"{apart:+.3%} (not converged)"
    return f"{apart:+.3%} ± {engine.uncertainty + reference.uncertainty:.2%}"


def percent(value: float | None, sign: str = "+") -> str:
    """Write a part in per cent; nothing for None."""
    return "" if value is None else f"{value:{sign}.3%}"
