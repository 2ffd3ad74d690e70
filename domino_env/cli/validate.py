"""Compare measured chains with the model: friction fitted, each spacing left out in turn, reasons.

Without WHAT, all sources that ship. WHAT is the name of one, a .toml file of your own
(copy one from domino_env/validation/sources), or rows PITCH=FREQUENCY, in millimetres and
hits per second: domino validate 16=64.4 24=42.3 32=28.1
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from domino_env.validation.source import Source

SUMMARY = "measured chains beside the model, with the friction that explains them"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino validate`."""
    parser.add_argument("what", metavar="WHAT", nargs="*", help="a source, a file, or rows (all)")
    parser.add_argument("--json", metavar="FILE", help="write everything; '-' prints it alone")
    parser.add_argument(
        "--out",
        metavar="FOLDER",
        help="write the page (between its marks, if it is there) and its plot",
    )
    rows = parser.add_argument_group("rows given as PITCH=FREQUENCY")
    rows.add_argument("--thickness", type=float, default=7.5, help="[mm] (7.5)")
    rows.add_argument("--height", type=float, default=48.0, help="[mm] (48)")
    rows.add_argument("--gravity", type=float, default=9.81, help="[m/s²] (9.81)")
    rows.add_argument(
        "--uncertainty", type=float, default=2.0, help="one standard, of each [%%] (2)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Compare, print, write."""
    import json
    from pathlib import Path

    from domino_env.core.files import write_text
    from domino_env.core.tables import fill
    from domino_env.validation.measured import validate
    from domino_env.validation.measured_page import PAGE, PLOT, as_document, draw, markdown, text

    validations = [validate(source) for source in _sources(arguments)]
    if arguments.json:
        found = as_document(validations)
        told = json.dumps(found, indent=1, ensure_ascii=False, allow_nan=False)
        if arguments.json == "-":
            print(told)
            return 0
        write_text(Path(arguments.json), told + "\n")
    print("\n\n".join("\n".join(text(one)) for one in validations))
    held = sum(one.explained for one in validations)
    if len(validations) > 1:
        print(f"\n{held} of {len(validations)} sources explained")
    if arguments.out:
        folder = Path(arguments.out)
        page = folder / PAGE
        words = page.read_text("utf-8") if page.exists() else "<!-- sources -->\n<!-- end -->\n"
        draw(validations, folder / PLOT)
        write_text(page, fill(words, {"sources": markdown(validations)}))
        print(f"{page}, {folder / PLOT}")
    return 0


def _sources(arguments: argparse.Namespace) -> list[Source]:
    from pathlib import Path

    from domino_env.validation.source import read_source, shipped_sources, source_of_frequencies

    shipped, found, rows = shipped_sources(), [], []
    for word in arguments.what:
        if word in shipped:
            found.append(shipped[word])
        elif word.endswith(".toml"):
            found.append(read_source(Path(word)))
        elif "=" in word:
            rows.append(_pair(word))
        else:
            raise ValueError(
                f"'{word}': give a source ({', '.join(shipped)}), a .toml file, or rows as in "
                "16=64.4"
            )
    if rows:
        pitches, frequencies = zip(*rows, strict=True)
        sizes = 1e-3 * arguments.thickness, 1e-3 * arguments.height, arguments.gravity
        rest = (*sizes, 0.01 * arguments.uncertainty)
        found.append(source_of_frequencies(pitches, frequencies, *rest))
    return found or list(shipped.values())


def _pair(word: str) -> tuple[float, float]:
    """Read PITCH=FREQUENCY as a pitch [m] and hits per second."""
    try:
        pitch, told = map(float, word.split("="))
    except ValueError:
        raise ValueError(f"'{word}': write PITCH=FREQUENCY, as in 16=64.4") from None
    return 1e-3 * pitch, told
