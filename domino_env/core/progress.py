"""Progress of long tasks, notices and advice."""

from __future__ import annotations

import logging
import sys
import warnings
from typing import Any

UNNOTICED = 2.0  # [s] of work or waiting, after which the user is told what happens
PERIOD = 30.0  # [s] between two lines if standard error is not a terminal
LINE = "{percentage:.0f} %, {n_fmt} of {total_fmt}{unit} in {elapsed}, {remaining} left{postfix}"


def progress_bar(show: bool | None, *, line: str = "", **options: Any) -> Any:
    """Create a progress bar of tqdm.

    Parameters
    ----------
    show
        True for a bar; False for no output; None for a bar if standard error is a terminal,
        otherwise a line every `PERIOD` seconds. Without a standard error, as in a service, there
        is no output.
    line
        Format of such a line, as tqdm's `bar_format`; empty for `LINE`.
    options
        Arguments of tqdm.

    Returns
    -------
    tqdm.tqdm
        The bar, or its substitute that prints lines.
    """
    from tqdm import tqdm

    if sys.stderr is None:
        show = False
    if show is not None or sys.stderr.isatty():
        return tqdm(disable=show is False, **options)

    class Lines(tqdm):  # type: ignore[misc]
        def display(self, msg: str | None = None, pos: int | None = None) -> None:
            if msg is None:  # "" would clear the line
                print(str(self).strip(), file=sys.stderr, flush=True)

        def clear(self, nolock: bool = False) -> None:  # around another line: it has its own
            pass

        def refresh(self, nolock: bool = False, lock_args: Any = None) -> None:
            if not nolock:  # else after another line
                super().refresh(lock_args=lock_args)

    options |= {"bar_format": line or LINE, "leave": False, "dynamic_ncols": False, "delay": PERIOD}
    return Lines(mininterval=PERIOD, maxinterval=PERIOD, **options)


def leave_out(bar: Any, count: int) -> None:
    """Leave the first steps of a progress bar, which include compilation, out of its forecast."""
    bar.n = bar.initial = count
    bar.unpause()


def notice(sentence: str, level: int = logging.INFO) -> None:
    """Log a sentence for the user, such as on a long wait; commands print it on its own line."""
    logging.getLogger("domino_env").log(level, sentence)


class Advice(UserWarning):
    """Warning that names the next action; commands print it on a line of its own."""


class WrongUnit(Advice):
    """Warning of lengths that are almost certainly in another unit; commands reject them."""


def advise(sentence: str, category: type[Advice] = Advice, stacklevel: int = 3) -> None:
    """Issue a warning of one sentence.

    Parameters
    ----------
    sentence
        The mistake or limitation, and the next action.
    category
        Class of the warning.
    stacklevel
        As for `warnings.warn`; 3 is the caller of the function that calls `advise`.
    """
    warnings.warn(sentence, category, stacklevel=stacklevel)
