"""Write draw.gif, an episode of the rule on the scene "draw": python docs/draw_picture.py."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from agents.draw import rule, shipped_references
from agents.rollout import EVALUATION_SEEDS
from domino_env import DominoChain, load_scene
from domino_env.view.animation import write_gif

RATE = 5.0  # dominoes per second
SIZE = 900, 150


def episode() -> Iterator[Image.Image]:
    """Yield the frames of an episode, one for each domino that is placed."""
    scene = load_scene("draw")
    env, policy = (
        DominoChain(scene, render_mode="rgb_array"),
        rule(scene, shipped_references()["rule"]),
    )
    observation, _ = env.reset(seed=EVALUATION_SEEDS[0])
    over = False
    while not over:
        yield Image.fromarray(env.render()).resize(SIZE, Image.Resampling.LANCZOS)
        observation, _, over, _, _ = env.step(policy(observation))
    yield Image.fromarray(env.render()).resize(SIZE, Image.Resampling.LANCZOS)


if __name__ == "__main__":
    write_gif(episode(), Path(__file__).with_name("draw.gif"), RATE)
