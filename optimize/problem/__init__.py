"""A scene as numbers between 0 and 1, and what they score."""

from __future__ import annotations

from optimize.problem.scores import STEP_RTOL, Problem
from optimize.problem.variables import Floats

__all__ = ["STEP_RTOL", "Floats", "Problem"]
