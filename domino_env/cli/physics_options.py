"""The options of all commands that topple a row: a scene's physics, and what is changed of it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from domino_env.chain.physics import Physics
    from domino_env.scenes.scene import Scene


def add_physics_options(parser: argparse.ArgumentParser, scene_help: str) -> None:
    """Add --scene, --friction, --gravity and --push."""
    parser.add_argument("--scene", help=scene_help)
    parser.add_argument("--friction", type=float, help="between dominoes (0.25)")
    parser.add_argument("--gravity", type=float, help="[m/s²] (9.81)")
    parser.add_argument("--push", type=float, help="angular velocity of the first [rad/s] (8)")


def given_physics(arguments: argparse.Namespace) -> dict[str, float]:
    """Return those of the three numbers that were given."""
    numbers = {name: getattr(arguments, name) for name in ("friction", "gravity", "push")}
    return {name: value for name, value in numbers.items() if value is not None}


def asked_physics(arguments: argparse.Namespace) -> tuple[Scene | None, Physics]:
    """Return the scene, if one was named, and its physics with what was given instead."""
    from dataclasses import replace

    from domino_env.chain.physics import Physics
    from domino_env.scenes.files.reading import load_scene

    scene = load_scene(arguments.scene) if arguments.scene else None
    return scene, replace(scene.physics if scene else Physics(), **given_physics(arguments))
