"""Measure errors against run times, or simulate edge cases.

Four standard layouts are simulated, and solved by general ODE solvers. With --stability, the edge
cases are simulated instead, and outcome, true error and error estimate are compared. The output
folder receives a table (CSV) and a picture (PNG).
"""

from __future__ import annotations

import argparse

from domino_env.cli.options import SECONDS, add_flags, add_options, add_out_option


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino accuracy`."""
    add_out_option(parser, "runs/accuracy")
    limit = "time limit for one solver on one layout [s]"
    add_options(parser, ("seconds", SECONDS, "S", 3.0, limit))
    add_flags(parser, stability="simulate edge cases", quick="few settings, short layouts")


def run(arguments: argparse.Namespace) -> int:
    """Measure errors, print and write them; return 1 if an edge case has a fault, else 0."""
    from typing import Any

    from tqdm import tqdm

    from domino_env.core.files import write_text
    from domino_env.validation import accuracy, edge_cases

    name = "stability" if arguments.stability else "accuracy"
    table, picture = arguments.out / f"{name}.csv", arguments.out / f"{name}.png"
    faulty, records = list[Any](), list[Any]()
    # a status line, which is cleared at the end; disable=None shows it only on a terminal
    with tqdm(disable=None, bar_format="{desc}", leave=False, dynamic_ncols=True) as line:
        progress = line.set_description_str
        if arguments.stability:
            for case in edge_cases.edge_cases(longest=10_000 if arguments.quick else 1_000_000):
                progress(str(case))
                records.append(edge_cases.examine(case))
            faulty = [record for record in records if record.faults]
            lines = [f"{case.group}, {case.name}: {case.faults}" for case in faulty]
            lines += [f"{len(records)} edge cases: {len(faulty) or 'none'} with a fault"]
            accuracy.draw_stability(records, picture)
        else:
            progress("compiling")
            examples = accuracy.standard_examples()
            records += accuracy.measure(examples, arguments.seconds, arguments.quick, progress)
            lines = accuracy.compare(records)
            accuracy.draw_accuracy(examples, records, picture)
    write_text(table, accuracy.as_csv(records))
    print("\n".join(lines) + f"\n\n{table}, {picture}")
    return 1 if faulty else 0
