"""A scene as numbers between 0 and 1, and what they score."""

from __future__ import annotations

from optimize.problem.scores import Floats, Problem

__all__ = ["Floats", "Problem"]
