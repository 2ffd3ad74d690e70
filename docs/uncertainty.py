"""Write uncertainty.csv: python docs/uncertainty.py runs/*, with the folders of trainings.

It has one line for each reference of the scenes draw and tempo-noise and for each training. Scores
are means over the evaluation seeds; a hindsight_score is 0 for the open-loop plan and 1 where all
that is random is known, and rms_ms is the RMS error [ms] that has the score.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from agents.draw import shipped_references
from agents.policy import CONFIG, PROGRESS, ScenePolicy
from agents.rollout import EVALUATION_SEEDS, episode_scores
from agents.scripted import ScriptedPolicy
from domino_env import Scene, load_scene
from domino_env.core.files import read_json
from domino_env.core.tables import write_csv
from domino_env.scenes.placement import add_errors
from optimize.experiments.best_known import best_known

PATH = Path(__file__).with_name("uncertainty.csv")
COLUMNS = "scene", "policy", "seed", "steps", "score", "gain", "hindsight_score", "rms_ms"
REFERENCES = {"draw": ("uniform", "plan", "rule"), "tempo-noise": ("uniform", "plan", "controller")}


def main() -> None:
    """Evaluate all references, and the trainings in the folders that are named."""
    lines = []
    for name, policies in REFERENCES.items():
        scene = load_scene(name)
        scores = {one: ScriptedPolicy(one).build(scene).score for one in policies}
        scores["hindsight"] = hindsight(scene)
        lines += [(name, one, "", "", score) for one, score in scores.items()]
    for folder in map(Path, sys.argv[1:]):
        config, run = read_json(folder / CONFIG), ScenePolicy.load(folder)
        steps = (folder / PROGRESS).read_text("utf-8").splitlines()[-1].partition(",")[0]
        how = config["algorithm"], config["seed"], steps
        score = episode_scores(run.policy, run.scene, EVALUATION_SEEDS).mean()
        lines.append((run.scene.name, *how, score))
    by = {line[:2]: line[4] for line in lines if line[2] == ""}
    written = []
    for *line, score in lines:
        known = {one: by[line[0], one] for one in ("uniform", "plan", "hindsight")}
        normalised = (score - known["plan"]) / (known["hindsight"] - known["plan"])
        scene = load_scene(line[0])
        gain = 100.0 * scene.gain(score, known["uniform"])
        error = "" if scene.tempo is None else f"{scene.criterion.displayed(score):.4f}"
        written.append((*line, f"{score:.6f}", f"{gain:.3f}", f"{normalised:.4f}", error))
    write_csv(PATH, COLUMNS, written)


def hindsight(scene: Scene) -> float:
    """Return the mean score where all that is random is known."""
    if scene.hand:
        return float(shipped_references()["hindsight"])
    layout = best_known()["tempo"].layout  # which keeps the schedule without errors
    generators = map(np.random.default_rng, EVALUATION_SEEDS)
    errors = np.array([scene.placement_errors(generator) for generator in generators])
    gaps = add_errors(np.clip(layout.spacing - errors, *scene.spacing), errors)
    thickness = np.tile(layout.thickness[1:], (len(gaps), 1))
    return float(scene.as_placed.evaluate(scene.batch(gaps, thickness)).score.mean())


if __name__ == "__main__":
    main()
