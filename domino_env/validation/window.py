"""How much of a fall the gaps decide that `DominoChain` no longer observes.

    python -m domino_env.validation.window

The front is at domino 30 of a row whose last W gaps (and the next one) are kept while all earlier
ones are drawn anew. What the time of the fall still varies by is the share that the window leaves
out: as a part of the time itself, and as a part of its variance over rows, the latter also once the
front's speed, which is observed too, is allowed for by linear regression.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from domino_env.physics.wave import simulate_batch
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene

Floats = NDArray[np.float64]

WINDOWS = (1, 2, 4, 8, 12, 16)
LEADER, KEPT, REDRAWN = 30, 200, 32
SPREAD = 0.15  # of the logarithm of the gaps around the best uniform one


def shares(scene: Scene, window: int, seed: int = 0) -> tuple[float, float, float]:
    """Measure what gaps beyond a window decide, over rows near the best uniform one.

    Parameters
    ----------
    scene
        Of its gaps and physics; all dominoes are as its first.
    window
        Gaps kept behind the leader, 0 to 30.
    seed
        Of the rows.

    Returns
    -------
    tuple of float
        Standard deviation of the time of a fall over the time, the median over rows; the part of
        its variance that lies beyond the window; that part once the front's speed is known.
    """
    rng, gap = np.random.default_rng(seed), scene.uniform().layout.spacing[0]

    def drawn(*shape: int) -> Floats:
        low, high = scene.spacing
        gaps: Floats = gap * np.exp(SPREAD * rng.standard_normal(shape))
        return gaps.clip(low, high)

    kept = np.broadcast_to(drawn(KEPT, 1, window + 1), (KEPT, REDRAWN, window + 1))
    spacing = np.concatenate((drawn(KEPT, REDRAWN, LEADER - window), kept), axis=2)
    thickness = np.full(LEADER + 2, scene.first_thickness)
    waves = simulate_batch(
        spacing.reshape(-1, LEADER + 1), thickness, scene.physics,
        height=scene.height, rtol=1e-10,
    )  # fmt: skip
    hits = waves.arrival_times[:, LEADER : LEADER + 2]
    times = np.diff(hits, axis=1).reshape(KEPT, REDRAWN)
    fronts = waves.release_velocity[:, LEADER].reshape(KEPT, REDRAWN)
    ran = np.isfinite(times).all(axis=1)
    times, fronts = times[ran], fronts[ran]
    about, swift = times - times.mean(1)[:, None], fronts - fronts.mean(1)[:, None]
    varied = (swift**2).sum(1)
    slope = np.divide((about * swift).sum(1), varied, out=np.zeros_like(varied), where=varied > 0.0)
    rest = about - slope[:, None] * swift
    whole = times.var()
    return (
        float(np.median(times.std(1) / times.mean(1))),
        float((about**2).mean() / whole),
        float((rest**2).mean() / whole),
    )


def main() -> None:
    """Print the table of the site's page on environments."""
    print(
        "| scene | gaps observed | of the time | of its variance | with the front's speed known |"
    )
    print("| --- | --- | --- | --- | --- |")
    for name in ("sprint", "ideal"):
        for window in WINDOWS:
            part, variance, rest = shares(load_scene(name), window)
            print(f"| `{name}` | {window} | {part:.1e} | {variance:.1e} | {rest:.1e} |")


if __name__ == "__main__":
    main()
