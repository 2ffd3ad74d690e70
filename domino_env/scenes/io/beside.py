"""The scene that lies beside a layout, as in the folder of a run: what the row was made for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from domino_env.core.reading import naming, one_line
from domino_env.physics.layout import Layout
from domino_env.physics.standard import WIDTH
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene

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


def read_row(path: str | Path, scene: Scene | None) -> Layout:
    """Read a layout; what its file does not say of width and ground is as in the scene."""
    row = Layout.read(path, WIDTH if scene is None else scene.width)
    if scene is None or scene.ground is None or not row.is_flat:
        return row
    with naming(path):
        return scene.ground.layout(row.spacing, row.thickness, row.height, row.width, row.density)
