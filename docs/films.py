"""Write race.gif and draw.gif: python docs/films.py.

The race is that of the scene "course". The other film is an episode of the rule on the scene
"draw".
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from PIL import Image

from agents.draw import rule, shipped_references
from agents.rollout import EVALUATION_SEEDS
from domino_env import DominoChain, load_scene
from domino_env.view.animation import STRIP_HEIGHT, frames, placements, write_gif
from domino_env.view.comparison import ComparedLayout
from domino_env.view.drawing import Scale, draw_gaps, stack_strips
from optimize.experiments.best_known import best_known

HERE = Path(__file__).parent
WIDTH = 840  # [px]
RACE_RATE, SLOW = 16.0, 4.0  # images per second, and time factor
RATE = 4.0  # dominoes per second


def race() -> Iterator[Image.Image]:
    """Yield the frames of the race, with the gaps below."""
    scene, best = load_scene("course"), best_known()["course"].layout
    equal = scene.uniform().layout
    compared = [
        ComparedLayout(name, scene.simulate(layout))
        for name, layout in (("best known gaps", best), ("equal gaps", equal))
    ]
    scale = Scale.fitting(best.length, scene.height, WIDTH, STRIP_HEIGHT)
    gaps = draw_gaps(best, equal.spacing[0], scale, "best known gaps", best.spacing.max())
    for image in frames(compared, RACE_RATE, SLOW, WIDTH, "Sixty dominoes over 1.2 m"):
        yield stack_strips([image, gaps])


def draw() -> Iterator[Image.Image]:
    """Yield the frames of an episode, one for each domino that is placed."""
    scene = load_scene("draw")
    env, policy = DominoChain(scene), rule(scene, shipped_references()["rule"])
    observation, _ = env.reset(seed=EVALUATION_SEEDS[0])
    over, hands = False, []
    while not over:
        hands.append(env.snapshot().hand)
        observation, _, over, _, info = env.step(policy(observation))
    equal = float(scene.uniform().layout.spacing[0])
    text = f"{info['score']:.3f} m/s, {info['gain']:+.1%} over equal gaps"
    return placements(info["layout"], equal, text, WIDTH, hands)


if __name__ == "__main__":
    for name, images, rate in (("race", race(), RACE_RATE), ("draw", draw(), RATE)):
        write_gif(images, HERE / f"{name}.gif", rate)
