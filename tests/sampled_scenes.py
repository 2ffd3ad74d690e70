"""A distribution of small scenes in which most numbers vary."""

import tomllib

import domino_env as de

TEXT = """
[physics]
friction = {min = 0.0, max = 0.4}
push = {min = 0.5, max = 1.2, spread = "log", of = "height"}
gravity = {min = 1.6, max = 9.81}
[row]
count = {min = 4, max = 9}
height = {min = 0.03, max = 0.06}
first_thickness = 0.007
[spacing]
min = {min = 0.05, max = 0.2, spread = "log", of = "height"}
max = {min = 0.3, max = 0.9, of = "height", min_ratio = 2}
[thickness]
min = 0.005
max = {min = 0.006, max = 0.012}
"""


def small_scenes(more: str = "") -> de.SceneDistribution:
    """Return a distribution of 4 to 9 dominoes with free gaps and thicknesses and any gravity.

    Other tables can be added to its text.
    """
    return de.SceneDistribution(tomllib.loads(TEXT + more), "small")
