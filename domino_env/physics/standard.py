"""The standard domino, and hints at lengths in another unit."""

from __future__ import annotations

from pathlib import Path

from domino_env.core.files import one_line
from domino_env.core.progress import Advice, WrongUnit, advise

HEIGHT, WIDTH, DENSITY = 0.048, 0.024, 1040.0  # [m], [m], [kg/m³]
THICKNESS = 0.0075  # [m]

MAX_HEIGHT, MIN_HEIGHT = 10.0, 1e-3  # [m] of dominoes that are probably in metres
MAX_RATIO, MIN_RATIO = 10.0, 1e-3  # of a thickness or a gap over the height, likewise
ADVICE = (
    "lengths are in metres in Python and in files, 18 mm is 0.018; columns named …_mm, such as "
    "spacing_mm, and options are in millimetres"
)

Range = tuple[float, float]


def unit_hint(height: float, spacing: Range, thickness: Range) -> str | None:
    """Return a hint at a length that was probably given in another unit.

    Parameters
    ----------
    height
        Of the tallest domino [m].
    spacing
        The narrowest and the widest gap [m].
    thickness
        The thinnest and the thickest domino [m].

    Returns
    -------
    str or None
        A sentence; None if all lengths are plausible.
    """
    thickest, widest = thickness[1], spacing[1]
    heights = f"the dominoes are {height:g} m tall"
    reasons = {
        heights: not MIN_HEIGHT <= height <= MAX_HEIGHT,
        f"a domino is {thickest:g} m thick, and {heights}": thickest > MAX_RATIO * height,
        f"no domino is thicker than {thickest:g} m, and {heights}": thickest < MIN_RATIO * height,
        f"no gap is smaller than {spacing[0]:g} m, and {heights}": spacing[0] >= height,
        f"a gap is {widest:g} m wide, and {heights}": widest > MAX_RATIO * height,
        f"no gap is larger than {widest:g} m, and {heights}": widest < MIN_RATIO * height,
    }
    return next((f"{reason}: {ADVICE}" for reason, applies in reasons.items() if applies), None)


def advise_on_units(file: str | Path, height: float, spacing: Range, thickness: Range) -> None:
    """Warn of lengths in a file that were probably given in another unit, as `unit_hint`.

    The warning is a WrongUnit for implausible sizes of dominoes and for gaps of more than ten
    heights, else an Advice, as gaps a little out of reach or almost closed may be intended.
    """
    hint = unit_hint(height, spacing, thickness)
    if hint is not None:
        least = max(thickness[0], spacing[0])
        plausible = MIN_HEIGHT <= height <= MAX_HEIGHT and least <= MAX_RATIO * height
        category = Advice if plausible and thickness[1] >= MIN_RATIO * height else WrongUnit
        advise(f"{one_line(str(file), 160, keep_end=True)}: {hint}", category, stacklevel=4)
