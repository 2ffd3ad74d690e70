"""Golden digests: a check that a change keeps every bit of every result.

python tests/golden.py --write FILE    before the change
python tests/golden.py --check FILE    after it, with the same three files and on the same machine

The inputs (golden_layouts.py) are generated, and the results (golden_results.py) use public names
only, so that the same files run before and after a restructuring.  A digest covers a bundle
of results, and its name says which.  Bits differ from processor to processor and from one Numba to
the next: this is no test.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import time
from pathlib import Path

import numpy as np

# the packages of this tree come first: the folders of their tests have the same names
HERE = Path(__file__).parent
sys.path[:] = [str(HERE.parent), *sys.path[1:], str(HERE)]
from golden_results import GROUPS, Digests  # noqa: E402


def machine() -> dict[str, str]:
    """Return the software and hardware on which the bits depend besides the code."""
    import llvmlite.binding
    import numba

    return {
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "processor": llvmlite.binding.get_host_cpu_name(),
        "platform": platform.platform(),
    }


def digests_of(groups: list[str]) -> dict[str, str]:
    """Return all digests of the groups, as GROUP: NAME."""
    digests: dict[str, str] = {}
    for group in groups:
        began, group_digests = time.perf_counter(), Digests()
        GROUPS[group](group_digests)
        words = group_digests.finished()
        digests |= {f"{group}: {name}": word for name, word in words.items()}
        seconds = time.perf_counter() - began
        print(f"{group}: {len(words)} digests, {seconds:.1f} s", file=sys.stderr, flush=True)
    return digests


def check(file: Path, groups: list[str]) -> int:
    """Compare with a file; return 1 where anything differs."""
    written = json.loads(file.read_text("utf-8"))
    for name, value in machine().items():
        if written["machine"].get(name) != value:
            print(f"{name} is {value}, in the file {written['machine'].get(name)}: bits may differ")
    before = {
        name: word for name, word in written["digests"].items() if name.partition(":")[0] in groups
    }
    if not before:
        print(f"{file} contains no digests of {', '.join(groups)}")
        return 1
    now = digests_of(groups)
    changed = [name for name, word in before.items() if now.get(name) != word]
    for name in changed:
        print(f"differs: {name}" if name in now else f"is gone: {name}")
    for name in now.keys() - before.keys():
        print(f"is new, with nothing to compare it with: {name}")
    same = f"all {len(before)} digests are the same"
    print(f"{len(changed)} of {len(before)} digests differ" if changed else same)
    return int(bool(changed))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--write", type=Path, metavar="FILE", help="write the digests of this code")
    action.add_argument("--check", type=Path, metavar="FILE", help="compare this code with FILE")
    action.add_argument("--list", action="store_true", help="list the groups and their contents")
    parser.add_argument("--only", metavar="GROUP[,GROUP]", help="compute only these groups")
    arguments = parser.parse_args()
    if arguments.list:
        for name, group in GROUPS.items():
            print(f"{name:10} {group.__doc__}")
        return 0
    groups = arguments.only.split(",") if arguments.only else list(GROUPS)
    unknown = [group for group in groups if group not in GROUPS]
    if unknown:
        parser.error(f"there is no group {', '.join(unknown)}: choose from {', '.join(GROUPS)}")
    if arguments.check:
        return check(arguments.check, groups)
    document = {"machine": machine(), "digests": digests_of(groups)}
    arguments.write.write_text(json.dumps(document, indent=1) + "\n", "utf-8")
    print(f"{len(document['digests'])} digests in {arguments.write}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
