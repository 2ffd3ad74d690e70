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

from optimize.cli.options import add_store_option

if TYPE_CHECKING:
    from optimize.experiments.store import Store, Study
    from optimize.experiments.task import TaskResult

SUMMARY = "list, show and export stored results"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino studies`."""
    parser.add_argument(
        "action", nargs="?", choices=("list", "show", "export"), default="list", help="(list)"
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="the study to show or export")
    add_store_option(parser)
    parser.add_argument(
        "--to", metavar="FILE", help="export results to .csv or .parquet, a layout to .csv or .json"
    )
    parser.add_argument(
        "--best", metavar="SCENE", help="export the best layout of a scene, or point of a sweep"
    )


def run(arguments: argparse.Namespace) -> int:
    """List, show or export."""
    from domino_env.core.files import counted
    from optimize.experiments.store import export_study, open_store

    action, name = arguments.action, arguments.name
    if action != "list" and name is None:
        raise ValueError(f"name the study: domino studies {action} NAME")
    if action == "export" and arguments.to is None:
        raise ValueError("name the file to export to: --to FILE.csv or FILE.parquet")
    store = open_store(arguments.store, create=False)
    if action == "list":
        _list(store)
    elif action == "show":
        _show(store.study(name))
    elif arguments.best is None:
        number = export_study(store.study(name), Path(arguments.to))
        print(f"written to {arguments.to}: {counted(number, 'result')}")
    else:
        _export_best(store.study(name), arguments.to, arguments.best)
    return 0


def _list(store: Store) -> None:
    """Print a line for each study."""
    from domino_env.core.tables import text_table

    names = ("study", "kind", "tasks", "begun")
    lines = [(s.name, s.kind, f"{s.tasks:,}", s.begun) for s in store.studies()]
    table = text_table(names, lines, right={"tasks"})
    print("\n".join(table) if lines else f"{store.path} holds no studies yet")


def _show(study: Study) -> None:
    """Print a line for each problem and method of a study."""
    from domino_env.core.files import one_line
    from domino_env.core.tables import text_table
    from optimize.experiments.task import describe_labels

    results = study.done().values()
    about = f"{study.kind}, {len(results):,} finished tasks, begun {study.begun}"
    print(one_line(f"{study.name}: {about}"))
    if study.settings:
        print(one_line(describe_labels(study.settings)))
    groups: dict[tuple[str, str], list[TaskResult]] = {}
    for r in results:
        groups.setdefault((r.problem, r.method), []).append(r)
    names = ("problem", "method", "tasks", "best", "median", "uniform", "gain")
    lines = []
    for group, runs in groups.items():
        best = max(runs, key=lambda r: r.score)
        scores = best.score, median(r.score for r in runs), best.uniform_score
        gain = "" if best.gain is None else f"{best.gain:+.2%}"
        lines.append((*group, str(len(runs)), *map("{:.6g}".format, scores), gain))
    if lines:
        print("", *text_table(names, lines, right=names[2:]), sep="\n")


def _export_best(study: Study, path: str, name: str) -> None:
    """Write the best layout of a scene."""
    from domino_env.core.files import one_line
    from domino_env.scenes.io.reading import write_layout
    from optimize.experiments.store import best_result
    from optimize.experiments.task import scene_of

    r = best_result(study, name)
    beside = write_layout(r.layout, path, scene_of(r.scene))
    about = f"{r.scene_name}, {r.method}, seed {r.seed}, score {r.score:.6g}"
    print(one_line(f"written to {path}, the scene to {beside}: the layout of {about}"))
