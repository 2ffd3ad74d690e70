"""Exchange of designs with files, links and other programs; the browser names no path."""

from __future__ import annotations

import base64
import io
import json
import zlib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

from domino_env.core.files import naming, one_line, write_text
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.scenes.io.reading import load_scene, parse_scene, read_layout, scene_beside
from domino_env.scenes.scene import Scene
from domino_env.view.race import Racer
from domino_env.view.report import UNIFORM_NAME, write_report
from domino_env.view.template import write_template
from optimize.interactive.design import NAME, Design

LARGEST_UPLOAD = 8 * 2**20  # [bytes]; 5 000 dominoes are drawn at most, which take 1 MB
LARGEST_LINK = 2**20  # [bytes] of what a link contains
KEY = "design"  # of the query of a link
USUAL_GAPS = (0.002, 0.040)  # [m] bounds for a layout without a scene, widened to its gaps


def open_design(source: str | Path | Scene | Layout | None) -> Design:
    """Return the design of a scene, a layout, their name or path, a run folder or a link.

    Raises
    ------
    ValueError
        As of the functions that read these, and of `Design`.
    """
    if source is None:
        source = "sprint"
    if isinstance(source, Layout):
        return Design(scene_for(source, None), source)
    if isinstance(source, Scene):
        return Design(source)
    if str(source).startswith(("http://", "https://")):
        return of_link(parse_qs(urlsplit(str(source)).query).get(KEY, [""])[0])
    path = Path(source)
    if path.is_dir():
        path = path / "layout.csv"
    if path.suffix.lower() not in (".csv", ".json"):
        return Design(load_scene(source))
    scene = scene_beside(path)
    layout = read_layout(path, scene)
    return Design(scene or scene_for(layout, None), layout)


def scene_for(layout: Layout, like: Scene | None) -> Scene:
    """Return a scene whose rules a layout keeps, with the physics of another scene.

    Thicknesses are free if they differ.

    Raises
    ------
    ValueError
        For heights or densities that differ, and for uneven ground, which a layout does not name.
    """
    for name in ("height", "density"):
        values = getattr(layout, name)
        if np.ptp(values) > 0.0:
            raise ValueError(
                f"{name} from {values.min():g} to {values.max():g}: give the scene of the layout "
                "too, as without one all dominoes have one height and density"
            )
    if not layout.is_flat:
        raise ValueError("the layout stands on a slope: name its scene, which has the ground")
    thick = layout.thickness
    return Scene(
        name=NAME, count=layout.count, height=float(layout.height[0]), width=layout.width,
        density=float(layout.density[0]), first_thickness=float(thick[0]),
        spacing=(min(USUAL_GAPS[0], float(layout.spacing.min())),
                 max(USUAL_GAPS[1], float(layout.spacing.max()))),
        thickness=(float(thick[1:].min()), float(thick[1:].max())),
        physics=like.physics if like else Physics(),
    )  # fmt: skip


def receive(design: Design, files: Mapping[str, bytes]) -> str:
    """Open files that a browser sends, and return what was opened, in words.

    A scene (.toml) replaces the scene, a layout (.csv, .json) the layout. A layout that breaks the
    rules of the scene gets a scene of its own.

    Parameters
    ----------
    design
        The design that is changed; not where a file is rejected.
    files
        Contents by the names of files: a scene, a layout or both.

    Raises
    ------
    ValueError
        With file, place, value and what is allowed, as on the command line.
    """
    for name, data in files.items():
        if len(data) > LARGEST_UPLOAD:
            raise ValueError(
                f"{one_line(name, 100)}: {len(data):,} bytes, where files of at most "
                f"{LARGEST_UPLOAD:,} are taken"
            )
    scenes = [name for name in files if Path(name).suffix.lower() == ".toml"]
    layouts = [name for name in files if Path(name).suffix.lower() in (".csv", ".json")]
    if len(scenes) + len(layouts) < len(files) or len(scenes) > 1 or len(layouts) > 1:
        raise ValueError(
            f"{one_line(', '.join(files), 200)}: give a layout (.csv or .json), a scene (.toml), "
            "or one of each"
        )
    scene, layout, words = design.scene, None, []
    for name in scenes:
        scene = _read(name, files[name], load_scene)
        words.append(f"scene {one_line(name, 100)}")
    for name in layouts:
        layout = _read(name, files[name], partial(read_layout, scene=scene))
        words.append(f"layout {one_line(name, 100)}")
        broken = scene.violations(layout)
        if broken and not scenes:
            scene = scene_for(layout, scene)
            words.append(f"with bounds of its own, as in scene '{design.scene.name}' {broken[0]}")
    design.open(scene, layout)
    return f"opened {', '.join(words)}"


def _read(name: str, data: bytes, read: Callable[[Path], Any]) -> Any:
    """Read a file's contents; messages have the name that the browser gave."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{NAME}{Path(name).suffix.lower()}"
        path.write_bytes(data)
        try:
            return read(path)
        except ValueError as error:
            raise ValueError(str(error).replace(str(path), one_line(name, 100))) from None


def file_of(write: Callable[[Path], object], name: str) -> io.BytesIO:
    """Return what a function writes to a path, to be sent to a browser as a file of this name."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path)
        return io.BytesIO(path.read_bytes())


def exports(design: Design) -> dict[str, tuple[str, Callable[[Path], object]]]:
    """Return the ending and the writer of each kind of file by its name on the page."""
    scene, layout = design.scene, design.layout

    def template(path: Path) -> None:
        write_template(layout, path, title=str(scene.title), physics=scene.physics)

    def report(path: Path) -> None:
        uniform = scene.uniform()
        results = {"your layout": (design.wave, scene.score(design.wave))}
        results[UNIFORM_NAME] = uniform.wave, uniform.score
        racers = [
            Racer(name, wave, score=score, score_text=scene.in_words(score, wave), unit=scene.unit)
            for name, (wave, score) in results.items()
        ]
        write_report(racers, str(scene.title), path)

    return {
        "Layout (CSV)": (".csv", layout.to_csv),
        "Scene (TOML)": (".scene.toml", lambda path: write_text(path, scene.to_toml())),
        "Template (PDF)": (".pdf", template),
        "Report (HTML)": (".html", report),
    }  # fmt: skip


def link_of(design: Design) -> str:
    """Return the query of a link that contains scene and layout, for `of_link`."""
    layout = json.load(file_of(design.layout.to_json, "layout.json"))
    packed = zlib.compress(json.dumps([design.scene.to_toml(), layout]).encode(), 9)
    return f"?{KEY}={base64.urlsafe_b64encode(packed).decode().rstrip('=')}"


def of_link(text: str) -> Design:
    """Return the design of a link's text, as `link_of` makes it.

    Raises
    ------
    ValueError
        For a text that was cut or changed, and as of `receive`.
    """
    with naming("the design in the link"):
        try:
            packed = base64.b64decode(text + "=" * (-len(text) % 4), "-_", validate=True)
            unpacker = zlib.decompressobj()
            toml, layout = json.loads(unpacker.decompress(packed, LARGEST_LINK))
        except (zlib.error, ValueError, TypeError, RecursionError):
            raise ValueError("it was cut or changed: copy the whole link") from None
        scene = parse_scene(str(toml), NAME, "scene")
        data = json.dumps(layout).encode()
        return Design(scene, _read("layout.json", data, partial(read_layout, scene=scene)))
