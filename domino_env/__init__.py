"""Toppling-domino chains: exact simulation of rows in which every domino may differ.

    import domino_env as de

    layout = de.Layout.uniform(100, pitch=0.024, thickness=0.0075)
    wave = de.simulate(layout, de.Physics(friction=0.25, push=8.0))

    env = gymnasium.make("DominoChain-v0", scene="sprint")

Names load when they are first used.  All that importing the package does is to register the
environments with Gymnasium.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from domino_env.chain.forces import Diagnosis, diagnose
    from domino_env.chain.gradient import Gradient
    from domino_env.chain.layout import Layout
    from domino_env.chain.physics import Physics
    from domino_env.chain.steady import (
        SteadyWave,
        existence_limit,
        smallest_push,
        steady_wave,
        terminal_speed_estimate,
    )
    from domino_env.chain.wave import Outcome, Wave, WaveBatch, simulate, simulate_batch
    from domino_env.envs.chain_env import DominoChain
    from domino_env.envs.layout_env import DominoLayout
    from domino_env.envs.vector_env import DominoChainVector
    from domino_env.scenes.files import load_scene, scene_names
    from domino_env.scenes.scene import Scene, UniformMark

__version__ = "0.1.0"

_HOMES = {
    "DominoChain": "envs.chain_env",
    "DominoChainVector": "envs.vector_env",
    "DominoLayout": "envs.layout_env",
    "Layout": "chain.layout",
    "Physics": "chain.physics",
    "Gradient": "chain.gradient",
    "Outcome": "chain.wave",
    "Wave": "chain.wave",
    "WaveBatch": "chain.wave",
    "simulate": "chain.wave",
    "simulate_batch": "chain.wave",
    "Scene": "scenes.scene",
    "Diagnosis": "chain.forces",
    "diagnose": "chain.forces",
    "SteadyWave": "chain.steady",
    "existence_limit": "chain.steady",
    "smallest_push": "chain.steady",
    "steady_wave": "chain.steady",
    "terminal_speed_estimate": "chain.steady",
    "UniformMark": "scenes.scene",
    "load_scene": "scenes.files",
    "scene_names": "scenes.files",
}

__all__ = [
    "Diagnosis",
    "DominoChain",
    "DominoChainVector",
    "DominoLayout",
    "Gradient",
    "Layout",
    "Outcome",
    "Physics",
    "Scene",
    "SteadyWave",
    "UniformMark",
    "Wave",
    "WaveBatch",
    "diagnose",
    "existence_limit",
    "load_scene",
    "scene_names",
    "simulate",
    "simulate_batch",
    "smallest_push",
    "steady_wave",
    "terminal_speed_estimate",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'domino_env' has no attribute '{name}'")
    value = getattr(import_module(f"domino_env.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])


if "_domino_command" not in sys.modules:  # which has no use for them, and should not wait
    from domino_env.envs import register

    register()
