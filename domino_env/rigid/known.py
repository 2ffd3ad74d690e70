"""Stored verifications of the shipped layouts, and their table.

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

from domino_env.core.files import errors_with_path, read_json, write_text
from domino_env.core.models import read_model
from domino_env.core.tables import markdown_table
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.rigid.simulation import floor_name

PATH = Path(__file__).with_name("known.json")
COLUMNS = (
    "scene", "on", "best known", "uniform baseline", "gain", "last hit over model", "uncertainty",
    "engine over reference",
)  # fmt: skip


@dataclass(frozen=True)
class Check:
    """One layout on one floor, in numbers.

    Attributes
    ----------
    layout
        The best known, or the uniform baseline of this floor.
    simulator
        Name and version.
    floor
        Its friction; None for fixed pivots.
    last
        Time of the last hit over that of the model with fixed pivots - 1; None if there is none.
    largest
        Largest such difference of all hits.
    uncertainty
        Error estimate of the simulator; None if it has none.
    staying_up
        Number of dominoes that do not topple.
    gap
        Mean gap [m].
    score
        Score of the layout in its scene, as text.
    gain
        Speed over that of the uniform baseline of this floor - 1; None for that layout, for
        scenes with other scores, and if a domino does not topple.
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
    """Checks of one shipped layout and of its uniform baselines.

    Attributes
    ----------
    digest
        Digest of layout and physics.
    count
        Number of dominoes.
    first
        Number of dominoes simulated, from the first.
    verdict
        Verdict on the layout with fixed pivots.
    checks
        Checks of the best known layout and the uniform baseline, and of the engine if it was
        run; fixed pivots first.
    """

    digest: str
    count: int
    first: int
    verdict: str
    checks: tuple[Check, ...]

    @property
    def floors(self) -> tuple[Check, ...]:
        """Checks of the best known layout by the reference simulator, fixed pivots first."""
        kind = "best", self.checks[0].simulator
        return tuple(check for check in self.checks if (check.layout, check.simulator) == kind)


def digest(layout: Layout, physics: Physics) -> str:
    """Return 16 hexadecimal digits that identify a layout with its physics."""
    parts = (
        layout.spacing, layout.thickness, layout.height, layout.density,
        (physics.friction, physics.gravity, physics.push),
    )  # fmt: skip
    ground = () if layout.is_flat else (layout.rise, layout.tilt)
    data = b"".join(np.ascontiguousarray(part, dtype="<f8").tobytes() for part in (*parts, *ground))
    return hashlib.sha256(data).hexdigest()[:16]


def read_verified(path: Path = PATH) -> dict[str, Verified]:
    """Return the stored verifications by scene; none if there is no such file."""
    if not path.exists():
        return {}
    document = read_json(path)
    with errors_with_path(path):
        return {name: read_model(Verified, table, name) for name, table in document.items()}


def write_verified(verified: dict[str, Verified], path: Path = PATH) -> None:
    """Write the verifications in the order of the names."""
    document = {name: asdict(verified[name]) for name in sorted(verified)}
    write_text(path, json.dumps(document, indent=1, allow_nan=False) + "\n")


@cache
def _by_digest() -> dict[str, Verified]:
    return {verified.digest: verified for verified in read_verified().values()}


def known_verification(layout: Layout, physics: Physics) -> Verified | None:
    """Return the stored verification of this layout and physics, if there is one."""
    return _by_digest().get(digest(layout, physics))


def known_table(verified_by_scene: dict[str, Verified]) -> list[str]:
    """Return a Markdown table of the best known and the uniform baselines on every floor."""
    lines = []
    for name, verified in verified_by_scene.items():
        count, first = verified.count, verified.first
        scene = f"`{name}`" if first == count else f"`{name}` (first {first} of {count})"
        for best in verified.floors:
            on_floor = [check for check in verified.checks if check.floor == best.floor]
            uniform = next(check for check in on_floor if check.layout == "uniform")
            engine = next((check for check in on_floor if check.simulator != best.simulator), None)
            lines.append((
                scene, floor_name(best.floor), _score(best), _score(uniform),
                "" if best.gain is None else f"**{best.gain:+.2%}**", percent(best.last),
                percent(best.uncertainty, sign=""), _difference(best, engine),
            ))  # fmt: skip
    return markdown_table(COLUMNS, lines)


def not_toppled(number: int) -> str:
    """Return "1 does not topple" or "2 do not topple"."""
    return f"{number} {'does' if number == 1 else 'do'} not topple"


def _score(check: Check) -> str:
    """Return the score, with the number of dominoes that do not topple."""
    return check.score + (f" ({not_toppled(check.staying_up)})" if check.staying_up else "")


def _difference(reference: Check, engine: Check | None) -> str:
    """Return the difference of the engine from the reference simulator at the last hit."""
    if engine is None or engine.last is None or reference.last is None:
        return ""
    difference = (1.0 + engine.last) / (1.0 + reference.last) - 1.0
    if engine.uncertainty is None or reference.uncertainty is None:
        return f"{difference:+.3%} (not converged)"
    return f"{difference:+.3%} ± {engine.uncertainty + reference.uncertainty:.2%}"


def percent(value: float | None, sign: str = "+") -> str:
    """Return a fraction in per cent; nothing for None."""
    return "" if value is None else f"{value:{sign}.3%}"
