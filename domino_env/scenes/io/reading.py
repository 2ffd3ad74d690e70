"""Scenes read from TOML files, by name, by path or beside a layout."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from domino_env.core.files import naming, one_line, read_bytes, refuse
from domino_env.core.progress import advise
from domino_env.physics.layout import Layout
from domino_env.physics.standard import WIDTH, unit_hint
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.scene import Scene

SHIPPED = resources.files("domino_env.scenes") / "shipped"
DISTRIBUTIONS = resources.files("domino_env.scenes") / "distributions"
IS_DISTRIBUTION = (
    "it gives ranges where a scene has numbers: load it by load_distribution, and draw scenes by "
    "its sample()"
)


def scene_names() -> list[str]:
    """List the names of the scenes that ship."""
    return _names_in(SHIPPED)


def distribution_names() -> list[str]:
    """List the names of the distributions of scenes that ship."""
    return _names_in(DISTRIBUTIONS)


def _names_in(folder: Traversable) -> list[str]:
    files = folder.iterdir()
    return sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml"))


def load_scene(name: str | Path) -> Scene:
    """Load a scene that ships, by name, or one of your own, by the path of its TOML file.

    Raises
    ------
    ValueError
        With file, key, value and what is allowed; for a file that gives ranges, which
        `load_distribution` reads.
    """
    if str(name) in distribution_names():
        refuse(str(name), IS_DISTRIBUTION)
    return scene_of_document(*read_named(name, "scene"))


def read_named(name: str | Path, kind: str) -> tuple[dict[str, Any], str, str]:
    """Read a file as TOML, by the name of what ships or by its path.

    Parameters
    ----------
    name
        Of what ships, or a path.
    kind
        What it is: "scene" or "distribution".

    Returns
    -------
    tuple
        The document, what it is called unless it says so itself, and what errors call the file.

    Raises
    ------
    ValueError
        For a file that there is not, or that cannot be read.
    """
    folder = SHIPPED if kind == "scene" else DISTRIBUTIONS
    path, known = Path(name), _names_in(folder)
    if str(name) in known:
        text = (folder / f"{name}.toml").read_text("utf-8")
        return document_of_text(text, f"{name}.toml"), str(name), f"{name}.toml"
    if not (path.suffix == ".toml" or path.is_file()):
        near = difflib.get_close_matches(str(name)[:300], known, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise ValueError(
            f"there is no {kind} '{one_line(str(name), 100)}': {hint}{kind}s that ship: "
            f"{', '.join(known)}; or give the path of a .toml file"
        )
    if not path.is_file():
        refuse(path, f"there is no such {kind} file")
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        refuse(path, "not UTF-8 text; save the file as UTF-8")
    return document_of_text(text, str(path)), path.stem, str(path)


def parse_scene(text: str, name: str, file: str) -> Scene:
    """Read a scene from the text of its file.

    Parameters
    ----------
    text
        TOML.
    name
        What the scene is called unless the text says it.
    file
        What errors call the text.

    Raises
    ------
    ValueError
        With file, key, value and what is allowed.
    """
    return scene_of_document(document_of_text(text, file), name, file)


def document_of_text(text: str, file: str) -> dict[str, Any]:
    """Read the text of a file as TOML; ValueError with the file's name for what is none."""
    with naming(file):
        try:
            return tomllib.loads(text)
        except RecursionError:
            raise ValueError("not TOML: nested too deep") from None
        except ValueError as error:
            raise ValueError(f"not TOML: {error}") from None


def scene_of_document(document: dict[str, Any], name: str, file: str) -> Scene:
    """Read a scene from what `tomllib` makes of the text of its file; see `parse_scene`."""
    with naming(file):
        if has_ranges(document):
            raise ValueError(IS_DISTRIBUTION)
        scene = Scene.of_document({"name": name} | document)
        slip = unit_hint(scene.height, scene.spacing, scene.thickness)
        if slip is not None and not scene.in_heights:
            advise(f"{one_line(file, 160, keep_end=True)}: {slip}")
        return scene


SCENE = "scene.toml"


def scene_beside(path: str | Path) -> Scene | None:
    """Load the scene.toml in a run's folder, or beside a layout's file; None where there is none.

    Raises
    ------
    ValueError
        As `load_scene`.
    """
    folder = Path(path)
    file = (folder if folder.is_dir() else folder.parent) / SCENE
    return load_scene(file) if file.is_file() else None


def common_scene(paths: Sequence[str | Path]) -> Scene | None:
    """Load the scene of rows that are shown together; those that lie beside none take it too.

    Parameters
    ----------
    paths
        Folders of runs and files of layouts.

    Raises
    ------
    ValueError
        For rows of different scenes, and as `load_scene`.
    """
    common: tuple[str | Path, Scene] | None = None
    for path in paths:
        scene = scene_beside(path)
        if scene is None:
            continue
        if common is not None and scene != common[1]:
            one, other = (one_line(str(name), 160, keep_end=True) for name in (common[0], path))
            raise ValueError(
                f"{one} and {other} lie beside different scenes ('{common[1].name}' and "
                f"'{scene.name}'): race one scene, or say by --scene which is meant"
            )
        common = common or (path, scene)
    return common and common[1]


def read_layout(path: str | Path, scene: Scene | None) -> Layout:
    """Read a layout; what its file does not say of width and ground is as in the scene."""
    row = Layout.read(path, WIDTH if scene is None else scene.width)
    if scene is None or scene.ground is None or not row.is_flat:
        return row
    with naming(path):
        return scene.ground.layout(row.spacing, row.thickness, row.height, row.width, row.density)
