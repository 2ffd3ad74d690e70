"""Decoding: layouts from the outputs of the networks, within the bounds and of the given length."""

from __future__ import annotations

import numpy as np

from agents.designer.features import scene_features
from domino_env import Scene
from domino_env.core.projection import nearest_with_sum
from domino_env.core.types import Floats

LARGEST_GAP = 1.0  # logarithm of the largest gap over h that is decoded
HALVINGS = 40  # halvings of the interval of shifts that give a layout its length
LARGEST_SHIFT = 6.0  # largest shift of the logarithms of the gaps, which are at least -6 over h


def decode(scene: Scene, outputs: Floats, tight: Floats) -> tuple[Floats, Floats]:
    """Decode the outputs of the network into K layouts.

    The logarithms of the gaps are shifted by the same amount and clipped to their bounds so that
    the layout has its length; the last gaps stay tight while the others can make up for it.

    Parameters
    ----------
    scene
        The scene, whose rules are met.
    outputs
        (K, N-1, 2): logarithm of the gap over h, and of the thickness over the geometric mean of
        its bounds.
    tight
        (K,) numbers of tight gaps at the end.

    Returns
    -------
    gaps, thickness : NDArray
        (K, N-1) each [m].
    """
    h, features = scene.height, scene_features(scene)
    least, largest, thin, thick = (float(h * features[i]) for i in (3, 4, 6, 7))
    number, pairs = outputs.shape[:2]
    # logarithms are limited to ±9, against overflow
    ratio = np.exp(np.clip(outputs[..., 1], -9.0, 9.0))
    thickness = np.clip(np.sqrt(thin * thick) * ratio, thin, thick)
    proposal = h * np.exp(np.clip(outputs[..., 0], -LARGEST_SHIFT, LARGEST_GAP))
    is_tight = np.arange(pairs) >= pairs - tight[:, None]
    if scene.length is None:
        return np.where(is_tight, least, np.clip(proposal, least, largest)), thickness
    if thin < thick:  # thicknesses for which gaps within their bounds give the length
        for end, compare in ((pairs * least, np.greater), (pairs * largest, np.less)):
            is_out = compare(thickness.sum(axis=1), scene.length - end)
            thickness[is_out] = nearest_with_sum(
                thickness[is_out], np.full(pairs, thin), np.full(pairs, thick), scene.length - end
            )
    totals = scene.length - thickness.sum(axis=1)
    low, high = np.full((number, 1), -LARGEST_SHIFT), np.full((number, 1), LARGEST_SHIFT)
    for _ in range(HALVINGS):
        shift = 0.5 * (low + high)
        gaps = np.where(is_tight, least, np.clip(proposal * np.exp(shift), least, largest))
        is_short = gaps.sum(axis=1) < totals
        low[is_short], high[~is_short] = shift[is_short], shift[~is_short]
    error = totals - gaps.sum(axis=1)
    is_free = (gaps > least) & (gaps < largest)
    # removes the rounding error
    gaps += is_free * (error / np.maximum(is_free.sum(axis=1), 1))[:, None]
    for k in np.flatnonzero(np.abs(totals - gaps.sum(axis=1)) > 1e-12):  # no longer tight
        bounds = np.full(pairs, least), np.full(pairs, largest)
        gaps[k] = nearest_with_sum(gaps[k : k + 1], *bounds, float(totals[k]))[0]
    return np.clip(gaps, least, largest), thickness
