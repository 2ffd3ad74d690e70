"""Long trainings over scenes and seeds, and the tables and curves of them in the documentation.

    python -m agents.lab.long_runs --out runs/long --docs docs

trains what is not trained yet (two hours on one core), goes on where it was stopped, writes
learning.csv, a row a run, and learning.png, and prints the table of `docs/agents.md`.  Times are
processor time: what else the machine does falls out.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.base.run_files import is_finished
from agents.single.training import train
from domino_env import load_scene
from domino_env.support.colours import BLUE, GREEN, KNOWN, SKY, UNIFORM
from domino_env.support.plot_style import new_panels, style, write_png
from domino_env.support.tables import markdown_table, write_csv
from optimize.records.shipped import best_known

SCENES = ("sprint", "sprint-thickness", "ideal", "course")
SEEDS = 3
SEED_COLOURS = (BLUE, SKY, GREEN)
SHARE = 0.8  # of the best known row's gain, to be reached
MOMENTS = (60.0, 300.0, 900.0)  # [s] at which the curves are read
COLUMNS = (
    "scene", "algorithm", "seed", "steps", "processor_seconds", "uniform", "score", "best_known",
    "share_of_gain", "seconds_to_uniform", "seconds_to_share", "after_60_s", "after_300_s",
    "after_900_s",
)  # fmt: skip

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LearningCurve:
    """Result of one training.

    Attributes
    ----------
    scene, algorithm, seed, steps
        What was asked.
    seconds, best
        Its learning curve: processor time [s] and the best score by then.
    uniform, known
        Scores of the best uniform row and of the best row known.
    """

    scene: str
    algorithm: str
    seed: int
    steps: int
    seconds: Floats
    best: Floats
    uniform: float
    known: float

    @property
    def share(self) -> float:
        """The part of the best known row's gain over the uniform one that was reached."""
        return float((self.best[-1] - self.uniform) / (self.known - self.uniform))

    def time_to(self, score: float) -> float:
        """Find when the best policy built a row of that score [s]; inf where none did."""
        there = np.flatnonzero(self.best >= score)
        return float(self.seconds[there[0]]) if len(there) else np.inf

    def after(self, seconds: float) -> float:
        """Give the best score by then [s]."""
        latest = int(np.searchsorted(self.seconds, seconds, side="right")) - 1
        return float(self.best[max(latest, 0)])

    def row(self) -> tuple[object, ...]:
        """Give its entries of `COLUMNS`."""
        goal = self.uniform + SHARE * (self.known - self.uniform)
        return (
            self.scene, self.algorithm, self.seed, self.steps, round(float(self.seconds[-1]), 1),
            self.uniform, float(self.best[-1]), self.known, round(self.share, 4),
            round(self.time_to(self.uniform), 1), round(self.time_to(goal), 1),
            *(self.after(moment) for moment in MOMENTS),
        )  # fmt: skip


def read_curve(folder: Path) -> LearningCurve:
    """Read a run's folder; ValueError where it holds no finished training."""
    if not (folder / "summary.json").exists():
        raise ValueError(f"{folder} holds no finished training")
    summary = json.loads((folder / "summary.json").read_text("utf-8"))
    curve = np.genfromtxt(folder / "progress.csv", delimiter=",", names=True)
    curve = np.atleast_1d(curve)
    known = best_known()[summary["scene"]].score
    return LearningCurve(
        summary["scene"], summary["algorithm"], int(summary["seed"]), int(summary["steps"]),
        curve["processor_seconds"], curve["best_score"], summary["uniform_score"], known,
    )  # fmt: skip


def run_all(scenes: Iterable[str], seeds: int, algorithm: str, out: Path) -> list[LearningCurve]:
    """Train what is not trained yet, one after the other."""
    runs = []
    for scene in scenes:
        for seed in range(seeds):
            folder = out / f"{scene}-{algorithm}-{seed}"
            if not is_finished(folder):
                begun = (folder / "checkpoint.pt").exists()
                train(scene, algorithm, None, seed, folder, resume=begun)
            runs.append(read_curve(folder))
            print(*runs[-1].row(), flush=True)
    return runs


def write(runs: list[LearningCurve], docs: Path) -> None:
    """Write a line a run as CSV, and draw the curves."""
    write_csv(docs / "learning.csv", COLUMNS, (run.row() for run in runs))
    draw(runs, docs / "learning.png")


def table(runs: list[LearningCurve]) -> str:
    """Make a line a scene, in Markdown: the worst of its seeds, where not said otherwise."""
    names = (
        "scene", "algorithm", "seeds", "uniform", "worst, best score", "best known",
        "share of its gain, worst", "past uniform after", "after 1, 5 min", "trained for",
    )  # fmt: skip
    rows = []
    for scene, algorithm in dict.fromkeys((r.scene, r.algorithm) for r in runs):
        those = [r for r in runs if (r.scene, r.algorithm) == (scene, algorithm)]
        scores = [float(r.best[-1]) for r in those]
        passed = max(r.time_to(r.uniform) for r in those)
        early = ", ".join(f"{min(r.after(t) for r in those):.4f}" for t in MOMENTS[:2])
        rows.append((
            f"`{scene}`", algorithm, len(those), f"{those[0].uniform:.4f}",
            f"{min(scores):.5f}, {max(scores):.5f}", f"{those[0].known:.5f}",
            f"{min(r.share for r in those):.1%}", f"{passed:.0f} s", early,
            f"{np.median([r.seconds[-1] for r in those]):.0f} s",
        ))  # fmt: skip
    return "\n".join(markdown_table(names, rows)) + "\n"


def draw(runs: list[LearningCurve], path: Path) -> None:
    """Draw the curves of all seeds, a panel a scene: the share of the best known row's gain."""
    scenes = list(dict.fromkeys(run.scene for run in runs))
    figure, panels = new_panels(
        len(scenes), 2, (4.5, 2.6), (0.0, 0.0), "Agents learn to build: best row so far",
        "where its score lies between the best uniform row and the best known; a line a seed",
    )  # fmt: skip
    for panel, scene in zip(panels, scenes, strict=True):
        style(panel, scene)
        for run in (r for r in runs if r.scene == scene):
            share = (run.best - run.uniform) / (run.known - run.uniform)
            panel.plot(run.seconds, share, lw=1.5, color=SEED_COLOURS[run.seed % 3])
        panel.axhline(0.0, color=UNIFORM, ls="--", lw=1)
        panel.axhline(1.0, color=KNOWN, ls=":", lw=1)
        panel.set_ylim(-0.5, 1.08)
        panel.set_yticks([0.0, 0.8, 1.0], ["uniform", "80 %", "best known"])
        panel.set_xlim(0.0, None)
        panel.set_xlabel("processor seconds")
        panel.grid(axis="x", visible=False)
    write_png(figure, path)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m agents.lab.long_runs")
    parser.add_argument("scenes", nargs="*", default=SCENES, metavar="SCENE")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="how many, from 0 (%(default)s)")
    parser.add_argument("--algorithm", default="ppo")
    parser.add_argument("--out", type=Path, default=Path("runs/long"), help="%(default)s")
    parser.add_argument("--docs", type=Path, help="where to write the tables (--out)")
    arguments = parser.parse_args()
    for name in arguments.scenes:
        load_scene(name)
    runs = run_all(arguments.scenes, arguments.seeds, arguments.algorithm, arguments.out)
    write(runs, arguments.docs or arguments.out)
    print("\n" + table(runs))


if __name__ == "__main__":
    main()
