"""Store searched layouts as best known: ``python docs/best_known.py runs/draw``.

A layout replaces that of its scene in `optimize/experiments/best_known.json` if it scores more.
Then ``python docs/verified.py --best draw`` verifies it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from domino_env import __version__
from domino_env.core.files import read_json, write_text
from domino_env.scenes.io.reading import load_scene, read_layout
from optimize.experiments.best_known import MIN_GAIN, PATH, accurate_score, best_known
from optimize.run_folder import SCENE, SUMMARY

GROUND_PARTS = "rise", "tilt"  # attributes of a layout that are stored for uneven ground only


def store(run: Path, path: Path = PATH) -> bool:
    """Store the layout of a run folder if it is better; return True if it was stored."""
    scene, summary = load_scene(run / SCENE), read_json(run / SUMMARY)
    if load_scene(scene.name) != scene:
        raise ValueError(f"{run} holds a search of another scene than the shipped '{scene.name}'")
    layout = read_layout(run / "layout.json", scene)
    best, score = best_known(path).get(scene.name), accurate_score(scene, layout)
    if best is not None and score <= best.score + MIN_GAIN * abs(best.score):
        return False
    entry = {
        "score": score, "method": summary["method"], "seed": summary["seed"],
        "seconds": round(summary["seconds"], 1), "version": __version__,
        "spacing": layout.spacing.tolist(), "width": layout.width,
    }  # fmt: skip
    for part in ("thickness", "height", "density", *([] if layout.is_flat else GROUND_PARTS)):
        values = getattr(layout, part)
        equal = np.all(values == values[0])
        entry[part] = float(values[0]) if equal else values.tolist()
    document = (read_json(path) if path.exists() else {}) | {scene.name: entry}
    write_text(path, json.dumps(dict(sorted(document.items())), indent=1) + "\n")
    return True


if __name__ == "__main__":
    for run in map(Path, sys.argv[1:]):
        print(f"{run}: {'stored' if store(run) else 'not better'}")
