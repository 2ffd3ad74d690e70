"""Scenes read from TOML files, by name, by path or beside a layout, and layouts of scenes."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from domino_env.core.checks import require_type
from domino_env.core.files import (
    errors_with_path,
    one_line,
    raise_with_path,
    read_bytes,
    write_text,
)
from domino_env.core.progress import notice
from domino_env.physics.layout import Layout
from domino_env.physics.standard import WIDTH, advise_on_units
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.scene import Scene

SHIPPED = resources.files("domino_env.scenes") / "shipped"
DISTRIBUTIONS = resources.files("domino_env.scenes") / "distributions"
SCENE = "scene.toml"


def scene_names() -> list[str]:
    """Return the names of the shipped scenes."""
    return _names_in(SHIPPED)


def distribution_names() -> list[str]:
    """Return the names of the shipped scene distributions."""
    return _names_in(DISTRIBUTIONS)


def _names_in(folder: Traversable) -> list[str]:
    files = folder.iterdir()
    return sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml"))


def load_scene(name: str | Path) -> Scene:
    """Load a scene.

    Parameters
    ----------
    name
        Name of a shipped scene, or path of a TOML file.

    Raises
    ------
    TypeError
        For anything but a string or a path.
    ValueError
        With file, key, value and accepted range; for a file with ranges, which
        `load_distribution` reads.

    Examples
    --------
    >>> import domino_env as de
    >>> de.load_scene("sprint").count
    40
    """
    return scene_from_document(*read_named(name))


def read_named(name: str | Path) -> tuple[dict[str, Any], str, str]:
    """Read a file as TOML, by the name of a shipped one or by its path.

    Returns
    -------
    tuple
        The document, the name of the scene if the document has none, and the file for messages.

    Raises
    ------
    TypeError
        For anything but a string or a path.
    ValueError
        For a file that does not exist or cannot be read.
    """
    wanted = "the name of a shipped scene, such as 'sprint', or the path of a .toml file"
    require_type("name", name, str | Path, wanted)
    known = {name: folder for folder in (SHIPPED, DISTRIBUTIONS) for name in _names_in(folder)}
    path, text = Path(name), str(name)
    if text in known:
        file = f"{name}.toml"
        return parse_document((known[text] / file).read_text("utf-8"), file), text, file
    if path.suffix.lower() in (".csv", ".json"):
        raise_with_path(path, "a scene is a .toml file or a name; domino simulate reads layouts")
    if path.is_dir() and not (path / SCENE).is_file():
        raise_with_path(path, f"a folder without a {SCENE}: name the file of a scene")
    if path.suffix != ".toml" and not path.is_file():
        near = difflib.get_close_matches(text[:300], known, n=1)
        near += [str(path / SCENE)] * (path / SCENE).is_file()
        hint = f"did you mean '{near[-1]}'? " if near else ""
        raise ValueError(
            f"there is no scene '{one_line(text, 100)}': {hint}shipped scenes: "
            f"{', '.join(known)}; or give the path of a .toml file"
        )
    if not path.is_file():
        raise_with_path(path, "there is no such file: name a scene or a .toml file")
    try:
        content = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise_with_path(path, "not UTF-8 text: save the file as UTF-8")
    return parse_document(content, str(path)), path.stem, str(path)


def parse_scene(text: str, name: str, file: str) -> Scene:
    """Return the scene of a text.

    Parameters
    ----------
    text
        TOML.
    name
        Name of the scene unless the text holds one.
    file
        Name of the text in messages.

    Raises
    ------
    ValueError
        With file, key, value and accepted range.
    """
    require_type("scene", text, str, "the text of a scene's file, as scene.to_toml() returns")
    return scene_from_document(parse_document(text, file), name, file)


def parse_document(text: str, file: str) -> dict[str, Any]:
    """Return the document of a text in TOML; ValueError with the file's name for other text."""
    with errors_with_path(file):
        try:
            return tomllib.loads(text)
        except RecursionError:
            raise ValueError("not TOML: nested too deeply") from None
        except ValueError as error:
            raise ValueError(f"not TOML: {error}") from None


def scene_from_document(document: dict[str, Any], name: str, file: str) -> Scene:
    """Return the scene of a document that `tomllib` has read; see `parse_scene`."""
    with errors_with_path(file):
        if has_ranges(document):
            raise ValueError("it has ranges: load it by load_distribution, and sample scenes")
        scene = Scene.from_document({"name": name} | document)
    if not scene.in_heights:
        advise_on_units(file, scene.height, scene.spacing, scene.thickness)
    return scene


def scene_beside(path: str | Path) -> Scene | None:
    """Load the scene beside a layout: row.scene.toml or scene.toml beside row.csv, or None.

    Parameters
    ----------
    path
        File of the layout, or the folder of a run with its scene.toml.

    Raises
    ------
    ValueError
        As `load_scene`.
    """
    path = Path(path)
    files = [path / SCENE]
    if not path.is_dir():
        files = [path.with_suffix(f".{SCENE}"), path.parent / SCENE]
    return next((load_scene(file) for file in files if file.is_file()), None)


def write_layout(layout: Layout, file: str | Path, scene: Scene) -> Path:
    """Write a layout of a scene to a .csv or .json file, and the scene beside it.

    Returns
    -------
    Path
        File of the scene, row.scene.toml for row.csv, where `scene_beside` finds it.

    Raises
    ------
    ValueError
        For another kind of file.
    OSError
        For a file that cannot be written.
    """
    path = Path(file)
    beside = path.with_suffix(f".{SCENE}")
    write = {".csv": layout.to_csv, ".json": layout.to_json}.get(path.suffix.lower())
    if write is None:
        raise ValueError(f"{path}: name a .csv or .json file for the layout")
    write(path)
    write_text(beside, scene.to_toml())
    return beside


def common_scene(paths: Sequence[str | Path]) -> Scene | None:
    """Load the common scene of layouts that are shown together, some perhaps without a scene.

    Parameters
    ----------
    paths
        Folders of runs and files of layouts.

    Raises
    ------
    ValueError
        For layouts of different scenes, and as `load_scene`.
    """
    scenes = {str(path): scene_beside(path) for path in paths}
    first, common = next(((p, s) for p, s in scenes.items() if s is not None), ("", None))
    if common is None:
        return None
    if alone := ", ".join(path for path, scene in scenes.items() if scene is None):
        reason = f"no scene beside it: shown in scene '{common.name}' of the other layouts"
        notice(f"{one_line(alone)}: {reason}")
    for path, scene in scenes.items():
        if scene is not None and scene != common:
            files = [one_line(file, 160, keep_end=True) for file in (first, path)]
            raise ValueError(
                f"{' and '.join(files)} are of different scenes ('{common.name}' and "
                f"'{scene.name}'): show layouts of one scene, or name one by --scene"
            )
    return common


def read_layout(path: str | Path, scene: Scene | None) -> Layout:
    """Read a layout, with width and ground of the scene if its file does not give them."""
    layout = Layout.read(path, WIDTH if scene is None else scene.width)
    if scene is None or scene.ground is None or not layout.is_flat:
        return layout
    names = "spacing", "thickness", "height", "width", "density"
    with errors_with_path(path):
        return scene.ground.layout(*(getattr(layout, name) for name in names))
