"""What a long task says meanwhile: how far it is, what it does, and advice."""

from __future__ import annotations

import logging
import sys
import warnings
from typing import Any

EVERY = 30.0  # [s] between two lines where there is no terminal
LINE = "{percentage:.0f} %, {n_fmt} of {total_fmt}{unit} in {elapsed}, {remaining} left{postfix}"


def progress_bar(shown: bool | None, *, line: str = "", **looks: Any) -> Any:
    """Open a bar of tqdm.

    Parameters
    ----------
    shown
        Whether there is one; None: on a terminal, and where standard error is none, a line on it
        every `EVERY` seconds, the first after as many.
    line
        What such a line says, as tqdm's `bar_format`.
    looks
        Arguments of tqdm.
    """
    from tqdm import tqdm

    if shown is not None or sys.stderr.isatty():
        return tqdm(disable=shown is False, **looks)

    class Lines(tqdm):  # type: ignore[misc]
        def display(self, msg: str | None = None, pos: int | None = None) -> None:
            if msg is None:  # and not wiped
                print(str(self).strip(), file=sys.stderr, flush=True)

    looks |= {"bar_format": line or LINE, "leave": False, "dynamic_ncols": False, "delay": EVERY}
    return Lines(mininterval=EVERY, maxinterval=EVERY, **looks)


def notice(sentence: str) -> None:
    """Log what is about to take long; commands print it as a line of their own."""
    logging.getLogger("domino_env").info(sentence)


class Advice(UserWarning):
    """A warning in a sentence that says what to do; commands print it as a line of their own."""


def advise(sentence: str) -> None:
    """Warn of what the caller of a public function may have got wrong."""
    warnings.warn(sentence, Advice, stacklevel=3)
