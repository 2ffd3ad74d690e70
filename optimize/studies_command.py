"""List, show and export studies: what domino compare and domino sweep have kept in a store.

domino studies                                    all studies of a store, a line each
domino studies show NAME                          best and median of each scene and method
domino studies export NAME --to FILE              every result, as .csv or .parquet
domino studies export NAME --best SCENE --to FILE the best row of a scene, as .csv or .json

A store is an SQLite file or a PostgreSQL URL; any tool for these can query it too.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from optimize.store import DEFAULT_STORE

if TYPE_CHECKING:
    from optimize.store import Store
    from optimize.task import TaskResult

SUMMARY = "list, show and export what comparisons and sweeps have found"
SHOWN = 50  # lines of a table where not all are asked for


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `domino studies`."""
    parser.add_argument(
        "action", nargs="?", choices=("list", "show", "export"), default="list", help="(list)"
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="the study to show or export")
    parser.add_argument(
        "--store", default=DEFAULT_STORE, metavar="WHERE", help=f"file or URL ({DEFAULT_STORE})"
    )
    parser.add_argument("--to", metavar="FILE", help="export: .csv, .parquet; a row: .csv, .json")
    parser.add_argument(
        "--best",
        nargs="?",
        const="",
        metavar="SCENE",
        help="export the best row of a scene (or of a result, by its key) instead of the table",
    )
    parser.add_argument("--all", action="store_true", help="show: every line of a long table")


def run(arguments: argparse.Namespace) -> int:
    """List, show or export."""
    if arguments.action != "list" and arguments.name is None:
        raise ValueError(f"name the study: domino studies {arguments.action} NAME")
    if arguments.action == "list" and arguments.name is not None:
        raise ValueError(f"to see one study: domino studies show {plain(arguments.name)}")
    exports = arguments.action == "export"
    if exports and arguments.to is None:
        raise ValueError("name the file to export to: --to FILE.csv or FILE.parquet")
    if not exports and (arguments.to is not None or arguments.best is not None):
        raise ValueError("--to and --best belong to domino studies export NAME")
    from optimize.store import open_store

    try:
        store = open_store(arguments.store, create=False)
        if arguments.action == "list":
            _list(store)
        elif arguments.action == "show":
            _show(store, arguments.name, arguments.all)
        else:
            _export(store, arguments.name, Path(arguments.to), arguments.best)
    except ValueError as error:  # names in its sentence may be a stranger's
        raise ValueError(plain(str(error))) from None
    return 0


def _list(store: Store) -> None:
    found = store.studies()
    if not found:
        print(f"{store.where} holds no studies yet")
        return
    lines = [("study", "kind", "tasks", "begun (UTC)")]
    lines += [
        (s.name, s.kind, f"{s.tasks:,}", s.begun.removesuffix("+00:00").replace("T", " "))
        for s in found
    ]
    _print(lines, right={2})


def _show(store: Store, name: str, everything: bool) -> None:
    info = next((s for s in store.studies() if s.name == name), None)
    results = store.study(name).done().values()
    assert info is not None  # study() has found it
    print(plain(f"{info.name}: {info.kind}, {info.tasks:,} finished tasks, begun {info.begun} UTC"))
    if info.settings:
        told = ", ".join(f"{key} = {value}" for key, value in info.settings.items())
        print(plain(told if len(told) <= 400 else told[:399] + "…"))
    if not results:
        return
    groups: dict[tuple[str, str, str], list[TaskResult]] = {}
    for result in results:
        labels = ", ".join(f"{key} = {value}" for key, value in result.labels)
        groups.setdefault((result.scene_name, labels, result.method), []).append(result)
    labelled = any(labels for _, labels, _ in groups)
    lines: list[tuple[str, ...]] = [
        ("scene", "labels", "method", "tasks", "best", "median", "uniform", "gain", "key")
    ]
    for (scene, labels, method), of in groups.items():
        best = max(of, key=lambda r: r.score)
        gain = "" if best.gain is None else f"{best.gain:+.2%}"
        scores = best.score, median(r.score for r in of), best.uniform_score
        words = [f"{score:.6g}" for score in scores]
        lines.append((scene, labels, method, str(len(of)), *words, gain, best.key[:8]))
    if not labelled:
        lines = [line[:1] + line[2:] for line in lines]
    shown = lines if everything else lines[: SHOWN + 1]
    numbers = {len(lines[0]) - back for back in range(2, 7)}
    print()
    _print(shown, right=numbers)
    if len(shown) < len(lines):
        print(f"… and {len(lines) - len(shown):,} lines more: --all shows them")


def _export(store: Store, name: str, path: Path, best: str | None) -> None:
    from optimize.study_export import best_layout, export

    study = store.study(name)
    if best is None:
        count = export(study, path)
        print(f"written to {plain(str(path))}: {count:,} results")
        return
    write = {".csv": "to_csv", ".json": "to_json"}.get(path.suffix.lower())
    if write is None:
        raise ValueError(f"{path}: a row is written to a .csv or .json file")
    result, layout = best_layout(study, best or None)
    try:
        getattr(layout, write)(path)
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {error.strerror}") from None
    told = f"{result.scene_name}, {result.method}, seed {result.seed}, score {result.score:.6g}"
    print(plain(f"written to {path}: the row of {told}"))


def plain(text: str) -> str:
    """Text that is safe to print: nothing in it moves a cursor or turns a line."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _print(lines: Iterable[tuple[str, ...]], right: set[int]) -> None:
    """A table, columns as wide as their widest cell."""
    table = [[cell if len(cell) <= 60 else cell[:59] + "…" for cell in line] for line in lines]
    table = [[plain(cell) for cell in line] for line in table]
    widths = [max(len(line[i]) for line in table) for i in range(len(table[0]))]
    for line in table:
        cells = [
            cell.rjust(width) if i in right else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ]
        print("  ".join(cells).rstrip())
