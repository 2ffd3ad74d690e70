"""What is compiled, or loaded from the cache, before a clock starts."""

from __future__ import annotations

import numpy as np

from domino_env.scenes.scene import Scene


def compile_for(scene: Scene, *, gradients: bool = False, episodes: bool = False) -> None:
    """Compile what a scene needs, so that no time that is measured goes into it.

    That is: single waves and scores of a batch, as its objective and limits ask for them. The best
    uniform row, with which this is done, is found here where it is not known yet.

    Parameters
    ----------
    scene
        What will be searched, or built.
    gradients
        Scores with gradients too.
    episodes
        The steps of `DominoChain` too.
    """
    mark = scene.uniform().layout
    gaps, thickness = np.array(mark.spacing[None]), np.array(mark.thickness[None, 1:])
    height = None if scene.growth is None else np.array(mark.height[None, 1:])
    scene.evaluate(scene.batch(gaps, thickness, height))
    if gradients:
        scene.evaluate(scene.batch(gaps, thickness, height, rtol=1e-8), gradient=True)
    if episodes:
        from domino_env import DominoChain

        env = DominoChain(scene)
        env.reset()
        env.step(np.zeros(env.action_space.shape, np.float32))
