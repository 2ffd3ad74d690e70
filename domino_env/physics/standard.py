"""The standard domino, and hints at lengths in another unit."""

from __future__ import annotations

from pathlib import Path

from domino_env.core.files import one_line
from domino_env.core.progress import Advice, WrongUnit, advise

HEIGHT, WIDTH, DENSITY = 0.048, 0.024, 1040.0  # [m], [m], [kg/m³]
THICKNESS = 0.0075  # [m]

TALLEST, SHORTEST = 10.0, 1e-3  # [m] limits of plausible heights
MOST, LEAST = 10.0, 1e-3  # of a thickness or a gap over the height
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
    tall = f"the dominoes are {height:g} m tall"
    if not SHORTEST <= height <= TALLEST:
        return f"{tall}: {ADVICE}"
    if thickness[1] > MOST * height:
        return f"a domino is {thickness[1]:g} m thick, and {tall}: {ADVICE}"
    if thickness[1] < LEAST * height:
        return f"no domino is thicker than {thickness[1]:g} m, and {tall}: {ADVICE}"
    if spacing[0] >= height:
        return f"no gap is smaller than {spacing[0]:g} m, and {tall}: {ADVICE}"
    if spacing[1] > MOST * height:
        return f"a gap is {spacing[1]:g} m wide, and {tall}: {ADVICE}"
    if spacing[1] < LEAST * height:
        return f"no gap is larger than {spacing[1]:g} m, and {tall}: {ADVICE}"
    return None


def advise_on_units(file: str | Path, height: float, spacing: Range, thickness: Range) -> None:
    """Warn of lengths in a file that were probably given in another unit, as `unit_hint`.

    The warning is a WrongUnit for dominoes that nobody builds, and for gaps of many heights. Gaps
    a little out of reach, or almost closed, may be intended.
    """
    hint = unit_hint(height, spacing, thickness)
    if hint is not None:
        plausible = SHORTEST <= height <= TALLEST and max(thickness[0], spacing[0]) <= MOST * height
        category = Advice if plausible and thickness[1] >= LEAST * height else WrongUnit
        advise(f"{one_line(str(file), 160, keep_end=True)}: {hint}", category, stacklevel=4)
