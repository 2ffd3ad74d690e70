"""Reading of scenes by name, by path and beside a layout, and files of their layouts."""

from __future__ import annotations

import difflib
import json
import tomllib
from collections.abc import Iterator, Sequence
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from domino_env.core import files
from domino_env.core.checks import as_path, require_type
from domino_env.core.progress import notice
from domino_env.physics.layout import Layout
from domino_env.physics.standard import WIDTH, advise_on_units
from domino_env.scenes.io.link import is_link, read_link
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.scene import Scene

SHIPPED = resources.files("domino_env.scenes") / "shipped"
DISTRIBUTIONS = resources.files("domino_env.scenes") / "distributions"
SCHEMA = SHIPPED / "scene.schema.json"
SCENE = "scene.toml"  # in a run folder; row.scene.toml beside row.csv


def scene_names() -> list[str]:
    """Return the names of the shipped scenes."""
    return _names_in(SHIPPED)


def distribution_names() -> list[str]:
    """Return the names of the shipped scene distributions."""
    return _names_in(DISTRIBUTIONS)


def _names_in(folder: Traversable) -> list[str]:
    names = [file.name for file in folder.iterdir()]
    return sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml"))


def load_scene(name: str | Path) -> Scene:
    """Load a scene.

    Parameters
    ----------
    name
        Name of a shipped scene, or path of a TOML file.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    TypeError
        For anything but a string or a path.
    ValueError
        For a file that cannot be read, for invalid tables, with key, value and accepted range, and
        for a file with ranges, which `load_distribution` reads.

    Examples
    --------
    >>> import domino_env as de
    >>> de.load_scene("sprint").count
    40
    """
    return scene_from_document(*read_named(name))


def read_named(name: str | Path) -> tuple[dict[str, Any], str, str]:
    """Read the document of a scene or a scene distribution.

    Parameters
    ----------
    name
        Name of a shipped scene or distribution, or path of a TOML file.

    Returns
    -------
    tuple
        Document, name of the scene if the document has none, and name of the file for messages.

    Raises
    ------
    TypeError
        For anything but a string or a path.
    ValueError
        For a file that does not exist, cannot be read or is not TOML.
    """
    expected = "the name of a shipped scene, such as 'sprint', or the path of a .toml file"
    require_type("name", name, str | Path, expected)
    known = {name: folder for folder in (SHIPPED, DISTRIBUTIONS) for name in _names_in(folder)}
    path, text = as_path("name", name), str(name)
    if text in known:
        file = f"{name}.toml"
        return parse_document((known[text] / file).read_text("utf-8"), file), text, file
    if path.suffix.lower() in (".csv", ".json"):
        files.raise_with_path(
            path, "a scene is a .toml file or a name; domino simulate reads layouts"
        )
    if path.is_dir() and not (path / SCENE).is_file():
        files.raise_with_path(path, f"a folder without a {SCENE}: name the file of a scene")
    if path.suffix != ".toml" and not path.is_file():
        near = difflib.get_close_matches(text[:300], known, n=1)
        near += [str(path / SCENE)] * (path / SCENE).is_file()
        hint = f"did you mean '{near[-1]}'? " if near else ""
        raise ValueError(
            f"there is no scene '{files.one_line(text, 100)}': {hint}shipped scenes: "
            f"{', '.join(known)}; or give the path of a .toml file"
        )
    if not path.is_file():
        files.raise_with_path(path, "there is no such file: name a scene or a .toml file")
    try:
        content = files.read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        files.raise_with_path(path, "not UTF-8 text: save the file as UTF-8")
    return parse_document(content, str(path)), path.stem, str(path)


def schema_fields() -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield the keys of a scene file: name of the table, "" for none, key, and its schema."""
    schema = json.loads(SCHEMA.read_text("utf-8"))
    for table, entry in schema["properties"].items():
        reference = entry.get("$ref", "").rpartition("/")[2]
        fields = schema["$defs"][reference]["properties"] if reference else {table: entry}
        for key, field in fields.items():
            yield table if reference else "", key, field


def parse_scene(text: str, name: str, file: str) -> Scene:
    """Return the scene of a TOML text.

    Parameters
    ----------
    text
        Text of a scene file.
    name
        Name of the scene if the text has none.
    file
        Name of the file in error messages.

    Returns
    -------
    Scene
        The scene.

    Raises
    ------
    TypeError
        For anything but a text.
    ValueError
        For an invalid text; the message has file, key, value and accepted range.
    """
    require_type("scene", text, str, "the text of a scene's file, as scene.to_toml() returns")
    return scene_from_document(parse_document(text, file), name, file)


def parse_document(text: str, file: str) -> dict[str, Any]:
    """Return the document of a TOML text; raise a ValueError with the file for other text."""
    with files.errors_with_path(file):
        try:
            return tomllib.loads(text)
        except RecursionError:
            raise ValueError("not TOML: nested too deeply") from None
        except ValueError as error:
            raise ValueError(f"not TOML: {error}") from None


def scene_from_document(document: dict[str, Any], name: str, file: str) -> Scene:
    """Return the scene of a document read by `tomllib`; arguments as for `parse_scene`."""
    with files.errors_with_path(file):
        if has_ranges(document):
            raise ValueError(
                "it describes many scenes: name one scene; for domino train, evaluate and dataset, "
                "and load_distribution in Python, it is right"
            )
        scene = Scene.from_document({"name": name} | document)
    if not scene.in_heights:
        advise_on_units(file, scene.height, scene.spacing, scene.thickness)
    return scene


def scene_beside(path: str | Path) -> Scene | None:
    """Load the scene beside a layout: row.scene.toml or scene.toml beside row.csv.

    Parameters
    ----------
    path
        File of the layout, run folder with a scene.toml, or link of the page, which contains it.

    Returns
    -------
    Scene or None
        The scene; None if there is no such file.

    Raises
    ------
    ValueError
        As for `load_scene`.
    """
    if is_link(path):
        return read_link(str(path))[0]
    path = Path(path)
    places = [path / SCENE]
    if not path.is_dir():
        places = [path.with_suffix(f".{SCENE}"), path.parent / SCENE]
    return next((load_scene(place) for place in places if place.is_file()), None)


def write_layout(layout: Layout, file: str | Path, scene: Scene) -> Path:
    """Write a layout of a scene to a .csv or .json file, and the scene beside it.

    Parameters
    ----------
    layout
        The layout.
    file
        File of the layout, which is replaced.
    scene
        The scene.

    Returns
    -------
    Path
        File of the scene for `scene_beside`, row.scene.toml beside row.csv.

    Raises
    ------
    ValueError
        For a file with another ending.
    OSError
        For a file that cannot be written.
    """
    path = Path(file)
    beside = path.with_suffix(f".{SCENE}")
    write = {".csv": layout.to_csv, ".json": layout.to_json}.get(path.suffix.lower())
    if write is None:
        raise ValueError(f"{path}: name a .csv or .json file for the layout")
    write(path)
    files.write_text(beside, scene.to_toml())
    return beside


def common_scene(paths: Sequence[str | Path]) -> Scene | None:
    """Load the common scene of layouts that are shown together.

    A notice names the layouts without a scene beside them.

    Parameters
    ----------
    paths
        Run folders, files of layouts and links of the page.

    Returns
    -------
    Scene or None
        The scene; None if no layout has a scene beside it.

    Raises
    ------
    ValueError
        For a path that does not exist, layouts of different scenes, and as for `load_scene`.
    """
    for given in map(Path, paths):
        if not is_link(given) and not given.exists():
            files.raise_with_path(given, "there is no such file: name a layout or a run folder")
    scenes = {str(path): scene_beside(path) for path in paths}
    first, common = next(((p, s) for p, s in scenes.items() if s is not None), ("", None))
    if common is None:
        return None
    if others := ", ".join(path for path, scene in scenes.items() if scene is None):
        reason = f"no scene beside it: shown in scene '{common.name}' of the other layouts"
        notice(f"{files.one_line(others)}: {reason}")
    for path, scene in scenes.items():
        if scene is not None and scene != common:
            both = [files.one_line(name, 160, keep_end=True) for name in (first, path)]
            raise ValueError(
                f"{' and '.join(both)} are of different scenes ('{common.name}' and "
                f"'{scene.name}'): show layouts of one scene, or name one by --scene"
            )
    return common


def layout_name(path: Path) -> str:
    """Return the stem of the name of a layout's file, or the name of its folder for "layout".

    Long names are shortened to 100 characters; a link has the name "link".
    """
    name = path.resolve().parent.name if path.stem == "layout" else path.stem
    return "link" if is_link(path) else files.one_line(name, 100)


def read_layout(path: str | Path, scene: Scene | None) -> Layout:
    """Read a layout, with the width and the ground of the scene if the file does not have them.

    Parameters
    ----------
    path
        File of the layout, .csv or .json, or link of the page.
    scene
        Scene of the layout; None for the standard width and flat ground.

    Returns
    -------
    Layout
        The layout.

    Raises
    ------
    ValueError
        As for `Layout.read`, for a link that was cut or changed, and for a layout that cannot stand
        on the ground.
    """
    if is_link(path):
        return read_link(str(path))[1]
    layout = Layout.read(path, WIDTH if scene is None else scene.width)
    if scene is None or scene.ground is None or not layout.is_flat:
        return layout
    names = "spacing", "thickness", "height", "width", "density"
    with files.errors_with_path(path):
        return scene.ground.layout(*(getattr(layout, name) for name in names))
