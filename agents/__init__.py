"""Agents: reinforcement learning on the scenes of `domino_env`.

    from agents import design, evaluate, train
    run = train("sprint", algorithm="ppo", steps=2_000_000, seed=0, folder="runs/ppo")
    evaluate(run.folder).score  # [m/s]
    design("sprint").layout  # for any scene, in milliseconds, by a shipped policy

Trained policies build layouts in the environment DominoChain-v2. All are evaluated by the score of
the scene, as searches are. Importing this package does not import torch; training needs the extra
"rl": `pip install -e ".[rl]"` in the folder of the project.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
