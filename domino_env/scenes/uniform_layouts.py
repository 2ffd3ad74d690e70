"""Uniform layouts of a scene by two numbers, and their scores.

Nothing that stands further on changes what happened before, so the first dominoes of a long layout
fall as those of a short one do. Where the fall times of the short one have stopped changing, the
rest of the long one is known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.scenes.rules import ON_LIST, nearest_of
from domino_env.scenes.specification import Specification
from domino_env.scenes.waves import LayoutBatch, Waves

HEADS_RTOL = 1e-11
LARGEST_BATCH = 4_000_000  # dominoes at once, some 200 MB


SHORTEST = 64  # dominoes of the first heads; those that are not steady are doubled
WINDOW = 4  # the last 1/4 of a head has to be steady


def _extended(
    head: LayoutBatch, count: int, steady: float, *, arrivals: bool
) -> tuple[Waves, NDArray[np.bool_]]:
    """Simulate the first dominoes of B uniform layouts and extend their waves to `count` dominoes.

    Parameters
    ----------
    head
        The first dominoes.
    count
        Number N of dominoes of the whole layouts.
    steady
        Largest relative change of the velocity at release that still counts as none.
    arrivals
        Whether all their arrival times are wanted.

    Returns
    -------
    waves : Waves
        Of the whole layouts.
    settled : NDArray
        (B,) whether the heads were long enough to tell: the wave was steady, or stopped.
    """
    n, more = head.count, count - head.count
    batch = head.simulate(record=True)
    waves = Waves.of_batch(batch, head)
    if more == 0:
        return waves, np.ones(len(head), np.bool_)
    window = n // WINDOW
    last = batch.release_velocity[:, -window:]
    same = np.ptp(last, axis=1) <= steady * last[:, -1]
    # in the last fall of a head nothing is struck: in the whole row the wave might die there
    settled = np.where(waves.propagated, same, waves.reach * n < n - 1)
    times = np.where(waves.propagated[:, None], batch.arrival_times, 0.0)
    step = (times[:, -1] - times[:, -1 - window]) / window
    pitch = head.spacing + head.thickness[:, 1:]
    way = pitch.sum(axis=1) + more * pitch[:, -1]
    time = times[:, -1] + more * step
    if arrivals:
        times = np.concatenate(
            [times, times[:, -1:] + np.arange(1, more + 1) * step[:, None]], axis=1
        )
    return replace(
        waves,
        reach=np.where(waves.propagated, 1.0, waves.reach * n / count),
        mean_speed=np.divide(way, time, out=np.zeros_like(way), where=waves.propagated),
        toppled=np.where(waves.propagated, count, waves.toppled),
        arrival_times=times if arrivals else np.empty((len(head), 0)),
        count=count,
    ), settled


class UniformLayouts:
    """The uniform rows of a scene by two numbers: gap and thickness.

    In place of the gap the pitch, or gap over height; in place of the thickness the growth.
    `low`, `high`: (2,) their bounds; `allowed`: for each, the values that are tried, None for any.
    """

    def __init__(self, scene: Specification) -> None:
        self.scene = scene
        pairs = scene.count - 1
        self.allowed = [scene.spacing_values, scene.thickness_values]
        first, second = scene.spacing, scene.thickness
        self.bodies, self.one_pitch = np.zeros(0), False
        if scene.growth is not None:
            second = scene.growth
        if scene.stock is not None:
            self.bodies = scene.stock.without(scene.first_thickness).dominoes[:pairs]
            second, self.allowed[1] = (0.0, 0.0), None
            pitch = first[0] + self.bodies.max(), first[1] + self.bodies.min()
            wanted = pitch[0] if scene.length is None else scene.length / pairs
            self.one_pitch = scene.spacing_values is None and pitch[0] <= wanted <= pitch[1]
            if scene.largest_change is not None and pairs > 1:
                steepest = float(np.abs(np.diff(self.bodies)).max())
                self.one_pitch = self.one_pitch and steepest <= scene.largest_change
            if self.one_pitch:  # the gaps are what the dominoes leave of it
                first = pitch
        self.low, self.high = np.array([first, second]).T.copy()
        self.spread: tuple[float, ...] | None = None
        if scene.length is not None:
            self._follow_length(scene.length / pairs)
        if self.low[0] > self.high[0] + 1e-12 or self.low[1] > self.high[1] + 1e-12:
            asked = f"{scene.length} m long" if scene.length is not None else "of one pitch"
            raise ValueError(
                f"scene '{scene.name}': no uniform row of {scene.count} dominoes is {asked} "
                f"within spacing {scene.spacing} m and thickness {scene.thickness} m"
            )

    def _follow_length(self, pitch: float) -> None:
        """Where a length is to be met, the gap follows from the thickness."""
        scene = self.scene
        listed, self.allowed[0] = scene.spacing_values, None
        if listed and scene.stock is None and self.allowed[1] is None and scene.free_thickness:
            # a gap of the list and the thickness that it leaves; else two gaps that take turns
            values, part = np.array(listed), np.linspace(0.0, 1.0, scene.count)
            mixed = (values[:-1, None] + np.diff(values)[:, None] * part).ravel()
            for means in (values, mixed):
                thick = np.sort(pitch - means)
                thick = thick[(thick >= scene.thickness[0]) & (thick <= scene.thickness[1])]
                if len(thick):
                    self.allowed[1] = tuple(float(d) for d in thick)
                    break
        self.spread = listed
        if scene.stock is not None:
            exact = pitch if self.one_pitch else pitch - float(self.bodies.mean())
            self.low[0], self.high[0] = max(self.low[0], exact), min(self.high[0], exact)
            return
        self.low[1] = max(self.low[1], pitch - scene.spacing[1])
        self.high[1] = min(self.high[1], pitch - scene.spacing[0])
        some = self.allowed[1]
        if some is not None:
            slack = ON_LIST / len(some)
            within = [d for d in some if self.low[1] - slack <= d <= self.high[1] + slack]
            if self.spread is not None:
                within = [d for d in within if _spread(pitch - d, self.spread, scene.count - 1)]
            self.allowed[1] = tuple(within)
            self.low[1], self.high[1] = (within[0], within[-1]) if within else (1.0, 0.0)
        if self.low[1] <= self.high[1] + 1e-12:
            self.low[0] = self.high[0] = pitch - self.low[1]

    def at(self, points: Floats, pairs: int | None = None) -> tuple[Floats, Floats, Floats | None]:
        """Gaps, thicknesses and, where they grow, heights of dominoes 1 … N-1, (B, N-1) [m].

        pairs: how many of them, where the rows are `steady`; None for all.
        """
        scene = self.scene
        ones = np.ones(pairs or scene.count - 1)
        first, second = points[:, :1], points[:, 1:]
        if scene.growth is not None:
            tall: Floats = np.asarray(scene.height * np.cumprod(second * ones, axis=1))
            before = np.concatenate([np.full_like(first, scene.height), tall[:, :-1]], axis=1)
            thick: Floats = scene.thickness[0] * tall
            gaps: Floats = first * before
            return gaps, thick, tall
        if scene.in_heights:
            scale = scene.height * ones
            return first * scale, second * scale, None
        if scene.stock is not None:
            thick = np.broadcast_to(self.bodies, (len(points), scene.count - 1))
            if self.one_pitch:
                return np.clip(first - thick, *scene.spacing), thick, None
            gaps = first * ones
        else:
            thick, gaps = second * ones, first * ones
            if scene.length is not None:
                gaps = (scene.length / (scene.count - 1) - second) * ones
        if self.spread is not None:
            for b, gap in enumerate(gaps[:, 0].tolist()):
                found = _spread(gap, self.spread, scene.count - 1)
                if found is None:
                    raise ValueError(
                        f"scene '{scene.name}': gaps of {gap:.9g} m on average meet the length, "
                        "and none on the list add up to it"
                    )
                gaps[b] = found
        return gaps, thick, None

    def layout(self, point: Floats) -> Layout:
        """Lay the row of one point (2,)."""
        spacing, thickness, height = self.at(point[None])
        tall = None if height is None else height[0]
        return self.scene.layout(spacing[0], thickness[0], tall)

    @property
    def steady(self) -> bool:
        """Whether the rows are the same everywhere but at their first domino."""
        ground = self.scene.ground
        uneven = self.spread is not None or self.scene.growth is not None or len(self.bodies) > 0
        return not (
            uneven
            or self.scene.criterion.simulates_anew
            or (ground is not None and not ground.is_even)
        )

    def scores(self, points: Floats, rtol: float) -> Floats:
        """(B,) scores of the layouts at points (B, 2)."""
        scene = self.scene
        piece = max(1, LARGEST_BATCH // (scene.count * scene.criterion.simulations_per_score))
        scores = [
            scene.criterion.evaluate(scene.batch(spacing, thickness, height, rtol)).score
            for i in range(0, len(points), piece)
            for spacing, thickness, height in [self.at(points[i : i + piece])]
        ]
        return np.concatenate(scores)

    def scores_by_heads(self, points: Floats, steady: float) -> Floats:
        """(B,) the same to about `steady` of themselves, where the layouts are `steady`.

        Heads are as short as their waves allow.
        """
        scene = self.scene
        criterion, count = scene.criterion, scene.count
        gaps, thick, _ = self.at(points, 1)
        scores = np.empty(len(points))
        left, n = np.arange(len(points)), SHORTEST
        while len(left):
            n = min(n, count)
            size = max(1, LARGEST_BATCH // (count if criterion.needs_arrivals else n))
            ones, unsettled = np.ones(n - 1), []
            for i in range(0, len(left), size):
                some = left[i : i + size]
                head = scene.batch(gaps[some] * ones, thick[some] * ones, rtol=HEADS_RTOL)
                waves, settled = _extended(head, count, steady, arrivals=criterion.needs_arrivals)
                scores[some] = criterion.score(waves).score
                unsettled.append(some[~settled])
            left, n = np.concatenate(unsettled), 2 * n
        return scores


def _spread(gap: float, allowed: tuple[float, ...], pairs: int) -> list[float] | None:
    """Gaps that are `gap` on average, of the allowed values next to it; None where none are."""
    values = np.array(allowed)
    near = float(nearest_of(np.array([gap]), values)[0])
    if abs(near - gap) * pairs <= ON_LIST:
        return [near] * pairs
    above = int(np.searchsorted(values, gap))
    if 0 < above < len(values):
        a, b = values[above - 1], values[above]
        wide = (gap - a) * pairs / (b - a)
        if abs(wide - round(wide)) * (b - a) <= ON_LIST:
            turns = np.floor((np.arange(pairs + 1) + 0.5) * round(wide) / pairs)
            return [float(b if more else a) for more in np.diff(turns)]
    counts = _nearest_counts(gap, values, pairs)
    if counts is None:
        return None
    # each value as evenly along the row as its number allows
    places = [((j + 0.5) / n, v) for v, n in zip(values, counts, strict=True) for j in range(n)]
    return [float(v) for _, v in sorted(places)]


def _nearest_counts(gap: float, values: Floats, pairs: int) -> list[int] | None:
    """How often each value, for `pairs` of them to be `gap` on average and least far from it.

    A dynamic programme over the sum; None where nothing adds up.
    """
    rise = np.round((values - values[0]) / ON_LIST).astype(np.int64)
    unit = int(np.gcd.reduce(rise)) or 1
    exact = (gap - values[0]) * pairs / (unit * ON_LIST)
    total = int(round(exact))
    if total < 0 or abs(exact - total) * unit > 1.0:
        return None
    steps, price = rise // unit, (values - gap) ** 2
    cost = np.full(total + 1, np.inf)
    cost[0] = 0.0
    chosen = np.zeros((pairs, total + 1), dtype=np.int32)
    for i in range(pairs):
        after = np.full(total + 1, np.inf)
        for k in np.flatnonzero(steps <= total):
            found = cost[: total + 1 - steps[k]] + price[k]
            better = np.flatnonzero(found < after[steps[k] :]) + steps[k]
            after[better], chosen[i, better] = found[better - steps[k]], k
        cost = after
    if not np.isfinite(cost[total]):
        return None
    counts = [0] * len(values)
    for i in range(pairs - 1, -1, -1):
        last = int(chosen[i, total])
        counts[last] += 1
        total -= int(steps[last])
    return counts
