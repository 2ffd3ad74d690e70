"""Advice: what is right as it stands, and yet probably not what was meant."""

from __future__ import annotations

import warnings


class Advice(UserWarning):
    """A warning in a sentence that says what to do; commands print it as a line of their own."""


def advise(sentence: str) -> None:
    """Warn of what the caller of a public function may have got wrong."""
    warnings.warn(sentence, Advice, stacklevel=3)
