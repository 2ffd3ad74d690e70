"""Progress of long tasks, notices and advice."""

from __future__ import annotations

import logging
import sys
import warnings
from typing import Any

EVERY = 30.0  # [s] between two lines where there is no terminal
LINE = "{percentage:.0f} %, {n_fmt} of {total_fmt}{unit} in {elapsed}, {remaining} left{postfix}"


def progress_bar(shown: bool | None, *, line: str = "", **options: Any) -> Any:
    """Return a progress bar of tqdm.

    Parameters
    ----------
    shown
        If True, the bar is shown. None for a bar if standard error is a terminal, and otherwise a
        line every `EVERY` seconds.
    line
        Format of such a line, as tqdm's `bar_format`.
    options
        Arguments of tqdm.
    """
    from tqdm import tqdm

    if shown is not None or sys.stderr.isatty():
        return tqdm(disable=shown is False, **options)

    class Lines(tqdm):  # type: ignore[misc]
        def display(self, msg: str | None = None, pos: int | None = None) -> None:
            if msg is None:  # not cleared
                print(str(self).strip(), file=sys.stderr, flush=True)

    options |= {"bar_format": line or LINE, "leave": False, "dynamic_ncols": False, "delay": EVERY}
    return Lines(mininterval=EVERY, maxinterval=EVERY, **options)


def notice(sentence: str) -> None:
    """Log that something will take long; commands print it as a line of its own."""
    logging.getLogger("domino_env").info(sentence)


class Advice(UserWarning):
    """Warning with the next action; commands print it as a line of its own."""


class WrongUnit(Advice):
    """Warning of lengths that are in another unit almost certainly; commands reject them."""


def advise(sentence: str, category: type[Advice] = Advice, stacklevel: int = 3) -> None:
    """Warn about a probable mistake of the caller of a public function."""
    warnings.warn(sentence, category, stacklevel=stacklevel)
