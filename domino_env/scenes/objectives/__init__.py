"""Objectives of scenes, one class each."""

from domino_env.scenes.objectives.base import Objective, ScoreGradient, Scores
from domino_env.scenes.objectives.magnify import Magnify
from domino_env.scenes.objectives.speed import MeanSpeed
from domino_env.scenes.objectives.tempo import InTempo

__all__ = ["OBJECTIVES", "Objective", "ScoreGradient", "Scores"]

OBJECTIVES: dict[str, type[Objective]] = {kind.name: kind for kind in (Magnify, MeanSpeed, InTempo)}
"""Classes of all objectives, by name."""
