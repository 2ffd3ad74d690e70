"""Objectives of scenes, one class each."""

from domino_env.scenes.objectives.base import Objective, ScoreGradient, Scores
from domino_env.scenes.objectives.speed import MeanSpeed
from domino_env.scenes.objectives.tempo import InTempo
from domino_env.scenes.objectives.toppled import Magnify, Toppled

__all__ = ["OBJECTIVES", "Objective", "ScoreGradient", "Scores"]

OBJECTIVES: dict[str, type[Objective]] = {
    kind.name: kind for kind in (Magnify, MeanSpeed, InTempo, Toppled)
}
"""Classes of all objectives, by name."""
