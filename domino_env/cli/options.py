"""Options that several commands share.

A layout beside its scene (row.scene.toml beside row.csv, or the scene.toml of a run) is simulated
with the physics of that scene unless --scene names another.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from domino_env.core.files import require_writable

if TYPE_CHECKING:
    from domino_env.physics.layout import Layout
    from domino_env.physics.physics import Physics
    from domino_env.scenes.scene import Scene


Option = tuple[str, Callable[[str], object], str, object, str]
"""Name, reader of the value, placeholder in the help, default, and help without the default."""


def add_options(parser: Any, *options: Option) -> None:
    """Add options that take a value to a parser or a group of arguments."""
    for name, read, metavar, default, text in options:
        if default is not None:
            text += f" ({default:g})" if isinstance(default, float) else f" ({default})"
        parser.add_argument(f"--{name}", type=read, metavar=metavar, default=default, help=text)


def add_flags(parser: Any, **texts: str) -> None:
    """Add options without a value, each given as name=help, with _ for - in the name."""
    for name, text in texts.items():
        parser.add_argument(f"--{name.replace('_', '-')}", action="store_true", help=text)


def _check(value: Any, check: Callable[..., None], *arguments: Any, **options: Any) -> Any:
    """Return a value that passes a check.

    A ValueError becomes an ArgumentTypeError, as argparse replaces the message of the former.
    """
    try:
        check(*arguments, **options)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return value


def number(
    unit: str = "", hint: str = "", *, whole: bool = False, **bounds: float
) -> Callable[[str], Any]:
    """Return the reader of an option's number, with arguments of `core.checks.require`."""

    def read(text: str) -> Any:
        from domino_env.core.checks import require  # imports NumPy, which --help does not need

        try:
            value = int(text) if whole else float(text)
        except ValueError:
            kind = "whole number" if whole else "number"
            point = ", with a decimal point as in 0.25" * ("," in text)
            raise argparse.ArgumentTypeError(f"'{text}': give a {kind}{point}") from None
        return _check(value, require, "", value, unit=unit, hint=hint, whole=whole, **bounds)

    return read


# the bounds of lengths reject numbers in metres
SIZE = number("mm", "18 is 0.018 m", low=0.1, high=1e5)
DEVIATION = number("mm", "0.5 is 0.0005 m", low=0.01, high=1e4)
GRAVITY = number("m/s²", "9.81 on Earth", above=0.0, high=1000.0)
PUSH_NUMBER = number("rad/s", above=0.0, high=1000.0)
COEFFICIENT = number(hint="a coefficient of friction", low=0.0)
POSITIVE_COEFFICIENT = number(hint="a coefficient of friction", above=0.0)
SECONDS = number("s", above=0.0)
NATURAL, WHOLE = number(whole=True, low=1), number(whole=True, low=0)
RELEASED = "released"
SEED = ("seed", WHOLE, "N", 0, "seed of all randomness")


def push(text: str) -> float | str:
    """Read a push; 'released' is replaced by its number where the first domino is known."""
    return text if text == RELEASED else PUSH_NUMBER(text)


def released(physics: Physics, first: Scene | Layout) -> Physics:
    """Return physics with the push of a released domino: the first one of a scene or layout."""
    from domino_env.scenes import tables
    from domino_env.scenes.scene import Scene

    if isinstance(first, Scene):
        return tables.released(first.replace(physics=physics))
    return physics.replace(push=physics.released(first, gravity=physics.gravity).push)


def floor(text: str, read: Callable[[str], float] = COEFFICIENT) -> float:
    """Read the coefficient of friction of a floor; 'free', a free-standing chain, means 1."""
    return 1.0 if text == "free" else read(text)


def require_deviation(deviation: float, largest_gap: float) -> None:
    """Raise a ValueError for a deviation [mm] of more than half of the largest gap [mm]."""
    from domino_env.core.checks import require

    hint = "half of the largest gap"
    require("--deviation", deviation, high=0.5 * largest_gap, unit="mm", hint=hint)


def folder(name: str) -> Any:
    """Read the name of a folder to write to."""
    return _check(Path(name), require_writable, Path(name))


def output(*suffixes: str) -> Callable[[str], Any]:
    """Return the reader of an option that names a file to write."""
    return lambda name: _check(Path(name), require_output, Path(name), *suffixes)


def require_output(path: Path, *suffixes: str) -> None:
    """Raise a ValueError for a file that has another ending or cannot be written."""
    if path.suffix.lower() not in suffixes or path.is_dir():
        raise ValueError(f"{path}: name a {' or '.join(suffixes)} file")
    require_writable(path.parent)


def beside(layout: Path, suffix: str) -> Path:
    """Return the layout's file with another ending, for a link one in the present folder."""
    from domino_env.scenes.io.link import is_link
    from domino_env.scenes.io.reading import layout_name

    return Path(layout_name(layout) + suffix) if is_link(layout) else layout.with_suffix(suffix)


LAYOUT_FILE = output(".csv", ".json")


def add_layout(parser: argparse.ArgumentParser, name: str = "layout", **options: Any) -> None:
    """Add the argument LAYOUT, a file or several."""
    text = "layout file, .csv or .json, or link of the page"
    parser.add_argument(name, metavar="LAYOUT", type=Path, help=text, **options)


def add_physics_options(parser: argparse.ArgumentParser, *, uniform: bool = False) -> None:
    """Add --scene, --friction, --gravity and --push.

    `uniform` is True for commands that show the uniform baseline of the scene too.
    """
    baseline = ", and its uniform baseline" * uniform
    scene = f"physics of a scene, name or .toml file{baseline} (that beside LAYOUT, if any)"
    friction = "coefficient of friction between dominoes (of the scene, or 0.25)"
    gravity = "gravitational acceleration [m/s²] (of the scene, or 9.81)"
    pushed = "angular velocity of the first domino [rad/s], or 'released' (of the scene, or 8)"
    add_options(
        parser,
        ("scene", str, "SCENE", None, scene),
        ("friction", COEFFICIENT, "MU", None, friction),
        ("gravity", GRAVITY, "M/S2", None, gravity),
        ("push", push, "RAD/S", None, pushed),
    )


def add_out_option(parser: argparse.ArgumentParser, default: str, *, literal: bool = True) -> None:
    """Add --out FOLDER; a default that is not `literal` is a text for the help alone."""
    parser.add_argument(
        "-o", "--out", type=folder, metavar="FOLDER", default=default if literal else None,
        help=f"folder to write to ({default})",
    )  # fmt: skip


def print_json(document: object) -> None:
    """Print a document as JSON."""
    print(json.dumps(document, indent=1, allow_nan=False))


@dataclass(frozen=True)
class ChosenPhysics:
    """Physics of a command, and their source.

    Attributes
    ----------
    scene
        Scene that is named by --scene or lies beside the layout; None without either.
    physics
        Physics of the scene, or the defaults, with the values of the options.
    other_physics
        The physics if one of the options friction, gravity and push was given, else None; a scene
        gives no score to waves under other physics than its own.
    origin
        Source of the physics, as text.
    """

    scene: Scene | None
    physics: Physics
    other_physics: Physics | None
    origin: str

    @property
    def line(self) -> str:
        """Line with the physics and their source, to be printed with every result."""
        physics = self.physics
        return (
            f"physics: friction {physics.friction:g}, gravity {physics.gravity:g} m/s², "
            f"push {physics.push:g} rad/s ({self.origin})"
        )

    def read(self, path: str | Path) -> Layout:
        """Read a layout of the scene as `domino_env.scenes.io.reading.read_layout` does."""
        from domino_env.scenes.io.reading import read_layout

        return read_layout(path, self.scene)

    def row(self, layout: Layout) -> Layout:
        """Return a layout with the run-out of the scene, if it has one."""
        return layout if self.scene is None else self.scene.row(layout)


def chosen_physics(arguments: argparse.Namespace, *paths: str | Path) -> ChosenPhysics:
    """Return the physics for layouts that are shown together.

    Parameters
    ----------
    arguments
        Values of the options of `add_physics_options`.
    *paths
        Files of layouts, or run folders.

    Returns
    -------
    ChosenPhysics
        Physics of the scene or the defaults, changed by the options.

    Raises
    ------
    ValueError
        For a scene that cannot be read, and for layouts beside different scenes.
    """
    from domino_env.physics.physics import Physics
    from domino_env.scenes.io.reading import common_scene, load_scene, read_layout

    scene = load_scene(arguments.scene) if arguments.scene else common_scene(paths)
    given = {name: getattr(arguments, name) for name in ("friction", "gravity", "push")}
    given = {name: value for name, value in given.items() if value is not None}
    physics = (scene.physics if scene else Physics()).replace(
        **{name: value for name, value in given.items() if value != RELEASED}
    )
    if arguments.push == RELEASED:
        physics = released(physics, scene or read_layout(paths[0], None))
    origin = "defaults"
    if scene is not None:
        origin = f"of scene '{scene.name}'{'' if arguments.scene else ' beside the layout'}"
    if given:
        origin += f", but for {', '.join(f'--{name}' for name in given)}"
    return ChosenPhysics(scene, physics, physics if given else None, origin)
