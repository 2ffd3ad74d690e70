"""Page: one HTML file with simulator, search, scenes and a row, for any browser.

The modules of JavaScript beside this file are put into it as they are: each becomes a function that
returns its exports, and imports become references to what these functions returned.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
import webbrowser
from collections.abc import Sequence
from functools import cache
from html import escape
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np

from domino_env.core.checks import as_path
from domino_env.core.files import write_text
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.scenes.io.link import is_link, layout_document, read_link
from domino_env.scenes.io.reading import load_scene, read_layout, scene_beside, scene_names
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import stored_point
from domino_env.scenes.uniform_layouts import UniformLayouts
from domino_env.view.compared import require_drawable
from optimize.experiments.best_known import best_known

FOLDER = Path(__file__).parent
LIBRARY = ("kernels.js", "ground.js", "scene.js", "search.js", "check.js")  # of page and worker
PAGE = (
    "vendor/smol-toml.cjs", "geometry.js", "draft.js", "row.js", "curves.js", "files.js",
    "print.js", "report.js", "recordings.js", "main.js",
)  # fmt: skip
WORKER = ("measure.js", "worker.js")
USUAL_GAPS = (0.002, 0.040)  # [m] bounds for a layout without a scene, widened to its gaps
HEIGHT = 1200  # [px] of the page in a notebook

_IMPORT = re.compile(r'^import (?:\{([^}]*)\}|(\w+)) from "\./([^"]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function\*?|class|const|let) (\w+))", re.MULTILINE)


def read_source(source: str | Path | Scene | Layout) -> tuple[Scene, Layout | None]:
    """Return the scene, and the layout if there is one, of what the page shows first.

    Parameters
    ----------
    source
        A scene or a layout, the name or path of one, a run folder, or a link of the page. A layout
        without a scene gets one whose bounds contain it.

    Returns
    -------
    tuple
        Scene, and its layout; None for the best equal gaps.

    Raises
    ------
    ValueError
        For a file, a name or a link that cannot be read, and for too many dominoes to draw.
    """
    scene: Scene | None
    layout: Layout | None = None
    if isinstance(source, Scene):
        scene = source
    elif isinstance(source, Layout):
        scene, layout = None, source
    elif is_link(source):
        scene, layout = read_link(str(source))
    else:
        path = as_path("source", source)
        path = path / "layout.csv" if path.is_dir() else path
        if path.suffix.lower() in (".csv", ".json"):
            scene = scene_beside(path)
            layout = read_layout(path, scene)
        else:
            scene = load_scene(source)
    if scene is None:
        assert layout is not None
        scene = scene_for(layout)
    require_drawable(f"scene '{scene.name}'", scene.row_count)
    if layout is not None and (violations := scene.violations(layout)):
        message = f"not a layout of scene '{scene.name}': {'; '.join(violations)}"
        raise ValueError(message)
    return scene, layout


def scene_for(layout: Layout, physics: Physics | None = None) -> Scene:
    """Return a scene whose bounds contain a layout; physics: None for the defaults."""
    if layout.count < 2:
        raise ValueError("one domino has no gap: give a layout of two or more")
    thickness, gaps = layout.thickness[1:], layout.spacing
    return Scene(
        title="your own scene", count=layout.count, height=float(layout.height[0]),
        width=layout.width, density=float(layout.density[0]),
        first_thickness=float(layout.thickness[0]), physics=physics or Physics(),
        spacing=(min(USUAL_GAPS[0], float(gaps.min())), max(USUAL_GAPS[1], float(gaps.max()))),
        thickness=(float(thickness.min()), float(thickness.max())),
    )  # fmt: skip


def page_text(
    scene: Scene | None = None,
    layout: Layout | None = None,
    rows: Sequence[dict[str, Any]] = (),
    headline: str = "",
) -> str:
    """Return the page as the text of one HTML file.

    Parameters
    ----------
    scene
        Scene that is shown first; None for "course".
    layout
        Layout of this scene; None for the best equal gaps.
    rows
        Further rows to race against, each with `name`, `layout` (`layout_document`) and `document`
        (of its scene), and what a report shows of it.
    headline
        Sentences above the report of the rows; empty for no report.

    Returns
    -------
    str
        The page.
    """
    scene = scene or load_scene("course")
    first: dict[str, Any] = {"document": scene.document()}
    for row in (first, *rows):
        _require_known(row["document"]["name"], row["document"]["objective"])
    if layout is not None:
        first["layout"] = layout_document(layout)
    data = {"scenes": _shipped(), "first": first, "rows": list(rows), "headline": headline}
    module = (FOLDER / "chain.wasm").read_bytes()
    library, worker, page = (_bundle(names) for names in (LIBRARY, WORKER, PAGE))
    parts = {
        "title": f"Domino studio: {escape(str(scene.title))}",
        "styles": _read("page.css"),
        "licence": escape(_read("vendor/smol-toml.LICENSE")),
        # "</script" would end the script early, "<!--" could prevent its end
        "data": json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "wasm": base64.b64encode(gzip.compress(module, 9, mtime=0)).decode(),
        "library": library,
        "worker": worker,
        "page": page,
    }
    # in one pass, as data may contain {{page}} in the name of a layout
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], _read("page.html"))


def write_page(
    path: Path,
    scene: Scene | None = None,
    layout: Layout | None = None,
    rows: Sequence[dict[str, Any]] = (),
    headline: str = "",
) -> int:
    """Write the page to an HTML file and return its size [bytes]; arguments as of `page_text`."""
    text = page_text(scene, layout, rows, headline)
    write_text(path, text)
    return len(text.encode())


class Studio:
    """A page on which a layout is designed, which a notebook shows in a frame.

    Parameters
    ----------
    scene
        Scene that is shown first.
    layout
        Layout of this scene; None for the best equal gaps.

    Attributes
    ----------
    html
        Text of the page.
    """

    def __init__(self, scene: Scene, layout: Layout | None = None) -> None:
        self.html = page_text(scene, layout)

    def save(self, path: str | Path | None = None) -> Path:
        """Write the page to an HTML file.

        Parameters
        ----------
        path
            The file; None for a new temporary one.

        Returns
        -------
        Path
            The file.
        """
        temporary = Path(mkdtemp(prefix="domino-")) / "studio.html" if path is None else path
        file = as_path("path", temporary)
        write_text(file, self.html)
        return file

    def open(self, path: str | Path | None = None) -> Path:
        """Write the page as `save` does, open it in the browser, and return the file."""
        file = self.save(path)
        webbrowser.open(file.resolve().as_uri())
        return file

    def _repr_html_(self) -> str:
        style = f"width:100%;height:{HEIGHT}px;border:0"
        return f'<iframe srcdoc="{escape(self.html)}" style="{style}"></iframe>'


def studio(source: str | Path | Scene | Layout = "course") -> Studio:
    """Design a layout by hand on a page: drag, push, improve, search, check, print.

    Parameters
    ----------
    source
        A scene or a layout, the name or path of one, a run folder, or a link of the page.

    Returns
    -------
    Studio
        The page, which a notebook shows; it has `open` for a browser and `save` for a file.

    Raises
    ------
    ValueError
        If the scene or layout cannot be read.

    Examples
    --------
    >>> from optimize import studio
    >>> len(studio("sprint").html) < 450_000
    True
    """
    return Studio(*read_source(source))


def _shipped() -> dict[str, dict[str, Any]]:
    """Return documents, best equal gaps and best known layouts of the shipped scenes."""
    scenes: dict[str, dict[str, Any]] = {}
    known = best_known()
    for name in scene_names():
        scene = load_scene(name)
        document, entry = scene.document(), dict[str, Any]()
        if (point := stored_point(document)) is not None:
            entry["uniform"] = _sizes(scene, UniformLayouts(scene).layout(np.array(point)))
        if name in known:
            entry["best"] = _sizes(scene, known[name].layout)
        scenes[name] = {"document": document} | entry
    return {n: x for n, x in scenes.items() if x["document"]["objective"] in _objectives()}


@cache
def _objectives() -> list[str]:
    """Return the names of the objectives that scene.js has."""
    return re.findall(r'"(\w+)"', re.findall(r"OBJECTIVES = \[.+\];", _read("scene.js"))[0])


def _require_known(name: str, objective: str) -> None:
    """Raise ValueError for the objective of a scene if scene.js does not have it."""
    if objective not in _objectives():
        raise ValueError(
            f"scene '{name}' has objective = '{objective}', and the page computes "
            f"{', '.join(_objectives())} only: search it with `domino optimize {name}`, and see "
            "its layouts with `domino render`"
        )


def _sizes(scene: Scene, layout: Layout) -> list[Any]:
    """Return the arguments of `scene.layout`, one number for equal values; None if they follow."""
    return [
        None if values is None else values.tolist() if np.ptp(values) else float(values[0])
        for values in (
            layout.spacing,
            layout.thickness[1:] if scene.free_thickness else None,
            None if scene.growth is None else layout.height[1:],
        )
    ]


def _read(name: str) -> str:
    return (FOLDER / name).read_text("utf-8")


def _bundle(names: Sequence[str]) -> str:
    """Return modules of JavaScript as one classic script."""
    text = "\n".join(_module(name) for name in names)
    assert not re.search("</script|<!--", text), f"{names}: it would end the script"
    return text


def _module(name: str) -> str:
    """Return a module as a function that is called at once and returns its exports."""
    text = _read(name)
    if name.endswith(".cjs"):
        body, result = f"const exports = {{}};\n{text}", "exports"
    else:
        body, names = _EXPORT.sub("", _IMPORT.sub(_reference, text)), _EXPORT.findall(text)
        assert not re.search(r"^(import|export) ", body, re.MULTILINE), f"{name}: unknown form"
        result = f"{{ {', '.join(names)} }}"
    return f"const {_variable(name)} = (() => {{\n{body}return {result};\n}})();"


def _reference(match: re.Match[str]) -> str:
    """Return the declaration that takes the place of an import."""
    names = f"{{{match[1].replace(' as ', ': ')}}}" if match[1] else match[2]
    return f"const {names} = {_variable(match[3])};\n"


def _variable(name: str) -> str:
    return "$" + re.sub(r"\W", "_", Path(name).stem)
