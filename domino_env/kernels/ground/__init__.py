"""Dominoes placed along curved ground, and the environments' step there."""

from domino_env.kernels.ground import episode, placing

__all__ = ["episode", "placing"]
