"""Checks of arguments; their messages have name, value, accepted range and next action."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import Any, cast

import numpy as np

from domino_env.core.files import as_text, one_line
from domino_env.core.types import Floats

INF = math.inf
CODE_ADDRESS = ""  # of the repository; empty: its folder. Also in [project.urls] of pyproject.toml


def require(
    name: str,
    value: Any,
    low: float = -INF,
    high: float = INF,
    unit: str = "",
    hint: str = "",
    *,
    above: float = -INF,
    below: float = INF,
    whole: bool = False,
    optional: bool = False,
    array: bool = False,
) -> None:
    """Raise a ValueError for anything but a finite number in the accepted range.

    Parameters
    ----------
    name
        Name of the parameter, the first word of the message.
    value
        A number; with `array`, an array of numbers, each of which is checked.
    low, high
        Smallest and largest value that is accepted.
    unit
        Unit of the value, for the message.
    hint
        Typical value or next action, at the end of the message.
    above, below
        Exclusive bounds, in place of `low` and `high`.
    whole
        If True, only integers are accepted.
    optional
        If True, None is accepted.
    array
        If True, an array is accepted.

    Raises
    ------
    ValueError
        With a message such as "gravity = 0.0 m/s²: give a finite number, more than 0 (9.81 on
        Earth)"; for an array with the index of the first entry that is not accepted.
    """
    kinds = (int, np.integer) if whole else (int, float, np.integer, np.floating)
    if optional and value is None:
        return
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, kinds) and not isinstance(value, bool):
        if low <= value <= high and above < value < below:
            return
    elif array and isinstance(value, np.ndarray) and value.dtype.kind in "iuf"[: 3 - whole]:
        # floats ("f") are accepted without `whole` only
        accepted = value >= low if low > -INF else value > above
        accepted &= value <= high if high < INF else value < below
        if accepted.all():
            return
        place = tuple(map(int, np.argwhere(~accepted)[0]))
        name, value = f"{name}{list(place)}", value[place]
    value = value.item() if isinstance(value, np.generic) else value
    expected = "whole number" if whole else "finite number"
    bounds = format_range(low, high, above=above, below=below)
    given = f"{name} = {as_text(value)}{' ' * bool(unit)}{unit}"
    raise ValueError(f"{given}: give a {expected}{bounds}{f' ({hint})' if hint else ''}")


def numbers(
    name: str,
    value: Any,
    copy: bool | None = True,
    shape: tuple[int | str, ...] | None = None,
    meaning: str = "",
    finite: bool = False,
) -> Floats:
    """Return the numbers of an argument as a contiguous array of float64.

    Parameters
    ----------
    name, value
        Name and value of the argument.
    copy
        Argument `copy` of `numpy.array`: True to copy always, None to copy only if necessary.
    shape
        Accepted shape, with strings for sizes that are free, as in (2, "N"); None for any.
    meaning
        Meaning of the shape, at the end of the message about another one.
    finite
        If True, NaN and infinity are rejected.

    Returns
    -------
    ndarray
        The numbers, in the order of C, for which the kernels are compiled.

    Raises
    ------
    ValueError
        If the value is not a number or nested lists of numbers with equal lengths, if it has
        another shape, and for numbers that are not finite.
    """
    try:
        given = np.asarray(value)
        # booleans, strings, dates, masked entries and None are rejected; most arrays are of floats
        if given.dtype.kind != "f" or type(value) is not np.ndarray:
            is_mixed = given.dtype == object and any(isinstance(x, str | None) for x in given.flat)
            if given.dtype.kind not in "iufO" or is_mixed or np.ma.is_masked(value):
                raise TypeError
        array = np.array(given, dtype=np.float64, copy=copy, order="C")
    except (TypeError, ValueError, OverflowError, RuntimeError):  # of a tensor with a gradient
        raise ValueError(f"{name} = {as_text(value)}: give numbers") from None
    if shape is not None and shape != array.shape:
        pairs = zip(shape, array.shape, strict=False)
        if len(shape) != array.ndim or any(n != m and not isinstance(n, str) for n, m in pairs):
            sizes = ", ".join(map(str, shape)) + "," * (len(shape) == 1)
            ending = f", {meaning}" if meaning else ""
            raise ValueError(f"{name} has shape {array.shape}: give ({sizes}){ending}")
    if finite:
        require(name, array, array=True)
    return array


def require_choice(name: str, value: object, choices: Iterable[object]) -> None:
    """Raise a ValueError for a value that is not among the choices.

    Raises
    ------
    ValueError
        The message has name, value, the most similar choice and all choices.
    """
    known = [str(choice) for choice in choices]
    if str(value) in known:
        return
    similar = difflib.get_close_matches(str(value)[:50].lower(), known, n=1)
    guess = f"did you mean '{similar[0]}'? " if similar else ""
    given = f"'{one_line(value, 60)}'" if isinstance(value, str) else as_text(value)
    raise ValueError(f"{name} = {given}: {guess}choose one of {', '.join(known)}")


def require_type(name: str, value: object, kind: Any, expected: str) -> None:
    """Raise a TypeError for a value of another type; its message ends in "give {expected}"."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} = {as_text(value)}: give {expected}")


def as_path(name: str, value: object) -> Path:
    """Return the path of an argument.

    Raises
    ------
    TypeError
        For anything but a string or a path.
    ValueError
        For an empty string, and a name that no file can have.
    """
    require_type(name, value, str | PathLike, "a path, as a string or a pathlib.Path")
    path = Path(cast("str", value))
    if value == "" or "\0" in str(path) or len(path.name) > 255:
        raise ValueError(f"{name} = {as_text(value)}: give a name of 1 to 255 characters, no null")
    return path


def require_extra(purpose: str, extra: str, *packages: str) -> None:
    """Raise an ImportError if packages of an extra are not installed.

    Raises
    ------
    ImportError
        The message has the purpose, the packages and the command that installs them.
    """
    missing = [name for name in packages if find_spec(name) is None]
    if missing:
        raise ImportError(f"{purpose} needs {', '.join(missing)}: {install_command(extra)}")


def install_command(extra: str) -> str:
    """Return the command that installs an extra, and the folder in which to enter it."""
    place = f"a copy of {CODE_ADDRESS}" if CODE_ADDRESS else "the folder of the project"
    return f'pip install -e ".[{extra}]" in {place}'


def format_range(
    low: float | None = None,
    high: float | None = None,
    *,
    above: float | None = None,
    below: float | None = None,
) -> str:
    """Return a range as " from 2 to 9" or ", more than 0, at most 1"; empty without bounds."""
    bounds = {"at least": low, "more than": above, "at most": high, "less than": below}
    given = {word: x for word, x in bounds.items() if x is not None and math.isfinite(x)}
    if given.keys() == {"at least", "at most"}:
        return f" from {_format_number(given['at least'])} to {_format_number(given['at most'])}"
    return "".join(f", {word} {_format_number(x)}" for word, x in given.items())


def _format_number(value: int | float) -> str:
    return f"{value:g}" if isinstance(value, float) else f"{value}"
