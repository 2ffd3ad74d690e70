"""The best uniform rows of the scenes that ship, found anew.

python -m domino_env.scenes.io.marks
"""

from __future__ import annotations

import json
from pathlib import Path

from domino_env.core.files import write_text
from domino_env.scenes.baseline import best_point
from domino_env.scenes.io.reading import load_scene, scene_names
from domino_env.scenes.shipped_marks import FILE, stamp

PATH = Path(__file__).parents[1] / "shipped" / FILE


def main() -> None:
    """Write the file that ships."""
    scenes = {name: load_scene(name) for name in scene_names()}
    found = {
        name: {"stamp": stamp(scene), "point": best_point(scene).tolist()}
        for name, scene in scenes.items()
    }
    write_text(PATH, json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
