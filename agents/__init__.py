"""Builders that learn: reinforcement-learning baselines on the scenes of `domino_env`.

    from agents import train, evaluate
    run = train("sprint", algorithm="ppo", steps=2_000_000, seed=0, folder="runs/ppo")
    evaluate(run.folder).score
    design(scene).layout  # of a new scene, in milliseconds, by a policy that ships

They build with the environment DominoChain-v0; the scene's score counts, as in every search.
Importing this loads no torch; learning needs the extra: pip install "domino-chains[rl]".
"""

import lazy_loader

from domino_env.core.results import register as register_drawings

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
register_drawings({"training": "agents.picture:picture"})
