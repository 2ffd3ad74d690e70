"""The best uniform row on a floor: what a design has to beat there."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from domino_env.physics.layout import Layout
from domino_env.rigid.simulation import simulate_standing
from domino_env.scenes.scene import Scene

NARROWER, WIDER, LOOKS = 0.6, 1.6, 9  # of the best hinged gap: where a first look is taken
CLOSER = 8  # looks around the best of those


def best_uniform_on(scene: Scene, mark: Layout, floor: float | None, rtol: float = 1e-3) -> Layout:
    """Find the gap at which a uniform row is fastest on a floor.

    Parameters
    ----------
    scene
        Whose bounds the gaps keep.
    mark
        Its best uniform row on hinges, or the first dominoes of it; thicknesses stay as they are.
    floor
        Friction of the floor; None for hinged.
    rtol
        Of the simulations.

    Returns
    -------
    Layout
        The mark itself on hinges, if it is whole, and where the scene leaves no gap to choose (a
        length, a list, growing dominoes) or does not count speed.

    Notes
    -----
    All gaps grow by the same amount: nine looks between 0.6 and 1.6 of the mark's gap, eight more
    around the best, where the speed has one peak.
    """
    fixed = scene.length is not None or scene.spacing_values is not None or scene.growth is not None
    whole = mark.count == scene.count
    if (floor is None and whole) or fixed or scene.unit != "m/s":
        return mark
    gaps = mark.spacing
    mean = float(gaps.mean())
    least = max(scene.spacing[0] - float(gaps.min()), (NARROWER - 1.0) * mean)
    most = min(scene.spacing[1] - float(gaps.max()), (WIDER - 1.0) * mean)

    def wider(by: float) -> Layout:
        moved = np.clip(gaps + by, *scene.spacing)
        row = moved, mark.thickness, mark.height, mark.width, mark.density
        return Layout(*row) if scene.ground is None else scene.ground.layout(*row)

    def slowness(by: float) -> float:
        row = wider(by)
        return float(
            simulate_standing(row, scene.physics, floor, rtol).arrival_times[-1] / row.length
        )

    looks = np.unique(np.append(np.linspace(least, most, LOOKS), 0.0))
    times = [slowness(by) for by in looks]
    k = int(np.argmin(times))
    around = float(looks[max(k - 1, 0)]), float(looks[min(k + 1, len(looks) - 1)])
    if not (np.isfinite(times[k]) and around[0] < around[1]):
        return mark
    closer = minimize_scalar(
        slowness, bounds=around, method="bounded", options={"maxiter": CLOSER, "xatol": 1e-5}
    )
    return wider(float(closer.x) if closer.fun < times[k] else float(looks[k]))
