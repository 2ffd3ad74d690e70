"""The figures on the cards of the policies that ship.

python -m agents.cards                          writes them anew
python -m agents.cards --check                  compares them with what the cards say
python -m agents.cards --search [--workers 2]   searches the scenes of the test sets anew, before

A card is the README.md beside the weights: what the policy was trained on, what it scores, where it
ends. What stands between the two marks of a card is written here; no times, which differ from
machine to machine. The searches, whose gain policies are compared with, take ten minutes of one
core for the 200 scenes of each set.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import numpy as np

from agents.dataset import search_rows
from agents.evaluation import SEARCHED, evaluate, evaluate_scenes, scenes_of, searched_scores
from agents.policy import DESIGNER, POLICIES, shipped
from domino_env.core.files import write_text
from domino_env.core.tables import markdown_table, write_csv
from domino_env.scenes.pool import load_test_set
from optimize.executors import add_executor_options, executor_from
from optimize.experiments.best_known import best_known

CARD = "README.md"
SETS = ("varied", "varied-thickness", "varied-course")
EVALUATIONS, SEED = 2500, 1  # of the searches
MARKED = re.compile(r"(?<=<!-- figures -->\n).*?(?=<!-- end -->)", re.DOTALL)


def card_of(name: str) -> Path:
    """Give the card of a policy that ships."""
    return POLICIES / name / CARD


def figures(name: str, scenes: int = 200) -> str:
    """Evaluate a policy, and give the table of its card.

    Parameters
    ----------
    name
        Of a policy that ships.
    scenes
        Of each test set, for the scene-conditioned policy.
    """
    if name == DESIGNER:
        return _many(scenes)
    built = evaluate(name)
    uniform, known = built.uniform.score, best_known()[built.scene.name].score
    part = (built.score - uniform) / (known - uniform)
    return "\n".join(
        markdown_table(
            ("row", "score [m/s]", "part of the best known row's gain"),
            [
                ("best uniform", f"{uniform:.5f}", ""),
                ("this policy's", f"{built.score:.5f}", f"{part:.1%}"),
                ("best known", f"{known:.5f}", ""),
            ],
        )
    )


def _many(scenes: int) -> str:
    names = (
        "test set", "row", "beats uniform", "median gain", "tenth percentile",
        "median part of the search's gain", "tenth percentile", "dies", "loses where search wins",
    )  # fmt: skip
    rows = []
    for kind in SETS:
        searched = searched_scores(kind, scenes)
        found = evaluate_scenes(scenes_of(kind, scenes), searched=searched)
        for row, scores in (("design", found.designed), ("its proposal", found.proposed)):
            gains = found.gains(scores)
            rows.append((
                kind, row, f"{np.mean(gains > 1e-9):.1%}", f"{np.median(gains):.2%}",
                f"{np.quantile(gains, 0.1):.2%}", f"{found.share(scores):.1%}",
                f"{found.share(scores, 0.1):.1%}", str(int(np.sum(scores <= 0.0))),
                str(found.missed(scores)),
            ))  # fmt: skip
    return "\n".join(markdown_table(names, rows))


def search_sets(arguments: argparse.Namespace) -> None:
    """Search the scenes of the test sets, and write their scores; runs/ keeps what was searched."""
    lines = []
    with executor_from(arguments) as executor:
        for name in SETS:
            store = Path("runs") / f"searched-{name}.sqlite"
            rows = search_rows(
                load_test_set(name), EVALUATIONS, SEED, store, {"test set": name}, executor,
                progress=None,
            )  # fmt: skip
            lines += [(name, i, f"{row.score:.10g}") for i, row in enumerate(rows)]
    write_csv(SEARCHED, ("set", "scene", "score"), lines)


def main() -> int:
    """Write the figures, or compare them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="write nothing, exit 1 if they differ")
    parser.add_argument("--search", action="store_true", help="search the test sets before")
    add_executor_options(parser)
    arguments = parser.parse_args()
    if arguments.search:
        search_sets(arguments)
    stale = []
    for name in (*shipped(), DESIGNER):
        card, table = card_of(name), figures(name)
        print(f"{name}\n{table}\n")
        text = card.read_text("utf-8")
        new = MARKED.sub(f"{table}\n", text)  # no backslash stands in it
        if new != text:
            stale.append(name)
            if not arguments.check:
                write_text(card, new)
    if arguments.check and stale:
        print(f"other figures stand on the card of {', '.join(stale)}")
    return int(arguments.check and bool(stale))


if __name__ == "__main__":
    raise SystemExit(main())
