"""What is reached in the scenes of a test set: by a policy for all of them, or by searching each.

The score is the median gain over the best uniform rows.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from agents.evaluation import STOPPED, searched_scores
from agents.scripted import SCRIPTED
from domino_env import Scene, SceneDistribution
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.io.reading import document_of_text
from domino_env.scenes.pool import load_test_set
from optimize.evaluator import Step
from optimize.searching import search
from optimize.studies.task import scene_of

Floats = NDArray[np.float64]

POINTS = 60  # of the trace of many searches


@lru_cache(8)
def problem_of(text: str) -> Scene | SceneDistribution:
    """Read the scene, or what scenes are drawn from, of a TOML text."""
    document = document_of_text(text, "scene")
    return SceneDistribution(document, "scene") if has_ranges(document) else scene_of(text)


def scripted_in(name: str, scenes: Sequence[Scene]) -> tuple[list[Step], float]:
    """Build with a scripted policy in each scene.

    Returns
    -------
    trace : list of tuple
        (dominoes placed, falls, processor seconds, median gain), once.
    score : float
        The median gain.
    """
    began = time.process_time()
    gains = [_gain(SCRIPTED[name](scene).gain) for scene in scenes]
    score, placed = float(np.median(gains)), sum(scene.count - 1 for scene in scenes)
    return [(placed, placed, time.process_time() - began, score)], score


def searched_in(
    method: str, seed: int, seconds: float | None, scenes: Sequence[Scene]
) -> tuple[list[Step], float]:
    """Search each scene, by processor time.

    Parameters
    ----------
    method, seed
        As of `optimize.search`.
    seconds
        For each scene at most [s].
    scenes
        To be searched.

    Returns
    -------
    trace : list of tuple
        (dominoes placed, falls, processor seconds, median gain), as if all searches went on side by
        side: after so many seconds in all each has had the same share of them.
    score : float
        The median gain in the end.
    """
    found = [
        search(scene, method, seed=seed, seconds=seconds, clock=time.process_time, progress=False)
        for scene in scenes
    ]
    traces = [np.array(one.trace) for one in found]
    placed = np.array([scene.count - 1 for scene in scenes])
    first = max(trace[0, 2] for trace in traces)
    last = max(trace[-1, 2] for trace in traces)
    steps: list[Step] = []
    for at in np.geomspace(max(first, 1e-6), max(last, 1e-6), POINTS):
        now = np.array([trace[np.searchsorted(trace[:, 2], at, "right") - 1] for trace in traces])
        spent = float(np.minimum(at, [trace[-1, 2] for trace in traces]).sum())
        gains = [_gain(s / r.uniform.score - 1.0) for s, r in zip(now[:, 3], found, strict=True)]
        rows, falls = int((now[:, 0] * placed).sum()), int(now[:, 1].sum())
        steps.append((rows, falls, spent, float(np.median(gains))))
    return steps, float(np.median([_gain(one.gain) for one in found]))


def known_gain(distribution: SceneDistribution) -> float:
    """Give the median gain of the searches that ship for its test set; -inf where none do."""
    tests = load_test_set(distribution.name)
    scores = searched_scores(distribution.name, len(tests))
    if scores is None:
        return -np.inf
    some = np.flatnonzero(np.isfinite(scores))
    return float(np.median([scores[i] / tests[i].uniform().score - 1.0 for i in some]))


def _gain(gain: float | None) -> float:
    return STOPPED if gain is None else max(float(gain), STOPPED)
