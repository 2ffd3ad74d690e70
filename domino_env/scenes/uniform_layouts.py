"""Uniform layouts of a scene, given by two numbers, and their scores.

Later dominoes do not change earlier motion, so the first dominoes of a long layout, its prefix,
topple as if they were alone. If the intervals between hits have become constant in the prefix, its
wave is extrapolated to the whole layout.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from domino_env.core.types import Bools, Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import WaveBatch
from domino_env.scenes.design_space import DesignSpace
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.simulators import Stop

PREFIX_RTOL = 1e-11  # relative tolerance of the arrival times of prefixes
MAX_BATCH = 4_000_000  # [dominoes] simulated in one call, which takes some 200 MB
FIRST_PREFIX = 64  # [dominoes] in the first prefixes; those with unsteady waves are doubled
PLANNING_ORDERS = 64  # random orders of a stock, of seeds 0, 1, …, over which scores are means
ORDER_RTOL = 1e-8  # relative tolerance of mean arrival times over orders
WINDOW = 4  # the last 1/WINDOW of a prefix has to be steady


def _extend(prefix: LayoutBatch, count: int, change: float) -> tuple[WaveBatch, Bools]:
    """Simulate the first dominoes of B uniform layouts and extend their waves to `count` dominoes.

    Parameters
    ----------
    prefix
        The first dominoes.
    count
        Number N of dominoes of the whole layouts.
    change
        Largest relative difference of `Wave.release_velocity` within the last 1/`WINDOW` of a
        prefix whose wave is steady.

    Returns
    -------
    waves : WaveBatch
        Waves of the whole layouts; arrays and arrival times are those of the prefixes.
    is_final : NDArray
        (B,) True if the prefix is long enough: its wave is steady, or stops.
    """
    n, missing = prefix.count, count - prefix.count
    waves = prefix.simulate(record=True)
    if missing == 0:
        return waves, np.ones(len(prefix), np.bool_)
    window = n // WINDOW
    velocities = waves.release_velocity[:, -window:]
    is_steady = np.ptp(velocities, axis=1) <= change * velocities[:, -1]
    # whether the last domino of a prefix hits the next one shows only in a longer prefix
    is_final = np.where(waves.propagated, is_steady, waves.reach * n < n - 1)
    times = np.where(waves.propagated[:, None], waves.arrival_times, 0.0)
    interval = (times[:, -1] - times[:, -1 - window]) / window
    pitch = prefix.spacing + prefix.thickness[:, 1:]
    length = pitch.sum(axis=1) + missing * pitch[:, -1]
    time = times[:, -1] + missing * interval
    summary = waves.summary._replace(
        reach=np.where(waves.propagated, 1.0, waves.reach * n / count),
        toppled=np.where(waves.propagated, count, waves.toppled),
        total_time=np.where(waves.propagated, time, np.inf),
    )
    speed = np.divide(length, time, out=np.zeros_like(length), where=waves.propagated)
    return replace(waves, summary=summary, mean_speed=speed), is_final


class UniformLayouts:
    """Uniform layouts of a scene, each given by a point: two numbers, gap and thickness [m].

    In a scene in heights of dominoes, the numbers are ratios to the height, and if heights grow,
    the second is the growth. With a stock, the first may be the pitch, and the second is 0.

    Parameters
    ----------
    scene
        The scene.

    Attributes
    ----------
    low, high
        (2,) bounds of the two numbers.
    thicknesses
        (N-1,) thicknesses of the pieces of a stock in their order [m]; empty without a stock.
    one_pitch
        True if the first number is the pitch of pieces of different thickness.
    orders
        (M, N-1) thicknesses in the random orders over which scores are means [m]; one order of
        zeros if pieces are not drawn in random order.
    """

    def __init__(self, scene: Any) -> None:
        self.scene = scene
        self.space: DesignSpace = scene.space
        pairs = scene.count - 1
        first, second = scene.spacing, scene.thickness if scene.growth is None else scene.growth
        self.thicknesses, self.one_pitch = np.zeros(0), False
        self.orders = np.zeros((1, pairs))
        if scene.hand:
            self.orders = scene.orders([*map(np.random.default_rng, range(PLANNING_ORDERS))])
        if self.space.pieces is not None:
            self.thicknesses = self.space.pieces.dominoes[:pairs]
            second = (0.0, 0.0)
            pitch = first[0] + self.thicknesses.max(), first[1] + self.thicknesses.min()
            mean = pitch[0] if scene.length is None else scene.length / pairs
            self.one_pitch = pitch[0] <= mean <= pitch[1]
            if scene.hand:  # the order of drawing is random, so one gap is used for all
                self.thicknesses, self.one_pitch = self.orders[0], False
            if self.one_pitch:  # the gaps follow from the thicknesses
                first = pitch
        self.low, self.high = np.array([first, second]).T.copy()
        if scene.length is not None:
            self._meet_length(scene.length / pairs)

    def _meet_length(self, pitch: float) -> None:
        """Restrict the numbers to those with a mean pitch [m]."""
        scene = self.scene
        if scene.stock is not None:
            exact = pitch if self.one_pitch else pitch - float(self.thicknesses.mean())
            self.low[0] = self.high[0] = min(max(exact, self.low[0]), self.high[0])
            return
        self.low[1] = max(self.low[1], pitch - scene.spacing[1])
        self.high[1] = min(self.high[1], pitch - scene.spacing[0])
        self.low[0] = self.high[0] = pitch - self.low[1]

    def axes(
        self, numbers: tuple[int, int], spread: Callable[..., Floats] = np.linspace
    ) -> list[Floats]:
        """Return the values of a grid for both numbers, by a function such as `numpy.linspace`."""
        bounds = zip(self.low, self.high, numbers, strict=True)
        return [spread(low, high, n) if low < high else np.array([low]) for low, high, n in bounds]

    def sizes_at(
        self, points: Floats, pairs: int | None = None
    ) -> tuple[Floats, Floats, Floats | None]:
        """Return gaps, thicknesses and, if heights grow, heights of dominoes 1 … N-1.

        Parameters
        ----------
        points
            (B, 2) points.
        pairs
            Number of gaps N-1 of the first dominoes, if the layouts are `extendable`; None for all.

        Returns
        -------
        tuple
            Three arrays (B, N-1) [m]; None in place of equal heights.
        """
        space, (first, second) = self.space, np.split(points, 2, axis=1)
        thickness = second if self.scene.growth is None else space.thickness.low
        if self.scene.stock is not None:
            thickness = self.thicknesses
            first = np.clip(first - thickness, *self.scene.spacing) if self.one_pitch else first
        elif space.length is not None:
            first = space.length / space.pairs - second
        shape = np.zeros(pairs or space.pairs)
        return space.sizes(space.select(first + shape, thickness, second))

    def layout(self, point: Floats) -> Layout:
        """Return the layout of one point (2,)."""
        batch: LayoutBatch = self.scene.batch(*self.sizes_at(point[None]))
        return batch.layout(0)

    def mean_arrival_times(self, spacing: Floats) -> Floats:
        """Return the mean arrival times (N,) [s] of waves that complete, over all `orders`.

        spacing: gaps (N-1,) [m].
        """
        gaps = np.tile(spacing, (len(self.orders), 1))
        waves = self.scene.batch(gaps, self.orders, rtol=ORDER_RTOL).simulate(record=True)
        completed = waves.arrival_times[waves.propagated]
        return np.asarray(completed.mean(axis=0))

    @property
    def extendable(self) -> bool:
        """True if scores follow from the first dominoes, as all but the first are equal."""
        scoring = self.scene.scoring
        needs_all = scoring.objective.needs_arrivals or not scoring.follows_wave
        return self.scene.is_homogeneous and not needs_all

    def scores(self, points: Floats, rtol: float, stop: Stop = None) -> Floats:
        """Return the scores (B,) of the layouts at points (B, 2); `stop` as in `Scene.evaluate`.

        If pieces are drawn in random order, scores are means over `orders`.
        """
        scene, orders = self.scene, len(self.orders)
        simulations = scene.scoring.cost * orders
        piece, scores = max(1, MAX_BATCH // (scene.row_count * simulations)), []
        for i in range(0, len(points), piece):
            spacing, thickness, height = self.sizes_at(points[i : i + piece])
            if scene.hand:
                thickness = np.tile(self.orders, (len(spacing), 1))
                spacing = np.repeat(spacing, orders, axis=0)
            score = scene.scoring.evaluate(
                scene.batch(spacing, thickness, height, rtol), stop=stop
            ).score
            scores.append(score.reshape(-1, orders).mean(axis=1))
        return np.concatenate(scores)

    def scores_by_prefix(self, points: Floats, change: float) -> Floats:
        """Return the scores (B,) of `extendable` layouts at points (B, 2) from the first dominoes.

        Prefixes become longer until `Wave.release_velocity` changes by at most a fraction `change`
        at their ends, which is about the relative error of the scores.
        """
        scene = self.scene
        gaps, thicknesses, _ = self.sizes_at(points, 1)
        scores = np.empty(len(points))
        indices, n = np.arange(len(points)), FIRST_PREFIX
        while len(indices):
            n = min(n, scene.count)
            size = max(1, MAX_BATCH // n)
            ones, unfinished = np.ones(n - 1), []
            for i in range(0, len(indices), size):
                part = indices[i : i + size]
                prefix = scene.batch(gaps[part] * ones, thicknesses[part] * ones, rtol=PREFIX_RTOL)
                waves, is_final = _extend(prefix, scene.count, change)
                scores[part] = scene.scoring.score(waves).score
                unfinished.append(part[~is_final])
            indices, n = np.concatenate(unfinished), 2 * n
        return scores
