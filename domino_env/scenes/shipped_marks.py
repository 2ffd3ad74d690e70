"""Where the best uniform rows of the scenes that ship lie, found once for all."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from domino_env.scenes.specification import Specification

FILE = "uniform.json"


def shipped_point(scene: Specification) -> NDArray[np.float64] | None:
    """Give the two numbers of the best uniform row, as of `UniformRows`.

    Parameters
    ----------
    scene
        Any; a scene of one's own that asks the same as one that ships has the same row.

    Returns
    -------
    NDArray or None
        (2,); None for a scene that does not ship, or not as it is.
    """
    point = _points().get(stamp(scene))
    return None if point is None else np.array(point)


def stamp(scene: Specification) -> str:
    """Return a digest of all that the best uniform row may depend on: all but the names."""
    tables = scene.document() | {"name": None, "title": None}
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()


@cache
def _points() -> dict[str, list[float]]:
    file = resources.files("domino_env.scenes") / "shipped" / FILE
    return {mark["stamp"]: mark["point"] for mark in json.loads(file.read_text("utf-8")).values()}
