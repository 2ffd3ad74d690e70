"""List, show and export studies: the stored results of domino compare and domino sweep.

domino studies                                    all studies of a store, one line each
domino studies show NAME                          best and median of each scene and method
domino studies export NAME --to FILE              every result, as .csv or .parquet
domino studies export NAME --best SCENE --to FILE the best layout of a scene, as .csv or .json

A store is an SQLite file; any tool for these can query it too.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from optimize.cli.options import add_store_option, write_layout

if TYPE_CHECKING:
    from optimize.experiments.store import Store, Study
    from optimize.experiments.task import TaskResult

SUMMARY = "list, show and export stored results"
SHOWN = 50  # lines of a table where not all are asked for
LONGEST_SETTINGS = 400  # characters


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino studies`."""
    parser.add_argument(
        "action", nargs="?", choices=("list", "show", "export"), default="list", help="(list)"
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="the study to show or export")
    add_store_option(parser)
    parser.add_argument(
        "--to",
        metavar="FILE",
        help="export results to .csv or .parquet, a layout to .csv or .json",
    )
    parser.add_argument(
        "--best", nargs="?", const="", metavar="SCENE",
        help="export the best layout of a scene, or of the result with this key",
    )  # fmt: skip
    parser.add_argument("--all", action="store_true", help="show: print every line of a long table")


def run(arguments: argparse.Namespace) -> int:
    """List, show or export."""
    from optimize.experiments.store import export_study, open_store

    action, name = arguments.action, arguments.name
    if action != "list" and name is None:
        raise ValueError(f"name the study: domino studies {action} NAME")
    if action == "list" and name is not None:
        raise ValueError(f"to see one study: domino studies show {name}")
    if action == "export" and arguments.to is None:
        raise ValueError("name the file to export to: --to FILE.csv or FILE.parquet")
    if action != "export" and (arguments.to is not None or arguments.best is not None):
        raise ValueError("--to and --best belong to domino studies export NAME")
    store = open_store(arguments.store, create=False)
    if action == "list":
        _list(store)
    elif action == "show":
        _show(store.study(name), everything=arguments.all)
    elif arguments.best is None:
        number = export_study(store.study(name), Path(arguments.to))
        print(f"written to {arguments.to}: {number:,} results")
    else:
        _export_best(store.study(name), arguments.to, arguments.best or None)
    return 0


def _list(store: Store) -> None:
    from domino_env.core.tables import text_table

    found = store.studies()
    if not found:
        print(f"{store.path} holds no studies yet")
        return
    names = ("study", "kind", "tasks", "begun (UTC)")
    rows = [(s.name, s.kind, f"{s.tasks:,}", _clock(s.begun)) for s in found]
    print("\n".join(text_table(names, rows, right={"tasks"})))


def _show(study: Study, *, everything: bool) -> None:
    from domino_env.core.files import one_line
    from domino_env.core.tables import text_table
    from optimize.experiments.task import describe_labels

    results = study.done().values()
    about = f"{study.kind}, {len(results):,} finished tasks, begun {_clock(study.begun)} UTC"
    print(one_line(f"{study.name}: {about}"))
    if study.settings:
        told = ", ".join(f"{key} = {value}" for key, value in study.settings.items())
        print(one_line(told, LONGEST_SETTINGS))
    groups: dict[tuple[str, str, str], list[TaskResult]] = {}
    for result in results:
        labels = describe_labels(result.labels)
        groups.setdefault((result.scene_name, labels, result.method), []).append(result)
    names = ["scene", "labels", "method", "tasks", "best", "median", "uniform", "gain", "key"]
    rows = []
    for group, of in groups.items():
        best = max(of, key=lambda r: r.score)
        scores = best.score, median(r.score for r in of), best.uniform_score
        gain = "" if best.gain is None else f"{best.gain:+.2%}"
        words = (f"{score:.6g}" for score in scores)
        rows.append([*group, str(len(of)), *words, gain, best.key[:8]])
    if not any(labels for _, labels, _ in groups):
        names, rows = [names[0], *names[2:]], [[row[0], *row[2:]] for row in rows]
    if rows:
        shown = rows if everything else rows[:SHOWN]
        print("", *text_table(names, shown, right=names[-6:-1]), sep="\n")
        if len(shown) < len(rows):
            print(f"… and {len(rows) - len(shown):,} lines more: --all shows them")


def _export_best(study: Study, path: str, which: str | None) -> None:
    from domino_env.core.files import one_line
    from optimize.experiments.store import best_result

    result = best_result(study, which)
    write_layout(result.layout, path)
    told = f"{result.scene_name}, {result.method}, seed {result.seed}, score {result.score:.6g}"
    print(one_line(f"written to {path}: the layout of {told}"))


def _clock(begun: str) -> str:
    return begun.removesuffix("+00:00").replace("T", " ")
