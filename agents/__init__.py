"""Builders that learn: reinforcement-learning baselines on the scenes of `domino_env`.

This package holds no agent yet; the scenes, the score and the search that agents are judged by are
in `domino_env` and `optimize`.
"""
