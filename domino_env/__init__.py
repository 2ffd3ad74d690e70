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
from typing import TYPE_CHECKING

from domino_env.core.lazy import lazy_names

if TYPE_CHECKING:
    from domino_env.envs.chain_env import DominoChain, DominoChainVector
    from domino_env.envs.layout_env import DominoLayout, DominoLayoutVector
    from domino_env.envs.snapshot import Snapshot
    from domino_env.physics.forces import Diagnosis, diagnose
    from domino_env.physics.gradient import Gradient
    from domino_env.physics.ground import Ground
    from domino_env.physics.layout import Layout
    from domino_env.physics.motion import Motion
    from domino_env.physics.physics import Physics
    from domino_env.physics.steady import (
        SteadyWave,
        existence_limit,
        smallest_push,
        steady_wave,
        terminal_speed_estimate,
    )
    from domino_env.physics.wave import Outcome, Wave, WaveBatch, simulate, simulate_batch
    from domino_env.rigid.comparison import Verification, verify
    from domino_env.scenes.baseline import UniformMark
    from domino_env.scenes.distribution import SceneDistribution, load_distribution
    from domino_env.scenes.io.reading import distribution_names, load_scene, scene_names
    from domino_env.scenes.limits import Limits
    from domino_env.scenes.objectives.robust import Placement
    from domino_env.scenes.objectives.tempo import Tempo
    from domino_env.scenes.pool import load_test_set
    from domino_env.scenes.scene import Scene
    from domino_env.scenes.stock import Stock
    from domino_env.standing.simulation import RigidWave, simulate_standing
    from domino_env.validation.measured.fit import Fit, fit_friction
    from domino_env.view.sound import Heard, clicks, listen

__version__ = "0.3.0"

__all__ = [
    "Diagnosis",
    "DominoChain",
    "DominoChainVector",
    "DominoLayout",
    "DominoLayoutVector",
    "Fit",
    "Gradient",
    "Ground",
    "Heard",
    "Layout",
    "Limits",
    "Motion",
    "Outcome",
    "Physics",
    "Placement",
    "RigidWave",
    "Scene",
    "SceneDistribution",
    "Snapshot",
    "SteadyWave",
    "Stock",
    "Tempo",
    "UniformMark",
    "Verification",
    "Wave",
    "WaveBatch",
    "clicks",
    "diagnose",
    "distribution_names",
    "existence_limit",
    "fit_friction",
    "listen",
    "load_distribution",
    "load_scene",
    "load_test_set",
    "scene_names",
    "simulate",
    "simulate_batch",
    "simulate_standing",
    "smallest_push",
    "steady_wave",
    "terminal_speed_estimate",
    "verify",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "Diagnosis": "physics.forces",
        "diagnose": "physics.forces",
        "Gradient": "physics.gradient",
        "Ground": "physics.ground",
        "Layout": "physics.layout",
        "Motion": "physics.motion",
        "Physics": "physics.physics",
        "SteadyWave": "physics.steady",
        "existence_limit": "physics.steady",
        "smallest_push": "physics.steady",
        "steady_wave": "physics.steady",
        "terminal_speed_estimate": "physics.steady",
        "Outcome": "physics.wave",
        "Wave": "physics.wave",
        "WaveBatch": "physics.wave",
        "simulate": "physics.wave",
        "simulate_batch": "physics.wave",
        "DominoChain": "envs.chain_env",
        "DominoChainVector": "envs.chain_env",
        "DominoLayout": "envs.layout_env",
        "DominoLayoutVector": "envs.layout_env",
        "Snapshot": "envs.snapshot",
        "Fit": "validation.measured.fit",
        "fit_friction": "validation.measured.fit",
        "Verification": "rigid.comparison",
        "verify": "rigid.comparison",
        "SceneDistribution": "scenes.distribution",
        "load_distribution": "scenes.distribution",
        "load_test_set": "scenes.pool",
        "distribution_names": "scenes.io.reading",
        "load_scene": "scenes.io.reading",
        "scene_names": "scenes.io.reading",
        "Limits": "scenes.limits",
        "Placement": "scenes.objectives.robust",
        "Tempo": "scenes.objectives.tempo",
        "Scene": "scenes.scene",
        "UniformMark": "scenes.baseline",
        "Stock": "scenes.stock",
        "RigidWave": "standing.simulation",
        "simulate_standing": "standing.simulation",
        "Heard": "view.sound",
        "clicks": "view.sound",
        "listen": "view.sound",
    },
)


if "_domino_command" not in sys.modules:  # which has no use for them, and should not wait
    from domino_env.envs import register

    register()
