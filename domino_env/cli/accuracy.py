"""Measure the error of the simulator and of general ODE solvers against their run time.

Four standard layouts are simulated; --stability simulates the edge cases instead and compares
outcome, true error and error estimate. The output folder receives the table
(CSV) and the picture (PNG).
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import SECONDS, add_options, add_out_option

SUMMARY = "measure error against run time, simulate the edge cases"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino accuracy`."""
    parser.add_argument("--stability", action="store_true", help="simulate the edge cases")
    add_out_option(parser, "runs/accuracy")
    limit = "time limit for one solver on one layout [s]"
    add_options(parser, ("seconds", SECONDS, "S", 3.0, limit))
    parser.add_argument("--quick", action="store_true", help="few settings, short layouts")


def run(arguments: argparse.Namespace) -> int:
    """Measure, print and write; 1 where an edge case has a fault."""
    from pathlib import Path
    from typing import Any

    from tqdm import tqdm

    from domino_env.core.files import write_text
    from domino_env.validation import accuracy, edge_cases

    name = "stability" if arguments.stability else "accuracy"
    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    table, picture = folder / f"{name}.csv", folder / f"{name}.png"
    wrong, records = 0, list[Any]()
    # one line of the terminal, cleared at the end; disable=None: only on a terminal
    with tqdm(disable=None, bar_format="{desc}", leave=False, dynamic_ncols=True) as line:
        progress = line.set_description_str
        if arguments.stability:
            for case in edge_cases.edge_cases(10_000 if arguments.quick else 1_000_000):
                progress(str(case))
                records.append(edge_cases.examine(case))
            wrong = sum(bool(one.faults) for one in records)
            lines = [f"{one.group}, {one.name}: {one.faults}" for one in records if one.faults]
            lines += [f"{len(records)} edge cases: {wrong or 'none'} with a fault"]
            accuracy.draw_stability(records, picture)
        else:
            progress("compiling")
            examples = accuracy.standard_examples()
            records += accuracy.measure(examples, arguments.seconds, arguments.quick, progress)
            lines = accuracy.compare(records)
            accuracy.draw_accuracy(examples, records, picture)
    write_text(table, accuracy.as_csv(records))
    print("\n".join(lines) + f"\n\n{table}, {picture}")
    return 1 if wrong else 0
