"""The standard domino, and hints at lengths in another unit."""

from __future__ import annotations

HEIGHT, WIDTH, DENSITY = 0.048, 0.024, 1040.0  # [m], [m], [kg/m³]
THICKNESS = 0.0075  # [m]

TALLEST, SHORTEST = 10.0, 1e-3  # [m] far beyond what people build
MOST, LEAST = 10.0, 1e-3  # of a thickness or a gap over the height
ADVICE = (
    "lengths are in metres in Python and in files, 18 mm is 0.018; options and columns named …_mm "
    "are in millimetres, 18"
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
    if spacing[1] < LEAST * height:
        return f"no gap is larger than {spacing[1]:g} m, and {tall}: {ADVICE}"
    return None
