"""Show how exact the answers are, and what accuracy costs.

Without an option: true error against run time for the steppers of the field and for our solver, on
four standard rows or on a scene's.  --stability: rows at the edge, each with its outcome, its true
error and what the run said its error is.  --savings: what leaving out pays.

OUT gets the table (CSV) and the pictures (PNG).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

SUMMARY = "error against run time, rows at the edge, and what leaving out pays"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino accuracy`."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--stability", action="store_true", help="rows at the edge, judged")
    what.add_argument("--savings", action="store_true", help="what leaving out pays, as ratios")
    what.add_argument("--scene", help="a scene's rows instead, by name or .toml file")
    parser.add_argument("--out", metavar="FOLDER", help="for tables and pictures (runs/accuracy)")
    parser.add_argument(
        "--budget", type=float, default=3.0, help="seconds for one solver on one row (3)"
    )
    parser.add_argument("--quick", action="store_true", help="few settings, short rows: seconds")


def run(arguments: argparse.Namespace) -> int:
    """Measure, print, write; 1 where a row at the edge is not answered as it should be."""
    if not arguments.budget > 0.0:
        raise ValueError(f"--budget {arguments.budget}: give seconds, more than 0")
    folder = Path(arguments.out or "runs/accuracy")
    folder.mkdir(parents=True, exist_ok=True)
    if arguments.stability:
        return _stability(folder, arguments.quick)
    if arguments.savings:
        return _savings(folder, arguments.quick)
    return _error_against_time(folder, arguments)


def _error_against_time(folder: Path, arguments: argparse.Namespace) -> int:
    from domino_env.core.files import write_text
    from domino_env.scenes.io.reading import load_scene
    from domino_env.validation.accuracy.measurement import (
        as_csv,
        compare,
        measure,
        scene_rows,
        standard_rows,
    )
    from domino_env.validation.accuracy.pictures import draw_accuracy

    with _progress() as tell:
        tell("compiling, and preparing the rows")
        rows = scene_rows(load_scene(arguments.scene)) if arguments.scene else standard_rows()
        runs = list(measure(rows, arguments.budget, arguments.quick, tell))
    print("\n".join(compare(runs)))
    write_text(folder / "accuracy.csv", as_csv(runs))
    draw_accuracy(rows, runs, folder / "accuracy.png")
    print(f"\n{folder / 'accuracy.csv'}, {folder / 'accuracy.png'}")
    return 0


def _stability(folder: Path, quick: bool) -> int:
    from domino_env.core.files import write_text
    from domino_env.validation.accuracy.pictures import draw_stability
    from domino_env.validation.accuracy.stability import as_csv, as_table, stability

    with _progress() as tell:
        verdicts = list(stability(quick, tell))
    print("\n".join(as_table(verdicts)))
    wrong = sum(bool(v.complaints) for v in verdicts)
    judged = (
        f"{wrong} not answered as they should be" if wrong else "all answered as they should be"
    )
    print(f"\n{len(verdicts)} rows at the edge: {judged}")
    write_text(folder / "stability.csv", as_csv(verdicts))
    draw_stability(verdicts, folder / "stability.png")
    print(f"{folder / 'stability.csv'}, {folder / 'stability.png'}")
    return 1 if wrong else 0


def _savings(folder: Path, quick: bool) -> int:
    from domino_env.core.files import write_text
    from domino_env.validation.accuracy.savings import as_csv, as_table, savings

    with _progress() as tell:
        found = list(savings(0.01 if quick else 0.4, tell))
    print("\n".join(as_table(found)))
    write_text(folder / "savings.csv", as_csv(found))
    print(f"\n{folder / 'savings.csv'}")
    return 0


@contextmanager
def _progress() -> Iterator[Callable[[str], object]]:
    """Say what is going on, in a line of the terminal that is wiped at the end."""
    from tqdm import tqdm

    looks = {"bar_format": "{desc}", "leave": False, "dynamic_ncols": True}
    with tqdm(disable=None, **looks) as line:  # None: only on a terminal
        yield line.set_description_str
