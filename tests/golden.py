"""Golden digests: a check that a change keeps every bit of every result.

python tests/golden.py --write FILE    before the change
python tests/golden.py --check FILE    after it, with the same three files, machine and Numba

The inputs (golden_layouts.py) are generated, and the results (golden_results.py) use public names
only, so that the same files run before and after a restructuring.  A digest covers a bundle
of results, and its name says which.  Bits differ from processor to processor and from one Numba to
the next: this is no test.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

# the packages of this tree come first: the folders of their tests have the same names
HERE = Path(__file__).parent
sys.path[:] = [str(HERE.parent), *sys.path[1:], str(HERE)]
from golden_results import GROUPS, Digests  # noqa: E402


def digests_of(groups: list[str]) -> dict[str, str]:
    """Return all digests of the groups, as GROUP: NAME."""
    digests: dict[str, str] = {}
    for group in groups:
        began, group_digests = time.perf_counter(), Digests()
        GROUPS[group](group_digests)
        digests |= {f"{group}: {name}": word for name, word in group_digests.finished().items()}
        seconds = time.perf_counter() - began
        print(f"{group}: {seconds:.1f} s", file=sys.stderr, flush=True)
    return digests


def check(before: dict[str, str], now: dict[str, str]) -> int:
    """Print the names of digests that differ; return 1 if there are any."""
    differing = [name for name in before.keys() | now.keys() if before.get(name) != now.get(name)]
    print(*sorted(differing), f"{len(differing)} of {len(before)} digests differ", sep="\n")
    return int(bool(differing or not before))


def main() -> int:
    groups = "; ".join(f"{name}: {group.__doc__}" for name, group in GROUPS.items())
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0], epilog=groups)
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--write", type=Path, metavar="FILE", help="write the digests of this code")
    action.add_argument("--check", type=Path, metavar="FILE", help="compare this code with FILE")
    parser.add_argument("--only", nargs="+", choices=GROUPS, default=[*GROUPS], metavar="GROUP")
    arguments = parser.parse_args()
    digests = digests_of(arguments.only)
    if arguments.write:
        arguments.write.write_text(json.dumps(digests, indent=1) + "\n", "utf-8")
        return 0
    written = json.loads(arguments.check.read_text("utf-8"))
    chosen = {n: word for n, word in written.items() if n.partition(":")[0] in arguments.only}
    return check(chosen, digests)


if __name__ == "__main__":
    sys.exit(main())
