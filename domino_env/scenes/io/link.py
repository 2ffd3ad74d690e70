"""Links of the page: a scene and one of its layouts in the part of an address after #."""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

import numpy as np

from domino_env.core.files import errors_with_path
from domino_env.core.models import read_model
from domino_env.physics.files import LayoutTable
from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene

KEY = "design="  # before the row in an address
MAX_CONTENT = 2**20  # [bytes] of a link, unpacked


def is_link(text: object) -> bool:
    """Return True for the address of a page that contains a row."""
    return f"#{KEY}" in str(text)


def layout_document(layout: Layout) -> dict[str, Any]:
    """Return the document of a `LayoutTable`, with one number for equal values."""
    names = ["spacing", "thickness", "height", "width", "density"]
    names += [] if layout.is_flat else ["rise", "tilt"]
    values = {name: np.asarray(getattr(layout, name)) for name in names}
    short = {
        name: (array.tolist() if np.ptp(array) else float(array.flat[0]))
        for name, array in values.items()
        if name != "spacing"
    }
    return {"spacing": layout.spacing.tolist()} | short


def make_link(scene: Scene, layout: Layout) -> str:
    """Return the part of an address after # that contains a scene and a layout."""
    content = json.dumps({"scene": scene.document(), "layout": layout_document(layout)})
    data = zlib.compress(content.encode(), 9)
    return KEY + base64.urlsafe_b64encode(data).decode().rstrip("=")


def read_link(link: str) -> tuple[Scene, Layout]:
    """Return the scene and the layout in a link of the page.

    Parameters
    ----------
    link
        Address of the page, or the part after #.

    Returns
    -------
    tuple
        Scene and layout, which may break the rules of the scene.

    Raises
    ------
    ValueError
        If the link is incomplete or changed, and for an invalid scene or layout.
    """
    text = link.rpartition(KEY)[2]
    with errors_with_path("the row in the link"):
        try:
            data = base64.b64decode(text + "=" * (-len(text) % 4), "-_", validate=True)
            content = json.loads(zlib.decompressobj().decompress(data, MAX_CONTENT))
            document, layout = content["scene"], content["layout"]
        except (zlib.error, ValueError, TypeError, KeyError, RecursionError):
            raise ValueError("it was cut or changed: copy the whole link") from None
        scene = Scene.from_document(document)
        return scene, Layout(**read_model(LayoutTable, layout).arguments())
