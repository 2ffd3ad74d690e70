"""Limits: how much of a stranger's file is believed before memory and time are spent on it.

Each has a default far above ordinary use and a variable of the environment that sets another, for
this program and every worker that it starts: DOMINO_LAYOUT_DOMINOES=5000000 domino simulate …
docs/limits.md lists them.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

SMALLEST, LARGEST = 1e-9, 1e9  # of every size in a file, SI; products of four still have digits
TALLEST = 1e30  # [m] that a domino of a growing row may become


@dataclass(frozen=True)
class Limit:
    """The most of something that is accepted.

    variable: of the environment, that says another number.  default: without it.
    unit: what is counted.  reason: what the number rests on.
    """

    variable: str
    default: int
    unit: str
    reason: str

    @property
    def most(self) -> int:
        """The number that holds now.  ValueError where the variable holds none."""
        told = os.environ.get(self.variable, "").strip()
        if not told:
            return self.default
        if not (told.isascii() and told.isdigit() and 0 < len(told) <= 18 and int(told)):
            raise ValueError(
                f"{self.variable} = {told[:40]!r}: give a whole number of {self.unit}, 1 or more"
            )
        return int(told)

    def require(self, number: int, what: str) -> None:
        """ValueError for more than that; what: how its sentence begins, as in "it has"."""
        if number > self.most:
            raise ValueError(
                f"{what} {_counted(number)} {self.unit}, where at most {_counted(self.most)} are "
                f"accepted; if the file is to be trusted, set {self.variable} to more"
            )


def _counted(number: int) -> str:
    return f"{number:,}" if number < 10**18 else "more than 10^18"


LAYOUT_BYTES = Limit(
    "DOMINO_LAYOUT_BYTES", 128 * 2**20, "bytes", "a million dominoes of their own take 105 MB"
)
LAYOUT_DOMINOES = Limit(
    "DOMINO_LAYOUT_DOMINOES", 1_000_000, "dominoes", "read in some seconds, within 1 GB of memory"
)
SCENE_BYTES = Limit(
    "DOMINO_SCENE_BYTES", 1_000_000, "bytes", "40 000 times of a schedule; read in a few seconds"
)
SCENE_DOMINOES = Limit(
    "DOMINO_SCENE_DOMINOES", 100_000, "dominoes", "the best uniform row takes some 3 ms a domino"
)
SCENE_KINDS = Limit(
    "DOMINO_SCENE_KINDS", 1_000, "kinds of dominoes", "each domino is compared with every kind"
)
SCENE_VALUES = Limit(
    "DOMINO_SCENE_VALUES", 100_000, "pairs of listed gaps and thicknesses", "each is tried once"
)
DRAWN_DOMINOES = Limit(
    "DOMINO_DRAWN_DOMINOES", 4_000_000, "dominoes in all draws", "some 200 MB when they topple"
)
RUN_BYTES = Limit(
    "DOMINO_RUN_BYTES", 16 * 2**20, "bytes", "settings, traces and checks of a run take kilobytes"
)
JOURNAL_BYTES = Limit(
    "DOMINO_JOURNAL_BYTES", 2**30, "bytes", "some ten minutes of gradients on two cores"
)
STORE_BYTES = Limit(
    "DOMINO_STORE_BYTES", 2**32, "bytes", "a million results of rows of 40; read as a whole"
)
SHOWN_DOMINOES = Limit(
    "DOMINO_SHOWN_DOMINOES", 5_000, "dominoes a row", "pictures need time by the square of a row"
)
FRAMES = Limit(
    "DOMINO_FRAMES", 5_000, "images", "at 25 images a second, more than three minutes; 1 GB"
)
SHEETS = Limit("DOMINO_SHEETS", 1_000, "sheets of paper", "of a row 270 m long")
SOUND_SAMPLES = Limit(
    "DOMINO_SOUND_SAMPLES", 30_000_000, "samples", "eleven minutes at 44.1 kHz; 1 GB to listen to"
)
SOUND_BYTES = Limit("DOMINO_SOUND_BYTES", 128 * 2**20, "bytes", "as many samples of 32 bits")
ENGINE_MOVES = Limit(
    "DOMINO_ENGINE_MOVES",
    1_000_000_000,
    "moves of a domino in the engine",
    "a row of 1 000 takes a third of that, and some minutes",
)
POLICY_BYTES = Limit(
    "DOMINO_POLICY_BYTES", 64 * 2**20, "bytes of weights", "two layers of 2 000; ours have 64"
)
ARRAYS_BYTES = Limit(
    "DOMINO_ARRAYS_BYTES", 256 * 2**20, "bytes of arrays", "a million examples of a family"
)
LEARNER_NUMBERS = Limit(
    "DOMINO_LEARNER_NUMBERS", 200_000_000, "numbers in a learner", "0.8 GB of observations"
)
CHECKPOINT_BYTES = Limit(
    "DOMINO_CHECKPOINT_BYTES", 2**30, "bytes", "a replay buffer of a million steps takes 0.3 GB"
)

ALL = (
    LAYOUT_BYTES, LAYOUT_DOMINOES, SCENE_BYTES, SCENE_DOMINOES, SCENE_KINDS, SCENE_VALUES,
    DRAWN_DOMINOES, RUN_BYTES, JOURNAL_BYTES, STORE_BYTES, SHOWN_DOMINOES, FRAMES, SHEETS,
    SOUND_SAMPLES, SOUND_BYTES, ENGINE_MOVES, POLICY_BYTES, ARRAYS_BYTES, LEARNER_NUMBERS,
    CHECKPOINT_BYTES,
)  # fmt: skip
