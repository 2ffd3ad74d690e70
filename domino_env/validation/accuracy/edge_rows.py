"""Named rows at the edge: what the solver must get right, or refuse with a reason.

Each case is a row that someone, or an optimiser, could hand in.  `extremes()` yields them all; the
stability report runs them, and the tests hold each to its answer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.steady import smallest_push
from domino_env.physics.wave import Outcome, simulate

H, D = 0.048, 0.0075  # height and thickness of the standard domino [m]
RAN = frozenset({Outcome.PROPAGATED})


@dataclass(frozen=True, eq=False)
class Extreme:
    """One row at the edge.

    Attributes
    ----------
    group
        What is extreme.
    name
        How much.
    layout
        What stands.
    physics
        What makes it fall.
    expected
        Outcomes that are right, where the case is built for one; None where another way of
        solving has to tell.
    exact
        Short and ill-conditioned enough to be held against sixty digits.
    """

    group: str
    name: str
    layout: Layout
    physics: Physics
    expected: frozenset[Outcome] | None = None
    exact: bool = False


def _ends(*outcomes: Outcome) -> frozenset[Outcome]:
    return frozenset(outcomes)


def extremes(million: bool = True) -> Iterator[Extreme]:
    """Yield all cases, group by group.

    Parameters
    ----------
    million
        Whether the long rows have a million dominoes; else ten thousand.
    """
    yield from near_stall()
    yield from smallest_pushes()
    yield from near_touching()
    yield from near_out_of_reach()
    yield from slenderness()
    yield from unequal_neighbours()
    yield from friction_to_the_jam()
    yield from pushes()
    yield from growing_heights()
    yield from flush_patterns()
    yield from flushes_close_together()
    yield from over_hills()
    yield from long_rows(1_000_000 if million else 10_000)


def hesitant_row() -> Layout:
    """Five dominoes whose tight third gap nearly stops the wave."""
    return Layout([0.02, 0.012, 0.004, 0.015], D)


def dipping_push(layout: Layout, physics: Physics, dip: float) -> float:
    """Find the push at which the lowest u of all falls is `dip` of its value at release.

    Bisection: the harder the push, the less the leader slows down.

    Parameters
    ----------
    layout
        What stands.
    physics
        Friction and gravity; its push plays no part.
    dip
        Stall margin to meet, 0 to 1.

    Returns
    -------
    float
        The push [rad/s].
    """
    low = smallest_push(layout, physics)
    high = 4.0 * low
    for _ in range(80):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        wave = simulate(layout, replace(physics, push=middle), rtol=1e-13)
        lowest = np.nanmin(wave.stall_margin)
        if wave.outcome == Outcome.PROPAGATED and lowest > dip:
            high = middle
        else:
            low = middle
    return high


def near_stall() -> Iterator[Extreme]:
    """Yield rows whose leader all but stops: u dips to a part of its value at release."""
    for friction in (0.25, 0.0):
        row, physics = hesitant_row(), Physics(friction)
        for power in (1, 3, 6, 9, 12, 14):
            push = dipping_push(row, physics, 10.0**-power)
            yield Extreme(
                "near stall",
                f"μ = {friction:g}, u dips to 1e-{power}",
                row,
                replace(physics, push=push),
                RAN if power < 13 else _ends(Outcome.PROPAGATED, Outcome.STALLED),
                exact=True,
            )


def smallest_pushes() -> Iterator[Extreme]:
    """Pushes just above and just below the smallest that topples the row."""
    for friction in (0.25, 0.0):
        row, physics = hesitant_row(), Physics(friction)
        least = smallest_push(row, physics)
        for power in (3, 6, 9, 12):
            for sign in (1, -1):
                right = Outcome.PROPAGATED if sign > 0 else Outcome.STALLED
                yield Extreme(
                    "smallest push",
                    f"μ = {friction:g}, times 1 {'+' if sign > 0 else '-'} 1e-{power}",
                    row,
                    replace(physics, push=least * (1.0 + sign * 10.0**-power)),
                    _ends(right),
                    exact=sign > 0,
                )


def near_touching() -> Iterator[Extreme]:
    """Gaps of a millionth of the height and less, alone and all along the row."""
    for power in (2, 4, 6, 8):
        gap = 10.0**-power * H
        gaps = np.full(19, 0.015)
        gaps[9] = gap
        much = f"1e-{power} of the height"
        for friction in (0.25, 0.0):
            name = f"μ = {friction:g}, one gap {much}"
            yield Extreme("near touching", name, Layout(gaps, D), Physics(friction, push=30.0))
        yield Extreme(
            "near touching",
            f"thin dominoes (d/L = 0.001), all gaps {much}",
            Layout.uniform(20, spacing=gap, thickness=0.001 * H),
            Physics(friction=0.1, push=1e3),
        )
        yield Extreme(
            "near touching",
            f"μ = 0, all gaps {much}",
            Layout.uniform(20, spacing=gap),
            Physics(friction=0.0, push=1e4),
        )
    for friction in (0.25, 0.0):
        tiny = Layout.uniform(20, spacing=1e-4 * H, slope=0.1)
        name = f"μ = {friction:g}, gaps of 1e-4 downhill"
        yield Extreme("near touching", name, tiny, Physics(friction, push=20.0))


def near_out_of_reach() -> Iterator[Extreme]:
    """Gaps that the top edge only just bridges, and some that it does not."""
    for power in (2, 4, 6, 8, 10, 12):
        gaps = np.full(11, 0.015)
        gaps[5] = H * (1.0 - 10.0**-power)
        near = f"1 - s/L = 1e-{power}"
        for friction in (0.25, 0.0):
            physics = Physics(friction)
            for name, row in (
                ("one gap", Layout(gaps, D)),
                ("all gaps", Layout.uniform(12, spacing=gaps[5])),
            ):
                yield Extreme("out of reach", f"μ = {friction:g}, {name} {near}", row, physics)
    for gap in (H, np.nextafter(H, 1.0), 2.0 * H):
        gaps = np.full(11, 0.015)
        gaps[5] = gap
        row = Layout(gaps, D)
        yield Extreme(
            "out of reach", f"s - L = {gap - H:.1e} m", row, Physics(), _ends(Outcome.OUT_OF_REACH)
        )


def slenderness() -> Iterator[Extreme]:
    """Dominoes from razor blades to cubes."""
    for a in (1e-6, 1e-4, 1e-2, 0.1, 0.3, 0.6, 1.0):
        for friction in (0.25, 0.0):
            for share in (0.3, 0.8):
                yield Extreme(
                    "slenderness",
                    f"d/L = {a:g}, s/L = {share:g}, μ = {friction:g}",
                    Layout.uniform(20, spacing=share * H, thickness=a * H),
                    Physics(friction, push=60.0),
                )


def unequal_neighbours() -> Iterator[Extreme]:
    """Neighbours that differ a thousandfold in thickness, or in density."""
    for friction in (0.25, 0.0):
        for many in (10.0, 100.0, 1000.0):
            thin = np.full(20, D / 100.0)
            for name, start in (("thin first", 1), ("thick first", 0)):
                thick = thin.copy()
                thick[start::2] *= many
                yield Extreme(
                    "unequal neighbours",
                    f"μ = {friction:g}, thickness 1 : {many:g}, {name}",
                    Layout(np.full(19, 0.02), thick),
                    Physics(friction, push=200.0),
                )
            density = np.full(20, 1040.0)
            density[1::2] *= many
            yield Extreme(
                "unequal neighbours",
                f"μ = {friction:g}, density 1 : {many:g}",
                Layout(np.full(19, 0.02), D, density=density),
                Physics(friction, push=50.0),
            )


def friction_to_the_jam() -> Iterator[Extreme]:
    """Friction up to where the stack passes no push on, and past it."""
    for friction in (0.5, 1.0, 2.0, 4.0, 6.0, 6.2, 6.19, 6.3, 8.0, 20.0, 1e3, 1e6):
        yield Extreme(
            "friction",
            f"μ = {friction:g}, gap 12 mm",
            Layout.uniform(20, spacing=0.012),
            Physics(friction, push=100.0),
        )
    # At the first hit domino 1 is driven by B = L cos Δ - μ d; it vanishes at this friction.
    edge = math.sqrt(H * H - 0.012**2) / D
    for sign, power in ((-1, 3), (-1, 6), (-1, 9), (-1, 12), (0, 0), (1, 12), (1, 6)):
        off = sign * 10.0**-power if sign else 0.0
        yield Extreme(
            "friction",
            f"the first hit jams at μ* = {edge:.4f}; μ/μ* - 1 = {off:g}",
            Layout.uniform(5, spacing=0.012),
            Physics(edge * (1.0 + off), push=100.0),
            _ends(Outcome.JAMMED) if sign > 0 else _ends(Outcome.JAMMED, Outcome.STALLED),
        )


def pushes() -> Iterator[Extreme]:
    """From a breath that tips the first domino to a thousand times more."""
    row = Layout.uniform(30, spacing=0.016)
    tip = math.sqrt(3.0 * 9.81 / (H * H + D * D) * (math.hypot(H, D) - H))  # energy to the edge
    for times in (1.0 + 1e-9, 1.001, 1.5, 10.0, 100.0, 1000.0):
        for friction in (0.25, 0.0):
            yield Extreme(
                "push",
                f"μ = {friction:g}, {times:.10g} times what tips the first domino",
                row,
                Physics(friction, push=tip * times),
                _ends(Outcome.PROPAGATED, Outcome.STALLED),
            )


def growing_heights() -> Iterator[Extreme]:
    """Every domino larger than the one before by a factor, up to and past where the wave dies."""
    for factor in (1.05, 1.2, 1.4, 1.5, 1.53, 1.54, 1.55, 1.6, 2.0, 1 / 1.05):
        scale = factor ** np.arange(16)
        gap = 0.6 * H * scale[:-1]
        yield Extreme(
            "growing heights",
            f"factor {factor:.4g}",
            Layout(gap, D * scale, height=H * scale),
            Physics(push=30.0),
            _ends(Outcome.PROPAGATED, Outcome.STALLED),
        )


def flush_patterns() -> Iterator[Extreme]:
    """Rows in which links turn from tip to corner contact, one by one or many in one impact."""
    rows = {
        "at every link": np.linspace(0.004, 0.036, 30),
        "twelve in one impact": np.concatenate([np.full(12, 0.005), np.full(8, 0.030)]),
        "clusters of three": np.tile([0.003, 0.003, 0.003, 0.034], 8),
    }
    for friction in (0.25, 0.6, 0.0):
        for name, gaps in rows.items():
            physics = Physics(friction, push=12.0)
            yield Extreme("flushes", f"μ = {friction:g}, {name}", Layout(gaps, D), physics)


def flushes_close_together() -> Iterator[Extreme]:
    """Yield runs of nearly equal gaps: the flushes follow one another within a hair."""
    for power in (4, 6, 7, 8, 8.5, 9, 10, 12, 15):
        for sign in (1, -1):
            graded = 0.005 * (1.0 + sign * 10.0**-power * np.arange(12))
            gaps = np.concatenate([graded, np.full(8, 0.030)])
            yield Extreme(
                "flushes close together",
                f"gaps {'growing' if sign > 0 else 'shrinking'} by 1e-{power:g} each",
                Layout(gaps, D),
                Physics(),
            )


def over_hills() -> Iterator[Extreme]:
    """Yield rows on ground that could hardly be steeper, more crooked or more stepped."""
    steepest, group = math.atan(D / H), "hills"
    for friction in (0.25, 0.0):
        physics = Physics(friction, push=20.0)
        for share in (0.9999, -0.9999):
            row = Layout.uniform(20, spacing=0.015, slope=share * steepest)
            yield Extreme(group, f"μ = {friction:g}, {share:g} of too steep", row, physics)
        waves = 0.12 * np.cos(1.6 * np.arange(20))
        lie = -0.0275 * np.sin(0.5 * (waves[1:] + waves[:-1]))
        crooked = Layout(np.full(19, 0.02), D, rise=lie, tilt=waves)
        yield Extreme(group, f"μ = {friction:g}, crest after hollow", crooked, physics)
        high = Layout([0.02, 0.012, 0.02], D, rise=[0.0199, 0.0119, -0.0035])
        yield Extreme(group, f"μ = {friction:g}, nearly stairs", high, physics, exact=True)
        turn = math.asin(0.01 / H) * (1.0 - 1e-6)  # the first all but leans on the second
        hollow = Layout([0.01, 0.015], D, rise=0.0019, tilt=[0.5 * turn, -0.5 * turn, 0.0])
        yield Extreme(group, f"μ = {friction:g}, tops all but touch", hollow, physics)


def long_rows(count: int) -> Iterator[Extreme]:
    """Yield a row of `count` equal dominoes, and a random one."""
    rng = np.random.default_rng(1)
    yield Extreme(
        "long rows", f"{count} equal dominoes", Layout.uniform(count, pitch=0.016), Physics()
    )
    gaps = rng.uniform(0.010, 0.025, count - 1)
    yield Extreme("long rows", f"{count} at random gaps", Layout(gaps, D), Physics())
