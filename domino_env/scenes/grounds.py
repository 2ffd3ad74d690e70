"""Which ground goes with a scene's bounds: on it every row that keeps them stands and can fall."""

from __future__ import annotations

import math

from domino_env.physics.ground import Ground

Bounds = tuple[float, float]


def clash_with_ground(
    ground: Ground,
    *,
    height: float,
    thickness: Bounds,
    spacing: Bounds,
    length: float | None,
    grows: bool,
    unsteady: bool,
) -> str | None:
    """Say why rows of a scene cannot stand on a ground, in a sentence; None where all can.

    No design within the bounds can then be one that does not stand, so that a search or an episode
    never meets it. It is enough, and nearly necessary, that the ground is nowhere too steep for
    the thinnest domino and nowhere bends so much that the narrowest gap, or the widest, were in
    trouble.

    Parameters
    ----------
    ground
        What they stand on.
    height
        Of all dominoes [m].
    thickness, spacing
        Least and largest [m].
    length
        From the first pivot to the last [m]; None where it is free.
    grows
        Whether heights are free.
    unsteady
        Whether gaps come out wrong while environments build.
    """
    thin, thick = thickness
    place, steepest = ground.steepest
    if steepest >= thin / height:
        slope, most = (math.degrees(math.atan(one)) for one in (steepest, thin / height))
        where = "" if ground.is_even else f" near x = {place:.4g} m"
        return (
            f"the ground slopes by {slope:.4g}°{where}, where a domino {1e3 * thin:.4g} mm thick "
            f"and {1e3 * height:.4g} mm high tips over by itself from {most:.4g}° on: make it "
            "flatter, or the dominoes thicker"
        )
    if ground.is_even:
        return None
    for there, what, why in (
        (length is not None, "row.length", "the length of a row depends on where its gaps lie"),
        (grows, "[growth]", "taller dominoes do not fit its bends"),
        (unsteady, "[placement]", "gaps may come out so narrow that dominoes lean on each other"),
    ):
        if there:
            return (
                f"{what} stands beside ground.profile: on uneven ground {why}; leave one of them "
                "out"
            )
    if refused := ground.bulge(thick):
        return refused
    return _bends_too_much(ground, height, thick, spacing)


def _bends_too_much(ground: Ground, height: float, thick: float, spacing: Bounds) -> str | None:
    """Whether the ground is too hollow for the narrowest gap, or bends too much for the widest.

    Where the ground bends by at most k, the slopes of two neighbouring chords differ by at most
    k (s + d), and a pivot lies at most k s (s + d)/2 off the line of the next chord. Dominoes do
    not lean against each other while L k (s + d) < s, and then a tip strikes below the top too, as
    L - √(L² - s²) > s²/2L. Both are tightest at the narrowest gap; that a pivot is not off by more
    than the contact height √(L² - s²), or than s, at the widest.
    """
    low, high = spacing
    for way, name in ((1.0, "hollow"), (-1.0, "crest")):
        place, bend = ground.curvature(way)
        if bend == 0.0:
            continue
        if way > 0.0 and height * _turned(bend, low + thick) >= low:
            # of the gap that is just wide enough, and 1 % more
            reach = height * bend
            need = f"at least {1e3 * _up(reach * thick / (1.0 - reach)):.3g} mm" * (reach < 0.9)
            return (
                f"spacing from {1e3 * low:.4g} mm on is too narrow for the hollow near x = "
                f"{place:.4g} m, of radius {1.0 / bend:.3g} m: dominoes would lean against each "
                f"other, or strike above the next one's top; make spacing.min {need or 'larger'}, "
                "or the ground less hollow"
            )
        off = 0.5 * high * _turned(bend, high + thick)
        if high >= height or off > min(high, 0.999 * math.sqrt(height**2 - high**2)):
            return (
                f"spacing up to {1e3 * high:.4g} mm is too wide for the {name} near x = "
                f"{place:.4g} m, of radius {1.0 / bend:.3g} m: a tip would miss the next domino; "
                "make spacing.max smaller, or the ground more even"
            )
    return None


def _turned(bend: float, reach: float) -> float:
    """By how much slopes differ at most over a way [m], seen from either."""
    turn = bend * reach
    return float(turn * (1.0 + turn * turn) ** 1.5)


def _up(least: float) -> float:
    return 1.02 * least
