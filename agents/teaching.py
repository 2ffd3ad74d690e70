"""Teaching: how a designer for a family of scenes is taught, typed, in one place."""

from __future__ import annotations

from dataclasses import dataclass

EXAMPLES_SEED = 100  # that the scenes of the examples are drawn with, whatever the policy's seed


@dataclass(frozen=True)
class Teaching:
    """How a designer is taught.

    width, depth: of the policy's hidden layers.
    examples, evaluations: scenes that search finds rows for, and its budget for each; 0 examples
        for learning from scratch.
    passes: over the examples, in batches of `together`.
    batches, scenes: of fresh scenes on the exact slope, and scenes in each; 0 for imitation alone.
    climbing: plans of a scene that climb: all but one the best, one by chance.
    rate, last_rate: of Adam, falling along half a cosine in each of the two stages.
    """

    width: int = 96
    depth: int = 2
    examples: int = 1000
    evaluations: int = 600
    passes: int = 60
    together: int = 16
    batches: int = 3000
    scenes: int = 32
    climbing: int = 3
    rate: float = 3e-3
    last_rate: float = 3e-5
