"""What trains a designer best: imitation, the gradient of its own rows, or both.

    python -m agents.lab.comparison --out runs/family-comparison

trains all of them (half an hour on one core), goes on where it was stopped, evaluates each on the
same scenes, new to all, and writes comparison.md. Figures: docs/family.md.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from agents.base.run_files import CHECKPOINT, is_finished
from agents.conditioned.distribution import SceneDistribution
from agents.conditioned.examples import make_examples
from agents.conditioned.policy import ConditionedPolicy
from agents.conditioned.preset import ConditionedPreset
from agents.conditioned.training import train_conditioned
from agents.evaluation.many_scenes import ScenesEvaluation, evaluate_scenes
from domino_env.support.files import write_text
from domino_env.support.tables import markdown_table

WAYS = {
    "imitation": replace(ConditionedPreset(), batches=0),
    "exact slope": replace(ConditionedPreset(), examples=0, batches=800),
    "imitation, then exact slope": ConditionedPreset(),
}
SEARCHED = 2500  # evaluations of the search that each scene is compared with


def compare(
    home: Path,
    number: int = 200,
    scenes_seed: int = 1,
    seed: int = 0,
    *,
    progress: bool | None = False,
) -> str:
    """Train a policy in every way that is not trained yet, and evaluate all.

    Parameters
    ----------
    home
        Folder of the trainings.
    number, scenes_seed
        How many scenes they are evaluated on, and the seed that draws these.
    seed
        Of the trainings.
    progress
        Whether to show progress bars; None: on a terminal, elsewhere a line now and then.

    Returns
    -------
    str
        A table in Markdown.
    """
    distribution, examples = SceneDistribution(), home / "examples.npz"
    for name, plan in WAYS.items():
        folder = home / name.replace(", ", "-").replace(" ", "-")
        if not is_finished(folder):
            train_conditioned(
                folder, seed, plan, distribution,
                examples=examples, resume=(folder / CHECKPOINT).exists(), progress=progress,
            )  # fmt: skip
    unseen = make_examples(
        distribution, number, scenes_seed, SEARCHED, home / "unseen.npz", progress
    )
    names = (
        "trained by", "beats the best uniform row", "median gain",
        "median part of the search's gain", "the same with the plan untried: beats", "part", "dies",
    )  # fmt: skip
    rows = []
    for name in WAYS:
        folder = home / name.replace(", ", "-").replace(" ", "-")
        policy = ConditionedPolicy.load(folder)
        rows.append(_cells(name, evaluate_scenes(number, scenes_seed, policy, examples=unseen)))
    return "\n".join(markdown_table(names, rows)) + "\n"


def _cells(name: str, found: ScenesEvaluation) -> tuple[str, ...]:
    gain = float(np.median(found.gains(found.tried)))
    return (
        name, f"{found.beaten(found.tried):.1%}", f"{gain:+.2%}",
        f"{found.share(found.tried):.1%}", f"{found.beaten(found.untried):.1%}",
        f"{found.share(found.untried):.1%}",
        f"{int((found.untried <= 0.0).sum())} of {len(found.tried)}",
    )  # fmt: skip


def main() -> None:
    """Run the script."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/family-comparison"))
    parser.add_argument("--scenes", type=int, default=200)
    arguments = parser.parse_args()
    table = compare(arguments.out, arguments.scenes, progress=None)
    write_text(arguments.out / "comparison.md", table)
    print(table)


if __name__ == "__main__":
    main()
