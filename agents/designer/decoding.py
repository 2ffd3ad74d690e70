"""Decoding: layouts from the outputs of the networks; bounds and a length are kept exactly."""

from __future__ import annotations

import numpy as np

from agents.designer.features import features_of
from domino_env import Scene
from domino_env.core.projection import nearest_with_sum
from domino_env.core.types import Floats

WIDEST = 1.0  # logarithm of a gap over h beyond which none is asked for
HALVINGS = 40  # of the interval that holds the shift of a layout to its length
FURTHEST = 6.0  # largest such shift, of the logarithm of the gaps


def decoded(scene: Scene, outputs: Floats, plans: Floats) -> tuple[Floats, Floats]:
    """Decode the outputs of the network into the layouts of K plans.

    Gaps are shifted alike in the logarithm and cut off at their bounds until the layout has its
    length; the tight end stays tight as long as the others can make up for it.

    Parameters
    ----------
    scene
        Whose rules are kept.
    outputs
        (K, N-1, 2): logarithm of the gap over h, and of the thickness over the middle (of the
        logarithms) of its bounds.
    plans
        (K,) tight gaps at the end.

    Returns
    -------
    gaps, thickness : NDArray
        (K, N-1) each [m].
    """
    h, features = scene.height, features_of(scene)
    least, largest, thin, thick = (float(h * features[i]) for i in (3, 4, 6, 7))
    rows, pairs = outputs.shape[:2]
    thickness = np.clip(
        np.sqrt(thin * thick) * np.exp(np.clip(outputs[..., 1], -9.0, 9.0)), thin, thick
    )
    wanted = h * np.exp(np.clip(outputs[..., 0], -FURTHEST, WIDEST))
    tight = np.arange(pairs) >= pairs - plans[:, None]
    if scene.length is None:
        return np.where(tight, least, np.clip(wanted, least, largest)), thickness
    if thin < thick:  # what the gaps can make up for
        for end, beyond in ((pairs * least, np.greater), (pairs * largest, np.less)):
            off = beyond(thickness.sum(axis=1), scene.length - end)
            thickness[off] = nearest_with_sum(
                thickness[off], np.full(pairs, thin), np.full(pairs, thick), scene.length - end
            )
    totals = scene.length - thickness.sum(axis=1)
    low, high = np.full((rows, 1), -FURTHEST), np.full((rows, 1), FURTHEST)
    for _ in range(HALVINGS):
        shift = 0.5 * (low + high)
        gaps = np.where(tight, least, np.clip(wanted * np.exp(shift), least, largest))
        short = gaps.sum(axis=1) < totals
        low[short], high[~short] = shift[short], shift[~short]
    rest = totals - gaps.sum(axis=1)
    free = (gaps > least) & (gaps < largest)
    gaps += free * (rest / np.maximum(free.sum(axis=1), 1))[:, None]  # what rounding has left
    for k in np.flatnonzero(np.abs(totals - gaps.sum(axis=1)) > 1e-12):  # the tight end gives way
        ends = np.full(pairs, least), np.full(pairs, largest)
        gaps[k] = nearest_with_sum(gaps[k : k + 1], *ends, float(totals[k]))[0]
    return np.clip(gaps, least, largest), thickness
