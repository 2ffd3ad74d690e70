"""List, show and export stored results.

domino studies                                    all studies of a store, one line each
domino studies show NAME                          best and median of each scene and method
domino studies export NAME --to FILE              every result, as .csv or .parquet
domino studies export NAME --best SCENE --to FILE the best layout of a scene, as .csv or .json

A store is an SQLite file, which any tool for SQLite can query.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from domino_env.cli.options import add_options
from optimize.cli.options import STORE


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino studies`."""
    parser.add_argument(
        "action", nargs="?", choices=("list", "show", "export"), default="list", help="(list)"
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="the study to show or export")
    target = "export results to .csv or .parquet, a layout to .csv or .json"
    best = "export the best layout of a scene, or point of a sweep"
    to_export = ("to", str, "FILE", None, target), ("best", str, "SCENE", None, best)
    add_options(parser, STORE, *to_export)


def run(arguments: argparse.Namespace) -> int:
    """List the studies, or show or export one."""
    from domino_env.core.files import amount, one_line
    from domino_env.scenes.io.reading import write_layout
    from optimize.experiments import report, store
    from optimize.experiments.task import read_scene

    action, name = arguments.action, arguments.name
    if action != "list" and name is None:
        raise ValueError(f"name the study: domino studies {action} NAME")
    if action == "export" and arguments.to is None:
        raise ValueError("name the file to export to: --to FILE.csv or FILE.parquet")
    if action != "export" and (arguments.to or arguments.best):
        raise ValueError("--to and --best belong to domino studies export: leave them out")
    if action == "list" and name is not None:
        raise ValueError(f"domino studies list takes no name: domino studies show {name}")
    studies = store.open_store(arguments.store, create=False)
    if action == "list":
        print("\n".join(report.list_studies(studies)))
    elif action == "show":
        print("\n".join(report.summarise(studies.study(name))))
    elif arguments.best is None:
        number = store.export_study(studies.study(name), Path(arguments.to))
        print(f"written to {arguments.to}: {amount(number, 'result')}")
    else:
        best = store.best_result(studies.study(name), arguments.best)
        path = write_layout(best.layout, arguments.to, read_scene(best.scene))
        search = f"{best.scene_name}, {best.method}, seed {best.seed}, score {best.score:.6g}"
        print(one_line(f"written to {arguments.to}, the scene to {path}: the layout of {search}"))
    return 0
