"""Write race.gif and draw.gif, or ten-lines.gif: python docs/films.py [MODEL].

The race is that of race.scene.toml, whose layout race.csv is the result of `domino optimize
docs/race.scene.toml --budget 6000`. The other films are episodes: of the rule on the scene "draw",
in the order whose gain is the nearest to the mean, and of a MODEL on "sprint", the ppo-sprint.zip
that `examples/reinforcement_learning_in_ten_lines.py` writes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from agents.draw import rule, shipped_references
from agents.rollout import evaluation_seeds
from domino_env import DominoChain, Layout, load_scene
from domino_env.core.colours import UNIFORM
from domino_env.core.types import Floats
from domino_env.physics.motion import stack_leans
from domino_env.scenes.io.reading import read_layout
from domino_env.view.animation import STRIP_HEIGHT, frames, write_gif
from domino_env.view.compared import ComparedLayout
from domino_env.view.drawing import (
    BACKGROUND,
    FALLEN_COLOUR,
    INK,
    LEADER_COLOUR,
    PALE,
    ZOOM,
    Scale,
    draw_hand,
    draw_strip,
    font,
    left_end,
    stack_strips,
)

HERE = Path(__file__).parent
WIDTH, GAPS_HEIGHT = 840, 120  # [px] of a film, and of its panel of gaps
RACE_RATE, SLOW = 16.0, 4.0  # images per second, and time factor
RATE = 4.0  # dominoes per second


def race() -> Iterator[Image.Image]:
    """Yield the frames of the race, with the gaps below."""
    scene = load_scene(HERE / "race.scene.toml")
    best, equal = read_layout(HERE / "race.csv", scene), scene.uniform().layout
    row = scene.row(best)
    compared = [
        ComparedLayout("better gaps", scene.simulate(best)),
        ComparedLayout("equal gaps", scene.simulate(equal), colour=UNIFORM),
    ]
    gain = scene.score(compared[0].wave) / scene.uniform().score - 1.0
    heading = (
        f"Sixty dominoes, then the same forty: {gain:.1%} faster over {1e3 * row.length:.0f} mm"
    )
    scale = Scale.fitting(row.length, scene.height, WIDTH, STRIP_HEIGHT)
    designed, highest = best.count - 1, best.spacing.max()
    gaps = draw_gaps(row, equal.spacing[0], scale, "better gaps", highest, designed=designed)
    for image in frames(compared, RACE_RATE, SLOW, WIDTH, heading):
        yield stack_strips([image, gaps])


def play(
    env: DominoChain, act: Callable[[Any], Any], seed: int
) -> tuple[dict[str, Any], list[Floats]]:
    """Return the last info of an episode, and the pieces in hand before each step."""
    over, hands = False, []
    observation, _ = env.reset(seed=seed)
    while not over:
        hands.append(env.snapshot().hand)
        observation, _, over, _, info = env.step(act(observation))
    return info, hands


def typical_seed(name: str, act: Callable[[Any], Any]) -> int:
    """Return the evaluation seed of the episode whose score is the nearest to the mean."""
    env, seeds = DominoChain(load_scene(name)), evaluation_seeds(load_scene(name))
    scores = np.array([play(env, act, seed)[0]["score"] for seed in seeds])
    return int(seeds[np.abs(scores - scores.mean()).argmin()])


def episode(name: str, act: Callable[[Any], Any], seed: int = 0) -> Iterator[Image.Image]:
    """Yield the frames of an episode in a scene, one for each domino that is placed."""
    scene = load_scene(name)
    info, hands = play(DominoChain(scene), act, seed)
    equal = float(scene.uniform().layout.spacing[0])
    text = f"{info['score']:.3f} m/s, {info['gain']:+.1%} over equal gaps"
    return placements(info["layout"], equal, text, WIDTH, hands if scene.hand else ())


def act_of(model: Any) -> Callable[[Any], Any]:
    """Return the policy of a model of Stable-Baselines3."""
    return lambda observation: model.predict(observation, deterministic=True)[0]


def placements(
    layout: Layout, equal: float, ending: str, width: int = WIDTH, hands: Sequence[Floats] = ()
) -> Iterator[Image.Image]:
    """Draw a chain on flat ground as an environment places it, an image for each domino.

    The latest domino placed stands ahead of the leading one, which has just been hit. Its gap is
    marked in the panel below.

    Parameters
    ----------
    layout
        The layout.
    equal
        Gap of the uniform baseline [m], drawn as a line.
    ending
        Text of the last image.
    width
        Width of an image [px].
    hands
        Thicknesses of the pieces in hand before each step [m]; empty for none.

    Yields
    ------
    Image
        Next image.
    """
    highest, tall = max(equal, float(layout.spacing.max())), float(layout.height.max())
    scale = Scale.fitting(float(layout.length), tall, width, STRIP_HEIGHT)
    for n in range(layout.count):
        last = min(n + 1, layout.count - 1)
        placed = Layout(
            layout.spacing[:last], layout.thickness[: last + 1], layout.height[: last + 1]
        )
        leans = stack_leans(placed, np.array([n]), np.zeros(1))[0]
        text = f"domino {last + 1} of {layout.count}: gap {1e3 * layout.spacing[last - 1]:.1f} mm"
        strip = draw_strip(placed, leans, n, scale, text if last > n else ending, 1.0)
        if len(hands) and last > n:
            draw_hand(strip, hands[n], tall, scale, float(layout.thickness[last]))
        latest = last - 1 if last > n else -1
        gaps = draw_gaps(placed, equal, scale, "gaps", highest, latest)
        yield stack_strips([strip, gaps])


def draw_gaps(
    layout: Layout,
    equal: float,
    scale: Scale,
    name: str,
    highest: float,
    latest: int = -1,
    designed: int | None = None,
) -> Image.Image:
    """Draw the gaps of a layout at their places, as a panel below a strip that does not move.

    Parameters
    ----------
    layout
        The layout.
    equal
        Gap of the uniform baseline [m], drawn as a line.
    scale
        Scale of the strip.
    name
        Name of the layout in the legend.
    highest
        Largest gap of all panels of an animation [m].
    latest
        Index of a gap that is drawn larger; -1 for none.
    designed
        Number of gaps beside which the line of the uniform baseline is drawn; None for the width.

    Returns
    -------
    Image
        Image of the width of the strip.
    """
    w, h, k = scale.width * ZOOM, GAPS_HEIGHT * ZOOM, scale.pixels * ZOOM
    image = Image.new("RGB", (w, h), BACKGROUND)
    draw = ImageDraw.Draw(image)
    base, rise = h - 14 * ZOOM, (h - 48 * ZOOM) / highest  # [px], [px/m]
    levels = np.arange(0.0, highest, 0.02 if highest > 0.03 else 0.01)  # of the grid [m]
    for level in levels:
        draw.line([(0, base - level * rise), (w, base - level * rise)], fill=PALE)
    x = left_end(layout, scale) * ZOOM + layout.positions * k
    ends = (0.0, w) if designed is None else (float(x[0]), float(x[designed]))
    draw.line([(end, base - equal * rise) for end in ends], fill=INK, width=ZOOM)
    heights = base - layout.spacing * rise
    points = [(float(a), float(b)) for a, b in zip(0.5 * (x[:-1] + x[1:]), heights, strict=True)]
    draw.line(points, fill=FALLEN_COLOUR, width=ZOOM, joint="curve")
    for i, point in enumerate(points):
        r, colour = (5, LEADER_COLOUR) if i == latest else (2.5, FALLEN_COLOUR)
        draw.circle(point, r * ZOOM, fill=colour)
    image = image.resize((scale.width, GAPS_HEIGHT), Image.Resampling.LANCZOS)
    draw = ImageDraw.Draw(image)
    draw.text((20, 6), name, fill=FALLEN_COLOUR, font=font(15))
    draw.text((20 + draw.textlength(name + "   ", font(15)), 6), "equal gaps", INK, font(15))
    for level in levels:
        place = scale.width - 6, (base - level * rise) / ZOOM - 2
        draw.text(place, f"{1e3 * level:g} mm", fill=INK, font=font(13), anchor="rs")
    return image


def main() -> None:
    """Write the films of docs/, or that of a model."""
    films: dict[str, tuple[Iterator[Image.Image], float]] = {}
    if sys.argv[1:]:
        from stable_baselines3 import PPO

        model = PPO.load(sys.argv[1], device="cpu")
        films["ten-lines"] = episode("sprint", act_of(model)), RATE
    else:
        policy = rule(load_scene("draw"), shipped_references()["rule"])
        films["race"] = race(), RACE_RATE
        films["draw"] = episode("draw", policy, typical_seed("draw", policy)), RATE
    for name, (images, rate) in films.items():
        write_gif(images, HERE / f"{name}.gif", rate)


if __name__ == "__main__":
    main()
