"""Decoding: layouts within the bounds and of the given length, from the outputs of a network.

Logarithms of gaps are those of gaps over h, the height of a domino.
"""

from __future__ import annotations

import numpy as np

from agents.designer.features import BOUNDS, scene_features
from domino_env import Scene
from domino_env.core.projection import nearest_with_sum
from domino_env.core.types import Floats

MIN_LOG_GAP, MAX_LOG_GAP = -6.0, 1.0  # logarithms of gaps over h; outputs are clipped to them
MAX_SHIFT = 6.0  # largest shift of the logarithms of all gaps, to give a layout its length
HALVINGS = 40  # bisections of the interval of shifts, which is then about 1e-11


def decode(scene: Scene, outputs: Floats, tight: Floats) -> tuple[Floats, Floats]:
    """Decode the outputs of the network into K layouts of N dominoes.

    For a given length all logarithms of gaps are shifted by the same amount and clipped to their
    bounds. The last gaps stay tight, unless the other gaps cannot give the length.

    Parameters
    ----------
    scene
        The scene, whose bounds and length the layouts satisfy.
    outputs
        (K, N-1, 2): logarithm of the gap over h, and of the thickness over the geometric mean of
        its bounds.
    tight
        (K,) numbers of tight gaps at the end.

    Returns
    -------
    gaps, thickness : ndarray
        (K, N-1) each [m]; the thicknesses are those of dominoes 1 to N-1.
    """
    h, features = scene.height, scene_features(scene)
    least, largest, thin, thick = (float(h * features[i]) for i in BOUNDS)
    candidates, pairs = outputs.shape[:2]
    # logarithms are limited to ±9, against overflow
    ratio = np.exp(np.clip(outputs[..., 1], -9.0, 9.0))
    thickness = np.clip(np.sqrt(thin * thick) * ratio, thin, thick)
    proposal = h * np.exp(np.clip(outputs[..., 0], MIN_LOG_GAP, MAX_LOG_GAP))
    is_tight = np.arange(pairs) >= pairs - tight[:, None]
    if scene.length is None:
        return np.where(is_tight, least, np.clip(proposal, least, largest)), thickness
    if thin < thick:  # some thicknesses leave too little or too much length for the gaps
        bounds = np.full(pairs, thin), np.full(pairs, thick)
        for gap_sum, compare in ((pairs * least, np.greater), (pairs * largest, np.less)):
            limit = scene.length - gap_sum
            is_out = compare(thickness.sum(axis=1), limit)
            thickness[is_out] = nearest_with_sum(thickness[is_out], *bounds, limit)
    totals = scene.length - thickness.sum(axis=1)
    low, high = np.full((candidates, 1), -MAX_SHIFT), np.full((candidates, 1), MAX_SHIFT)
    for _ in range(HALVINGS):
        shift = 0.5 * (low + high)
        gaps = np.where(is_tight, least, np.clip(proposal * np.exp(shift), least, largest))
        is_short = gaps.sum(axis=1) < totals
        low[is_short], high[~is_short] = shift[is_short], shift[~is_short]
    error = totals - gaps.sum(axis=1)
    is_free = (gaps > least) & (gaps < largest)
    # distribute the error that bisection leaves
    gaps += is_free * (error / np.maximum(is_free.sum(axis=1), 1))[:, None]
    # an error of more than 1e-12 m remains if the last gaps cannot stay tight
    for k in np.flatnonzero(np.abs(totals - gaps.sum(axis=1)) > 1e-12):
        bounds = np.full(pairs, least), np.full(pairs, largest)
        gaps[k] = nearest_with_sum(gaps[k : k + 1], *bounds, float(totals[k]))[0]
    return np.clip(gaps, least, largest), thickness
