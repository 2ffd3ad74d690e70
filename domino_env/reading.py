"""Reading what strangers wrote: bounded, and refused in one sentence that names the file."""

from __future__ import annotations

import json
import os
import reprlib
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from domino_env.limits import Limit

LONGEST_SENTENCE, LONGEST_PATH = 480, 160  # [characters]
LONGEST_NAME = 100  # [characters]
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlist = _SHORT.maxdict = _SHORT.maxtuple = 4
_SHORT.maxlevel = 2
# what paths, shells, pages or old file systems give a meaning
_MEANING = set('/\\<>:"|?*`$')
_RESERVED = {"con", "prn", "aux", "nul"} | {f"{k}{n}" for k in ("com", "lpt") for n in range(1, 10)}


def read_bytes(path: Path, limit: Limit) -> bytes:
    """A plain file, whole.

    ValueError for what is larger than its limit or no plain file: a folder, a device, a pipe that
    nobody may ever write to.  OSError where it cannot be read.
    """
    with told_of(path):
        _require_plain(path.stat().st_mode)
        # a pipe may have taken its place meanwhile: opened so, it does not wait
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        with os.fdopen(os.open(path, flags), "rb") as file:
            found = os.fstat(file.fileno())
            _require_plain(found.st_mode)
            limit.require(found.st_size, "a file of")
            return file.read(found.st_size)


def read_json(path: Path, limit: Limit, values: int) -> Any:
    """A JSON document of at most so many values; text as `decoded` takes it.

    ValueError for anything else, for a key that stands twice, and for values nested without end.
    """
    with told_of(path):
        return parsed(read_bytes(path, limit), values)


def parsed(data: bytes, values: int) -> Any:
    """The document in a JSON file's bytes; see `read_json`."""
    found = sum(data.count(sign) for sign in (b"[", b"{", b",", b":"))
    if found > values:
        raise ValueError(f"{found:,} values, where at most {values:,} make sense")
    try:
        return json.loads(decoded(data), object_pairs_hook=_once)
    except RecursionError:
        raise ValueError("not JSON: nested too deep") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"not JSON: {error}") from None
    except ValueError as error:
        raise ValueError(_shorter(error)) from None


def decoded(data: bytes) -> str:
    """Text from bytes in `encoding_of` them."""
    return data.decode(encoding_of(data))


def encoding_of(data: bytes) -> str:
    """UTF-16 where marked, UTF-8 with or without a mark where it is that, else Latin-1."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        try:
            data.decode("utf-16")
        except UnicodeDecodeError as error:
            raise ValueError(f"starts like UTF-16 text but is not: {error}") from None
        return "utf-16"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _shorter(error: ValueError) -> str:
    """Python's advice on long numbers is not for whoever reads a file."""
    long = str(error).startswith("Exceeds the limit")
    return "a whole number has thousands of digits" if long else str(error)


@contextmanager
def told_of(path: Path | str) -> Iterator[None]:
    """Whatever is wrong inside becomes a ValueError of one line that begins with the path."""
    try:
        yield
    except (ValueError, ArithmeticError, RecursionError, MemoryError) as error:
        refuse(path, error)


def refuse(path: Path | str, error: BaseException | str) -> NoReturn:
    """Raise that ValueError."""
    name = one_line(str(path), LONGEST_PATH, keep_end=True)
    said = _shorter(error) if isinstance(error, ValueError) else str(error)
    said = said.removeprefix(f"{path}: ").removeprefix(f"{name}: ")
    if isinstance(error, MemoryError):
        said = "too large for this computer's memory"
    if said.startswith((f"{path}, ", f"{name}, ")):  # line and column follow
        said = said.removeprefix(str(path)).removeprefix(name)
        raise ValueError(one_line(name + said)) from None
    raise ValueError(one_line(f"{name}: {said}")) from None


def one_line(text: str, most: int = LONGEST_SENTENCE, *, keep_end: bool = False) -> str:
    """Text that is safe to print: nothing that moves a cursor or turns a line, and not too long."""
    text = text[-most:] if keep_end and len(text) > most else text[: most + 1]
    safe = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    if len(safe) <= most:
        return safe
    return "…" + safe[1 - most :] if keep_end else safe[: most - 1] + "…"


def shown(value: object) -> str:
    """A value from a file, short enough for a sentence."""
    try:
        return one_line(_SHORT.repr(value), 80)
    except (ValueError, RecursionError):  # whole numbers of thousands of digits have no repr
        return f"a {type(value).__name__} too large to show"


def plain_name(name: str) -> str | None:
    """What keeps a name from being a folder's on every system; None if nothing does."""
    if not name.strip() or len(name) > LONGEST_NAME:
        return f"give 1 to {LONGEST_NAME} characters"
    strange = next((c for c in name if not c.isprintable() or c in _MEANING), None)
    if strange is not None:
        return f"leave out {shown(strange)}"
    if not name[0].isalnum():
        return "begin with a letter or a digit"
    if name[-1] in " ." or name.partition(".")[0].strip().lower() in _RESERVED:
        return "systems keep this name for themselves"
    return None


def _require_plain(mode: int) -> None:
    if not stat.S_ISREG(mode):
        kinds = ((stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"))
        what = next((kind for test, kind in kinds if test(mode)), "a device")
        raise ValueError(f"this is {what}: give a file")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"the key {shown(key)} stands there twice")
        found[key] = value
    return found
