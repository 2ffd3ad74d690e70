"""Toppling-domino chains: exact simulation of chains in which every domino may differ.

    import domino_env as de

    layout = de.Layout.uniform(100, pitch=0.024, thickness=0.0075)
    wave = de.simulate(layout, de.Physics(friction=0.25, push=8.0))

    env = gymnasium.make("DominoChain-v1", scene="sprint")

Names load when they are first used.  All that importing the package does is to register the
environments with Gymnasium.
"""

import sys

import lazy_loader

from domino_env.core.results import register as register_drawings

__version__ = "0.4.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

register_drawings(
    {"layout": "domino_env.view.figures:plot_layout", "wave": "domino_env.view.figures:plot_wave"}
)
if "_domino_command" not in sys.modules:  # which needs none, and starts faster without
    from domino_env.envs import register

    register()
