"""What search finds in the scenes of the test sets, to compare policies with.

python -m agents.evaluation.searched [--scenes 200] [--workers 2]    searches them anew

200 scenes of each set take ten minutes of one core.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.dataset.rows import search_rows
from domino_env.core.tables import write_csv
from domino_env.scenes.pool import load_test_set
from optimize.executors.choice import add_executor_options, asked_executor

Floats = NDArray[np.float64]

FILE = Path(__file__).with_name("searched.csv")
SETS = ("varied", "varied-thickness", "varied-course")
EVALUATIONS, SEED = 2500, 1


def searched_scores(name: str, number: int) -> Floats | None:
    """Give the scores that `auto` found in the first scenes of a test set, in 2500 evaluations.

    Parameters
    ----------
    name
        Of the set.
    number
        Of scenes.

    Returns
    -------
    NDArray or None
        (number,) scores, nan where none was searched; None where there are none at all.
    """
    found = np.full(number, np.nan)
    with FILE.open(newline="", encoding="utf-8") as lines:
        for row in csv.DictReader(lines):
            if row["set"] == name and int(row["scene"]) < number:
                found[int(row["scene"])] = float(row["score"])
    return found if np.isfinite(found).any() else None


def main() -> None:
    """Search them, and write the file; what was searched is kept in runs/."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=200, help="of each set (200)")
    parser.add_argument("--runs", type=Path, default=Path("runs"))
    add_executor_options(parser)
    arguments = parser.parse_args()
    rows = []
    with asked_executor(arguments) as executor:
        for name in SETS:
            scenes = load_test_set(name)[: arguments.scenes]
            found = search_rows(
                scenes, EVALUATIONS, SEED, arguments.runs / f"searched-{name}.sqlite",
                {"test set": name}, executor, progress=None,
            )  # fmt: skip
            rows += [(name, i, f"{row.score:.10g}") for i, row in enumerate(found)]
    write_csv(FILE, ("set", "scene", "score"), rows)


if __name__ == "__main__":
    main()
