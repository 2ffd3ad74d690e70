"""Compare measured chains with the model.

The results are the fitted friction, leave-one-out predictions and a verdict. SOURCE is the name of
a shipped source, your own .toml file (copy one from domino_env/validation/sources), or a chain as
PITCH=FREQUENCY in millimetres and hits per second:

domino validate 16=64.4 24=42.3 32=28.1
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from domino_env.cli.options import SIZE, add_options, add_out_option

if TYPE_CHECKING:
    from domino_env.validation.source import Source


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino validate`."""
    parser.add_argument(
        "sources", metavar="SOURCE", nargs="*", help="name, .toml file or PITCH=FREQUENCY (all)"
    )
    add_out_option(parser, "none", literal=False)
    add_options(
        parser.add_argument_group("chains given as PITCH=FREQUENCY"),
        ("thickness", SIZE, "MM", 7.5, "thickness of the dominoes [mm]"),
        ("height", SIZE, "MM", 48.0, "height of the dominoes [mm]"),
    )


def run(arguments: argparse.Namespace) -> int:
    """Compare the sources with the model, print the results, write page and tables on request."""
    from domino_env.core.files import write_text
    from domino_env.core.tables import fill_tables
    from domino_env.validation import measured_page as pages
    from domino_env.validation.measured import validate

    validations = [validate(source) for source in _sources(arguments)]
    print("\n\n".join("\n".join(pages.text(v)) for v in validations))
    explained = sum(v.explained for v in validations)
    if len(validations) > 1:
        print(f"\n{explained} of {len(validations)} sources explained")
    if arguments.out:
        page, plot = arguments.out / pages.PAGE, arguments.out / pages.PLOT
        # of an existing page only the part between these marks is replaced
        old = page.read_text("utf-8") if page.exists() else "<!-- sources -->\n<!-- end -->\n"
        pages.draw(validations, plot)
        write_text(page, fill_tables(old, {"sources": pages.markdown(validations)}))
        write_text(arguments.out / pages.CHAINS, pages.chain_table(validations))
        write_text(arguments.out / pages.READINGS, pages.reading_table(validations))
        print(f"{page}, {plot}, {pages.CHAINS}, {pages.READINGS}")
    return 0


def _sources(arguments: argparse.Namespace) -> list[Source]:
    """Return the named sources in order, then one of all chains given as PITCH=FREQUENCY."""
    from domino_env.validation.source import TEMPLATE, Source, read_source, shipped_sources

    shipped, sources, chains = shipped_sources(), [], []
    for word in arguments.sources:
        if word in shipped:
            sources.append(shipped[word])
        elif word.endswith(".toml"):
            sources.append(read_source(Path(word)))
        elif "=" in word:
            chains.append(_parse_chain(word))
        else:
            raise ValueError(
                f"'{word}': give a source ({', '.join(shipped)}), a .toml file, or a chain such "
                "as 16=64.4 (PITCH=FREQUENCY [mm, 1/s])"
            )
    if chains:
        pitches, frequencies = zip(*chains, strict=True)
        sizes = {name: 1e-3 * getattr(arguments, name) for name in ("thickness", "height")}
        own = Source.from_frequencies(pitches, frequencies, x_uncertainty=TEMPLATE, **sizes)
        sources.append(own)
    return sources or list(shipped.values())


def _parse_chain(word: str) -> tuple[float, float]:
    """Return pitch [m] and frequency [1/s] of a chain given as PITCH=FREQUENCY [mm, 1/s]."""
    try:
        pitch, frequency = map(float, word.split("="))
    except ValueError:
        raise ValueError(f"'{word}': write PITCH=FREQUENCY [mm, 1/s], as in 16=64.4") from None
    return 1e-3 * pitch, frequency
