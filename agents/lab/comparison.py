"""What trains a designer best: imitation, the gradient of its own rows, or both.

    python -m agents.lab.comparison --out runs/family-comparison

trains all of them (half an hour on one core), goes on where it was stopped, evaluates each on the
same scenes, new to all, and writes comparison.md. Figures: docs/family.md.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from agents.conditioned.distribution import SceneFamily
from agents.conditioned.evaluation import Judged, judge
from agents.conditioned.examples import make_examples
from agents.conditioned.policy import load_designer
from agents.conditioned.preset import Teaching
from agents.conditioned.training import teach
from domino_env.support.files import write_text
from domino_env.support.tables import markdown_table

WAYS = {
    "imitation": replace(Teaching(), batches=0),
    "exact slope": replace(Teaching(), examples=0, batches=800),
    "imitation, then exact slope": Teaching(),
}
SEARCHED = 2500  # evaluations of the search that each scene is compared with


def compare(
    home: Path, number: int = 200, scenes_seed: int = 1, seed: int = 0, *, progress: bool = False
) -> str:
    """Train a designer in every way that is not trained yet, and evaluate all.

    Parameters
    ----------
    home
        Folder of the trainings.
    number, scenes_seed
        How many scenes they are evaluated on, and the seed that draws these.
    seed
        Of the trainings.
    progress
        Whether to show progress bars.

    Returns
    -------
    str
        A table in Markdown.
    """
    family, examples = SceneFamily(), home / "examples.npz"
    for name, plan in WAYS.items():
        folder = home / name.replace(", ", "-").replace(" ", "-")
        if not _finished(folder):
            teach(
                folder, seed, plan, family,
                examples=examples, resume=(folder / "checkpoint.pt").exists(), progress=progress,
            )  # fmt: skip
    unseen = make_examples(family, number, scenes_seed, SEARCHED, home / "unseen.npz", progress)
    names = (
        "taught by", "beats the best uniform row", "median gain",
        "median part of the search's gain", "the same with the plan untried: beats", "part", "dies",
    )  # fmt: skip
    rows = []
    for name in WAYS:
        folder = home / name.replace(", ", "-").replace(" ", "-")
        designer = load_designer(folder / "policy.npz")
        rows.append(_cells(name, judge(number, scenes_seed, designer, examples=unseen)))
    return "\n".join(markdown_table(names, rows)) + "\n"


def _cells(name: str, judged: Judged) -> tuple[str, ...]:
    gain = float(np.median(judged.gains(judged.tried)))
    return (
        name, f"{judged.beaten(judged.tried):.1%}", f"{gain:+.2%}",
        f"{judged.share(judged.tried):.1%}", f"{judged.beaten(judged.untried):.1%}",
        f"{judged.share(judged.untried):.1%}",
        f"{int((judged.untried <= 0.0).sum())} of {len(judged.tried)}",
    )  # fmt: skip


def _finished(folder: Path) -> bool:
    summary = folder / "summary.json"
    return summary.exists() and bool(json.loads(summary.read_text("utf-8"))["finished"])


def main() -> None:
    """Run the script."""
    import sys

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/family-comparison"))
    parser.add_argument("--scenes", type=int, default=200)
    arguments = parser.parse_args()
    table = compare(arguments.out, arguments.scenes, progress=sys.stderr.isatty())
    write_text(arguments.out / "comparison.md", table)
    print(table)


if __name__ == "__main__":
    main()
