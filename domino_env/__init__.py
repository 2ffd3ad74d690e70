"""Toppling-domino chains: exact simulation of chains in which every domino may differ.

    import gymnasium

    import domino_env as de

    layout = de.Layout.uniform(100, pitch=0.024, thickness=0.0075)
    wave = de.simulate(layout, de.Physics(friction=0.25, push=8.0))

    env = gymnasium.make("DominoChain-v2", scene="sprint")

Names are imported when they are first used. Importing the package registers the functions that draw
results, and the environments with Gymnasium.
"""

import os

import lazy_loader

from domino_env.core.results import register as register_drawings

__version__ = "0.5.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

register_drawings({
    "layout": "domino_env.view.figures:plot_layout",
    "wave": "domino_env.view.figures:plot_wave",
    "measurement": "domino_env.validation.measurement_figure:plot",
})  # fmt: skip
# the `domino` command sets this variable while it imports the package: it uses no registered
# environments, and starts faster without Gymnasium
if "DOMINO_COMMAND" not in os.environ:
    from domino_env.envs import register

    register()
