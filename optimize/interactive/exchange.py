"""Exchange of designs with files, links and other programs; the browser sends no paths."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import parse_qs, urlsplit

from domino_env.core.files import errors_with_path, one_line, write_text
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.scenes.io.reading import load_scene, read_layout, scene_beside
from domino_env.scenes.scene import Scene
from domino_env.view.report import read_compared, write_report
from domino_env.view.template import write_template
from optimize.interactive.design import NAME, TITLE, Design

LARGEST_UPLOAD = 8 * 2**20  # [bytes]; 5 000 dominoes are drawn at most, which take 1 MB
LARGEST_LINK = 2**20  # [bytes] of the contents of a link
KEY = "design"  # in the query of a link
USUAL_GAPS = (0.002, 0.040)  # [m] bounds for a layout without a scene, widened to its gaps
NAMES = {".csv": "layout.csv", ".json": "layout.json", ".toml": "scene.toml"}


def open_design(source: str | Path | Scene | Layout, default: Scene | None = None) -> Design:
    """Return the design of a scene, a layout, their name or path, a run folder or a link.

    Parameters
    ----------
    source
        The design.
    default
        Scene for a layout file without a scene, if the layout keeps its rules; None for a new
        scene that is made from the layout.

    Raises
    ------
    ValueError
        See the functions that read these files, and `Design`.
    """
    if isinstance(source, Scene):
        return Design(source)
    if isinstance(source, Layout):
        return Design(_scene_for(source, default), source)
    if str(source).startswith(("http://", "https://")):
        return read_link(parse_qs(urlsplit(str(source)).query).get(KEY, [""])[0])
    path = Path(source)
    if path.is_dir():
        path = path / "layout.csv"
    if path.suffix.lower() not in (".csv", ".json"):
        return Design(load_scene(source))
    scene = scene_beside(path)
    layout = read_layout(path, scene or default)
    return Design(scene or _scene_for(layout, default), layout)


def _scene_for(layout: Layout, default: Scene | None) -> Scene:
    """Return the scene of a layout: another one if the layout keeps its rules, else its own."""
    if default is not None and not default.violations(layout):
        return default
    if layout.count < 2:
        raise ValueError("one domino has no gap: give a layout of two or more")
    thickness, gaps = layout.thickness, layout.spacing
    return Scene(
        name=NAME, title=TITLE, count=layout.count,
        height=float(layout.height[0]), width=layout.width,
        density=float(layout.density[0]), first_thickness=float(thickness[0]),
        spacing=(min(USUAL_GAPS[0], float(gaps.min())), max(USUAL_GAPS[1], float(gaps.max()))),
        thickness=(float(thickness[1:].min()), float(thickness[1:].max())),
        physics=default.physics if default else Physics(),
    )  # fmt: skip


def read_files(files: Mapping[str, bytes], default: Scene | None = None) -> Design:
    """Return the design of a scene (.toml), a layout (.csv, .json) or both.

    Parameters
    ----------
    files
        Contents of files by their names in messages.
    default
        See `open_design`.

    Raises
    ------
    ValueError
        If a file is invalid; the message has file, place, value and accepted range.
    """
    names = {name: NAMES.get(Path(name).suffix.lower()) for name in files}
    scenes = [*names.values()].count(NAMES[".toml"])
    if not files or None in names.values() or scenes > 1 or len(files) - scenes > 1:
        raise ValueError(
            f"{one_line(', '.join(files), 200)}: give a layout (.csv or .json), a scene (.toml), "
            "or one of each"
        )
    with TemporaryDirectory() as folder:
        paths = {name: Path(folder) / str(file) for name, file in names.items()}
        for name, path in paths.items():
            path.write_bytes(files[name])
        try:
            return open_design(min(paths.values()), default)  # a layout finds the scene beside it
        except ValueError as error:
            message = str(error)
            for name, path in paths.items():
                message = message.replace(str(path), one_line(name, 100))
            raise ValueError(message) from None


def receive(design: Design, files: Mapping[str, bytes]) -> str:
    """Open files that a browser sends, and return a message with their names.

    Parameters
    ----------
    design
        The design, which is not changed if a file is rejected.
    files
        Contents by the names of files.

    Raises
    ------
    ValueError
        See `read_files`; also for files of more than `LARGEST_UPLOAD`.
    """
    names = one_line(", ".join(files), 200)
    if (size := sum(map(len, files.values()))) > LARGEST_UPLOAD:
        raise ValueError(f"{names}: {size:,} bytes: send at most {LARGEST_UPLOAD:,} at a time")
    scene, other = design.scene, read_files(files, design.scene)
    design.open(other.scene, other.layout)
    if len(files) < 2 and design.scene != scene and (violations := scene.violations(design.layout)):
        return f"opened {names}; it is no layout of scene '{scene.name}': {violations[0]}"
    return f"opened {names}"


def make_file(write: Callable[[Path], object], name: str) -> BytesIO:
    """Call a function that writes a file of this name, and return its contents."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path)
        return BytesIO(path.read_bytes())


def exports(design: Design) -> dict[str, tuple[str, Callable[[Path], object]]]:
    """Return the ending and the writer of each kind of file by its name on the page."""
    scene, layout = design.scene, design.layout

    def report(path: Path) -> None:
        own = path.with_name("your layout.csv")
        layout.to_csv(own)
        write_report(*read_compared([own], scene), path)

    return {
        "Layout (CSV)": (".csv", layout.to_csv),
        "Scene (TOML)": (".scene.toml", lambda path: write_text(path, scene.to_toml())),
        "Template (PDF)": (".pdf", lambda path: write_template(
            layout, path, title=str(scene.title), physics=scene.physics)),
        "Report (HTML)": (".html", report),
    }  # fmt: skip


def make_link(design: Design) -> str:
    """Return the query of a link that contains scene and layout, for `read_link`."""
    texts = [design.scene.to_toml(), make_file(design.layout.to_csv, NAMES[".csv"]).read().decode()]
    data = zlib.compress(json.dumps(texts).encode(), 9)
    return f"?{KEY}={base64.urlsafe_b64encode(data).decode().rstrip('=')}"


def read_link(text: str) -> Design:
    """Return the design of a link's text, as `make_link` makes it.

    Raises
    ------
    ValueError
        If the text is incomplete or changed, or for the reasons of `read_files`.
    """
    with errors_with_path("the design in the link"):
        try:
            data = base64.b64decode(text + "=" * (-len(text) % 4), "-_", validate=True)
            scene, layout = json.loads(zlib.decompressobj().decompress(data, LARGEST_LINK))
            files = {"scene.toml": scene.encode(), "layout.csv": layout.encode()}
        except (zlib.error, ValueError, TypeError, AttributeError, RecursionError):
            raise ValueError("it was cut or changed: copy the whole link") from None
        return read_files(files)
