"""Colours of all drawings."""

from __future__ import annotations

# greys, from dark to light
INK, SOFT, PALE, FAINT, SHADE = "#1d2126", "#5c636d", "#969ea8", "#dfe2e6", "#f1f3f5"
BLUE, RED, GREEN, PINK, AMBER, SKY = (
    "#0b6e99", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
)  # fmt: skip
RESULT, UNIFORM, BEST_KNOWN = BLUE, "#7c828c", RED

# Any two of these, or one of these and a grey, are 0.079 or more apart in the colour space OKLab,
# in which black and white are 1 apart.
COLOURS = (
    BLUE, RED, GREEN, PINK, AMBER, SKY, "#8b1a1a", "#500890", "#005000", "#a03098", "#70d050",
    "#8070f0", "#004070", "#887000", "#5848c0", "#98b088", "#600848", "#d03868", "#f088f8",
    "#187800", "#503000", "#f89890", "#c0a8d8",
)  # fmt: skip
