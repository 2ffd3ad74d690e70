"""Preset of the scene-conditioned policy: hyperparameters of its training, typed, in one place."""

from __future__ import annotations

from dataclasses import dataclass

LIMITS = (
    ("width", 1, 1024), ("depth", 0, 8), ("examples", 0, 10**6), ("evaluations", 1, 10**9),
    ("passes", 0, 10**6), ("together", 1, 10**4), ("batches", 0, 10**8), ("scenes", 1, 10**4),
    ("climbing", 2, 13),
)  # fmt: skip
"""Whole numbers, with the least and the most that is accepted."""


@dataclass(frozen=True)
class ConditionedPreset:
    """Hyperparameters of the training of a scene-conditioned policy.

    Attributes
    ----------
    width, depth
        Of the policy's hidden layers.
    examples, evaluations
        Scenes that search finds rows for, and its budget for each; 0 examples for learning from
        scratch.
    passes
        Over the examples, in batches of `together`.
    together
        Examples in a batch.
    batches, scenes
        Batches of fresh scenes for the exact gradient, and scenes in each; 0 for imitation alone.
    climbing
        Plans of a scene that climb: all but one the best, one by chance.
    rate, last_rate
        Learning rate of Adam, falling along half a cosine in each of the two stages.

    Raises
    ------
    ValueError
        For values beyond the limits that `LIMITS` sets, and rates that are not in (0, 1].
    """

    width: int = 96
    depth: int = 2
    examples: int = 1000
    evaluations: int = 600
    passes: int = 60
    together: int = 16
    batches: int = 1500
    scenes: int = 32
    climbing: int = 3
    rate: float = 3e-3
    last_rate: float = 3e-5

    def __post_init__(self) -> None:
        for name, low, high in LIMITS:
            value = getattr(self, name)
            if type(value) is not int or not low <= value <= high:
                raise ValueError(f"{name} = {value!r}: give a whole number from {low} to {high}")
        for name in ("rate", "last_rate"):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and 0.0 < value <= 1.0):
                raise ValueError(f"{name} = {value!r}: give a number above 0, at most 1")


FURTHER = ConditionedPreset(examples=0, batches=300, rate=2e-4, last_rate=1e-5)
"""Of a training that begins with weights that are good already."""
