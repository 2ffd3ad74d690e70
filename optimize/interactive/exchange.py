"""Exchange of drafts as files and links; a browser sends contents of files, never paths."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import parse_qs, urlsplit

from domino_env.core.checks import as_path
from domino_env.core.files import errors_with_path, one_line, write_text
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.scenes.io.reading import load_scene, read_layout, scene_beside
from domino_env.scenes.scene import Scene
from domino_env.view.report import read_compared, write_report
from domino_env.view.template import write_template
from optimize.interactive.draft import NAMED, Draft

MAX_LINK_CONTENT = 2**20  # [bytes] of a link, decompressed
KEY = "design"  # of the query of a link
USUAL_GAPS = (0.002, 0.040)  # [m] bounds for a layout without a scene, widened to its gaps
LAYOUT, SCENE = "layout.csv", "scene.toml"
NAMES = {".csv": LAYOUT, ".json": "layout.json", ".toml": SCENE}  # of uploaded files, by ending


def open_draft(source: str | Path | Scene | Layout, default: Scene | None = None) -> Draft:
    """Return the draft of a scene, a layout, their name or path, a run folder or a link.

    Parameters
    ----------
    source
        A scene, a layout, or the text that names it.
    default
        Scene for a layout without one. If it is None, or if the layout breaks its rules, a new
        scene is made from the layout.

    Returns
    -------
    Draft
        A new draft.

    Raises
    ------
    ValueError
        For a file, a name or a link that cannot be read, a layout that breaks the rules of its own
        scene, and a scene without free values.
    """
    if isinstance(source, Scene):
        return Draft.uniform(source)
    if isinstance(source, Layout):
        return Draft(_scene_for(source, default), source)
    if str(source).startswith(("http://", "https://")):
        return read_link(parse_qs(urlsplit(str(source)).query).get(KEY, [""])[0])
    path = as_path("source", source)
    if path.is_dir():
        path = path / LAYOUT
    if path.suffix.lower() not in (".csv", ".json"):
        return Draft.uniform(load_scene(source))
    scene = scene_beside(path)
    layout = read_layout(path, scene or default)
    return Draft(scene or _scene_for(layout, default), layout)


def _scene_for(layout: Layout, default: Scene | None) -> Scene:
    """Return the default scene if the layout satisfies its rules, else one made from the layout."""
    if default is not None and not default.violations(layout):
        return default
    if layout.count < 2:
        raise ValueError("one domino has no gap: give a layout of two or more")
    first, thickness, gaps = layout.thickness[0], layout.thickness[1:], layout.spacing
    return Scene(
        **NAMED, count=layout.count, height=float(layout.height[0]), width=layout.width,
        density=float(layout.density[0]), first_thickness=float(first),
        spacing=(min(USUAL_GAPS[0], float(gaps.min())), max(USUAL_GAPS[1], float(gaps.max()))),
        thickness=(float(thickness.min()), float(thickness.max())),
        physics=default.physics if default else Physics(),
    )  # fmt: skip


def read_files(files: Mapping[str, bytes], default: Scene | None = None) -> Draft:
    """Return the draft of a scene (.toml), a layout (.csv, .json) or both.

    Parameters
    ----------
    files
        Contents of the files by their names, which messages contain.
    default
        Scene for a layout without one, as of `open_draft`.

    Returns
    -------
    Draft
        A new draft.

    Raises
    ------
    ValueError
        For another combination of files, and for the reasons of `open_draft`.
    """
    kinds = {name: NAMES.get(Path(name).suffix.lower(), "") for name in files}
    if (
        not files
        or "" in kinds.values()
        or len({Path(k).stem for k in kinds.values()}) < len(files)
    ):
        raise ValueError(
            f"{one_line(', '.join(files), 200)}: give a layout (.csv or .json), a scene (.toml), "
            "or one of each"
        )
    with TemporaryDirectory() as folder:
        paths = {name: Path(folder) / kind for name, kind in kinds.items()}
        for name, path in paths.items():
            path.write_bytes(files[name])
        try:
            # the layout, if there is one, is the first by name; its scene is read beside it
            return open_draft(min(paths.values()), default)
        except ValueError as error:
            message = str(error)
            for name, path in paths.items():
                message = message.replace(str(path), one_line(name, 100))
            raise ValueError(message) from None


def _write_template(draft: Draft, path: Path) -> None:
    scene, row, title = draft.scene, draft.wave.layout, str(draft.scene.title)
    write_template(row, path, title=title, physics=scene.physics, designed=scene.count)


def _write_report(draft: Draft, path: Path) -> None:
    layout = path.with_name("your layout.csv")  # the report shows this name
    draft.layout.to_csv(layout)
    write_report(*read_compared([layout], draft.scene), path)


FILES: dict[str, tuple[str, Callable[[Draft, Path], object]]] = {
    "template.pdf": ("Template to print (PDF)", _write_template),
    LAYOUT: ("Layout (CSV)", lambda draft, path: draft.layout.to_csv(path)),
    SCENE: ("Scene (TOML)", lambda draft, path: write_text(path, draft.scene.to_toml())),
    "report.html": ("Report (HTML)", _write_report),
}
"""Label and writer of each file of a draft, by its name."""


def make_file(draft: Draft, name: str) -> BytesIO:
    """Return the contents of one of the `FILES` of a draft."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        FILES[name][1](draft, path)
        return BytesIO(path.read_bytes())


def make_link(draft: Draft) -> str:
    """Return the query of a link that contains the scene and the layout, for `read_link`."""
    texts = [draft.scene.to_toml(), make_file(draft, LAYOUT).read().decode()]
    data = zlib.compress(json.dumps(texts).encode(), 9)
    return f"?{KEY}={base64.urlsafe_b64encode(data).decode().rstrip('=')}"


def read_link(text: str) -> Draft:
    """Return the draft in a link.

    Parameters
    ----------
    text
        Value of the key `KEY` in the query of `make_link`.

    Returns
    -------
    Draft
        A new draft.

    Raises
    ------
    ValueError
        If the text is incomplete or changed, or for the reasons of `read_files`.
    """
    with errors_with_path("the row in the link"):
        try:
            data = base64.b64decode(text + "=" * (-len(text) % 4), "-_", validate=True)
            texts = json.loads(zlib.decompressobj().decompress(data, MAX_LINK_CONTENT))
            files = {name: text.encode() for name, text in zip((SCENE, LAYOUT), texts, strict=True)}
        except (zlib.error, ValueError, TypeError, AttributeError, RecursionError):
            raise ValueError("it was cut or changed: copy the whole link") from None
        return read_files(files)
