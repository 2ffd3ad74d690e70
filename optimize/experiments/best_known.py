"""Best known layouts of the shipped scenes, and the searches that found them.

`best_known.json` beside this file has, under the name of each scene, the layout, its score, and the
method, seed, time and version of the search.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from domino_env.core.files import errors_with_path, read_json
from domino_env.core.models import LARGEST, Number, read_model
from domino_env.physics.files import LayoutTable
from domino_env.physics.layout import Layout
from domino_env.scenes.io.reading import load_scene, scene_names
from domino_env.scenes.scene import Scene

PATH = Path(__file__).with_name("best_known.json")
RTOL = 1e-12  # relative error allowed in the arrival times of a stored score
MIN_GAIN = 1e-9  # smallest relative gain with which a layout replaces the best known


class BestKnown(LayoutTable, kw_only=True):
    """Best known layout of a scene, and the search that found it.

    Attributes
    ----------
    layout
        The layout.
    score
        Its score, from arrival times with a relative error of 1e-12.
    method, seed, seconds
        Method, seed and time [s] of the search.
    version
        Version of the package that searched.
    """

    score: Annotated[Number, Meta(description="score of the layout")]
    method: str
    seed: int
    seconds: Annotated[float, Meta(ge=0, le=LARGEST, description="time of the search [s]")]
    version: str

    @property
    def layout(self) -> Layout:
        """Best known layout."""
        return Layout(**self.arguments())


def best_known(path: Path | None = None) -> dict[str, BestKnown]:
    """Return the best known layouts by the name of their scene.

    Parameters
    ----------
    path
        JSON file; None for the shipped one.

    Returns
    -------
    dict
        Best known layouts, by name; empty if the file does not exist.

    Raises
    ------
    ValueError
        If the file is damaged; the message has the place and the reason.

    Examples
    --------
    >>> best_known()["sprint"].layout.count
    40
    """
    path = path or PATH
    if not path.exists():
        return {}
    document = read_json(path)
    with errors_with_path(path):
        entries = read_model(dict[str, Any], document)
        return {name: read_model(BestKnown, entry, name) for name, entry in entries.items()}


def best_known_of(scene: Scene) -> BestKnown | None:
    """Return the best known layout of a scene; None for any but the shipped scenes."""
    # a scene of the same name may be another one
    is_shipped = scene.name in scene_names() and load_scene(scene.name) == scene
    return best_known().get(scene.name) if is_shipped else None


def best_known_score(scene: Scene) -> float:
    """Return the score of the best known layout of a scene; -inf if there is none."""
    record = best_known().get(scene.name)
    # a scene of the same name may be another one: the layout must satisfy its rules
    if record is None or scene.violations(record.layout):
        return -math.inf
    return float(scene.score(record.layout))


def accurate_score(scene: Scene, layout: Layout) -> float:
    """Return the score of a layout from arrival times with a relative error of 1e-12."""
    return scene.score(scene.simulate(layout, rtol=RTOL))
