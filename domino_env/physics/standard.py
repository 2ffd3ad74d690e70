"""Standard domino, and hints at lengths in another unit."""

from __future__ import annotations

from pathlib import Path

from domino_env.core.files import LONGEST_PATH, one_line
from domino_env.core.progress import Advice, WrongUnit, advise

HEIGHT, WIDTH, DENSITY = 0.048, 0.024, 1040.0  # [m], [m], [kg/m³]
THICKNESS = 0.0075  # [m]

# plausible range of heights [m], and of the ratio of a thickness or a gap to the height
MAX_HEIGHT, MIN_HEIGHT = 10.0, 1e-3
MAX_RATIO, MIN_RATIO = 10.0, 1e-3
ADVICE = (
    "lengths are in metres in Python and in files, 18 mm is 0.018; columns named …_mm, such as "
    "spacing_mm, and options are in millimetres"
)

Range = tuple[float, float]  # smallest and largest [m]


def unit_hint(height: float, spacing: Range, thickness: Range) -> str | None:
    """Return a hint at a length that was probably given in another unit.

    Parameters
    ----------
    height
        Height of the tallest domino [m].
    spacing
        Narrowest and widest gap [m].
    thickness
        Smallest and largest thickness [m].

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
    """Warn of lengths in a file that were probably given in another unit; see `unit_hint`.

    The warning is a WrongUnit if the height or all thicknesses are implausible, or if all gaps are
    wider than ten heights. Otherwise it is an Advice, as one extreme size, and gaps a little out of
    reach or very narrow, may be intended.
    """
    hint = unit_hint(height, spacing, thickness)
    if hint is not None:
        smallest = max(thickness[0], spacing[0])
        plausible = MIN_HEIGHT <= height <= MAX_HEIGHT and smallest <= MAX_RATIO * height
        category = Advice if plausible and thickness[1] >= MIN_RATIO * height else WrongUnit
        # 4: the warning is that of the caller of `Layout.read`
        advise(f"{one_line(str(file), LONGEST_PATH, keep_end=True)}: {hint}", category, 4)
