"""Layouts that are shown together, read from files, run folders and links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from domino_env.core import colours
from domino_env.core.files import one_line
from domino_env.core.progress import notice
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Wave, simulate
from domino_env.scenes.io.link import is_link
from domino_env.scenes.io.reading import common_scene, layout_name, read_layout
from domino_env.scenes.scene import Scene

MAX_DOMINOES = 5_000  # of a chain that can be drawn
MAX_NAME = 100  # characters of a layout's name


@dataclass(frozen=True)
class ComparedLayout:
    """Layout that is shown with others, and its wave.

    Attributes
    ----------
    name
        Label of the layout.
    wave
        Wave of the layout, with the run-out of its scene.
    layout
        The layout without the run-out; None for that of the wave.
    scene
        Scene whose rules the layout keeps; None without one.
    score
        Score in the scene; None without a scene, and under other physics than its own.
    folder
        Run folder of the layout; None without one.
    colour
        Colour of its fallen dominoes.
    """

    name: str
    wave: Wave
    layout: Layout | None = None
    scene: Scene | None = None
    score: float | None = None
    folder: Path | None = None
    colour: str = colours.RESULT


def read_compared(
    paths: Sequence[Path], scene: Scene | None = None, physics: Physics | None = None
) -> list[ComparedLayout]:
    """Read layouts from files, run folders and links, and simulate them.

    If there is a scene, and a layout has as many dominoes, its uniform baseline is the last entry.
    A notice gives the reason if a layout breaks the rules of the scene.

    Parameters
    ----------
    paths
        Layout files, run folders and links of the page.
    scene
        Scene of all layouts; None for the one in the folders, or beside the files.
    physics
        Physics instead of those of the scene; scores are then left out. None for those of the
        scene, or without a scene the defaults of `Physics`.

    Returns
    -------
    list of ComparedLayout
        Layouts with their waves.

    Raises
    ------
    ValueError
        For a folder without a layout.csv, runs of different scenes, a file with wrong content, and
        a chain of more than 5 000 dominoes.
    """
    scene = scene or common_scene(paths)
    has_scores = scene is not None and physics is None  # other physics are another problem
    physics = physics or (scene.physics if scene else Physics())
    compared, has_baseline = [], False
    for path in paths:
        folder = path if not is_link(path) and path.is_dir() else None
        layout = read_layout(path, scene)
        require_drawable(one_line(str(path)), layout.count)
        name = one_line(path.resolve().name, MAX_NAME) if folder else layout_name(path)
        wave = simulate(scene.row(layout) if scene else layout, physics)
        fitting, score = scene, None
        if scene and (violations := scene.violations(layout)):
            notice(f"{one_line(str(path))}: not a layout of scene '{scene.name}': {violations[0]}")
            fitting = None
        elif scene and has_scores:
            score = scene.score(wave)
        compared.append(ComparedLayout(name, wave, layout, fitting, score, folder))
        has_baseline |= scene is not None and layout.count == scene.count
    if scene and has_baseline:
        baseline, name = scene.uniform(), "uniform baseline"
        wave = baseline.wave if has_scores else simulate(scene.row(baseline.layout), physics)
        score = baseline.score if has_scores else None
        grey = colours.UNIFORM
        compared.append(ComparedLayout(name, wave, baseline.layout, scene, score, colour=grey))
    return compared


def require_drawable(name: str, count: int) -> None:
    """Raise an error for a chain with too many dominoes to draw.

    Parameters
    ----------
    name
        Name of the chain, the first word of the message.
    count
        Number of its dominoes.

    Raises
    ------
    ValueError
        For more than 5 000 dominoes.
    """
    if count > MAX_DOMINOES:
        raise ValueError(f"{name}: {count:,} dominoes: give at most {MAX_DOMINOES:,} to draw")
