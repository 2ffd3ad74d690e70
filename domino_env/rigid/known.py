"""Stored verifications of the shipped layouts, and their table.

`known.json` beside this file has a `StoredVerification` under the name of each scene.
``python docs/verified.py --best`` writes it; the documentation and `domino report` read it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

from domino_env.core.files import errors_with_path, read_json
from domino_env.core.models import read_model
from domino_env.physics.layout import Layout
from domino_env.physics.physics import ESTABLISHED, Physics

PATH = Path(__file__).with_name("known.json")


@dataclass(frozen=True)
class Check:
    """Result of one layout on one floor, compared with the model.

    Attributes
    ----------
    layout
        "best" for the best known, "uniform" for the uniform baseline of this floor.
    simulator
        Name of the simulator, with the version of an engine.
    floor
        Friction of the floor; None for fixed pivots.
    last
        Time of the last hit over that of the model with fixed pivots, minus one; None if the last
        domino is not hit.
    largest
        Largest such difference of all hits, as an absolute value.
    uncertainty
        Error estimate of the simulator; None if it is not finite.
    staying_up
        Number of dominoes that do not topple.
    score
        Score of the layout in its scene, as text.
    gain
        Speed over that of the uniform baseline of this floor, minus one; None for this baseline,
        for scenes with other scores, and if a domino does not topple.
    error
        Root-mean-square error of the scheduled times [ms]; None for a scene without a schedule, and
        for a wave that stops.
    """

    layout: Literal["best", "uniform"]
    simulator: str
    floor: float | None
    last: float | None
    largest: float
    uncertainty: float | None
    staying_up: int
    score: str
    gain: float | None = None
    error: float | None = None


@dataclass(frozen=True)
class StoredVerification:
    """Checks of one shipped layout and of its uniform baselines.

    Attributes
    ----------
    digest
        Digest of layout and physics, see `digest`.
    count
        Number of dominoes.
    first
        Number of dominoes that were simulated, from the first on.
    verdict
        Verdict on the layout with fixed pivots, see `Verification`.
    checks
        Checks of the best known layout and of the uniform baselines, by the reference simulator
        and by the engine if it was run; fixed pivots first.
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
    sizes = layout.spacing, layout.thickness, layout.height, layout.density
    fields = physics.distinctive
    parts = *sizes, tuple(fields.values()), *layout.rise_and_tilt
    data = b"".join(np.ascontiguousarray(part, dtype="<f8").tobytes() for part in parts)
    others = "".join(name for name in fields if name not in ESTABLISHED)
    return hashlib.sha256(data + others.encode()).hexdigest()[:16]


def read_verified() -> dict[str, StoredVerification]:
    """Return the stored verifications by the name of the scene."""
    document = read_json(PATH)
    with errors_with_path(PATH):
        return {n: read_model(StoredVerification, table, n) for n, table in document.items()}


@cache
def _by_digest() -> dict[str, StoredVerification]:
    return {verified.digest: verified for verified in read_verified().values()}


def known_verification(layout: Layout, physics: Physics) -> StoredVerification | None:
    """Return the stored verification of a layout with its physics; None if there is none."""
    return _by_digest().get(digest(layout, physics))


def not_toppled(number: int) -> str:
    """Return "1 does not topple" or "2 do not topple"."""
    return f"{number} {'does' if number == 1 else 'do'} not topple"
