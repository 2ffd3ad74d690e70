"""The options of all commands that topple a row: a scene's physics, and what is changed of it.

A layout in a folder with a scene.toml, as a run's, was made for that scene: it is the scene that is
meant unless --scene names another.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from domino_env.physics.layout import Layout
    from domino_env.physics.physics import Physics
    from domino_env.scenes.scene import Scene

NUMBERS = ("friction", "gravity", "push")


def add_physics_options(parser: argparse.ArgumentParser, scene_help: str) -> None:
    """Add --scene, --friction, --gravity and --push."""
    parser.add_argument("--scene", help=f"{scene_help} (the scene.toml beside the layout)")
    parser.add_argument("--friction", type=float, help="between dominoes (the scene's, or 0.25)")
    parser.add_argument("--gravity", type=float, help="[m/s²] (the scene's, or 9.81)")
    parser.add_argument(
        "--push", type=float, help="angular velocity of the first [rad/s] (the scene's, or 8)"
    )


@dataclass(frozen=True)
class Asked:
    """What a row is to topple under.

    Attributes
    ----------
    scene
        The scene that was named, or that lies beside the row; None where neither is.
    physics
        Its physics, or the standard, with what was given instead.
    changed
        Names of the numbers that were given.
    beside
        Whether the scene was found beside the row.
    """

    scene: Scene | None
    physics: Physics
    changed: tuple[str, ...]
    beside: bool

    @property
    def origin(self) -> str:
        """Where the physics come from, in words."""
        said = "the standard"
        if self.scene is not None:
            said = f"of scene '{self.scene.name}'{' beside the layout' if self.beside else ''}"
        if self.changed:
            said += f", but for {', '.join(f'--{name}' for name in self.changed)}"
        return said

    @property
    def line(self) -> str:
        """The physics and where they come from, a line to print with every result."""
        physics = self.physics
        return (
            f"physics: friction {physics.friction:g}, gravity {physics.gravity:g} m/s², "
            f"push {physics.push:g} rad/s ({self.origin})"
        )

    def read(self, path: str | Path) -> Layout:
        """Read a layout of the scene, see `domino_env.scenes.io.reading.read_layout`."""
        from domino_env.scenes.io.reading import read_layout

        return read_layout(path, self.scene)


def asked_physics(arguments: argparse.Namespace, *paths: str | Path) -> Asked:
    """Return what rows that are shown together are to topple under.

    Parameters
    ----------
    arguments
        What `add_physics_options` has read.
    paths
        Files of layouts, or folders of runs.

    Raises
    ------
    ValueError
        For a scene that cannot be read, and for rows that lie beside different ones.
    """
    from domino_env.physics.physics import Physics
    from domino_env.scenes.io.reading import common_scene, load_scene

    scene = load_scene(arguments.scene) if arguments.scene else common_scene(paths)
    given = {name: getattr(arguments, name) for name in NUMBERS}
    given = {name: value for name, value in given.items() if value is not None}
    physics = (scene.physics if scene else Physics()).replace(**given)
    return Asked(scene, physics, tuple(given), beside=not arguments.scene)
