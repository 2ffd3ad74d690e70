"""Reading files: whole, of a sane size; what is wrong is one sentence that names the file."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

LARGEST_FILE = 256 * 2**20  # [bytes]; a layout of a million unlike dominoes takes 105 MB
LONGEST_SENTENCE, LONGEST_PATH = 480, 160  # [characters]
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlist = _SHORT.maxdict = _SHORT.maxtuple = 4
_SHORT.maxlevel = 2


def read_bytes(path: Path) -> bytes:
    """Read a file whole.

    Raises
    ------
    ValueError
        The file is larger than `LARGEST_FILE`.
    OSError
        It cannot be read.
    """
    size = path.stat().st_size
    if size > LARGEST_FILE:
        refuse(path, f"{size:,} bytes, where files of at most {LARGEST_FILE:,} are read")
    return path.read_bytes()


def read_json(path: Path) -> Any:
    """Read a JSON document, encoded as `decoded` takes it.

    Raises
    ------
    ValueError
        For what is no JSON, with the path; otherwise as `read_bytes`.
    """
    with naming(path):
        try:
            return json.loads(decoded(read_bytes(path)))
        except RecursionError:
            raise ValueError("not JSON: nested too deep") from None
        except json.JSONDecodeError as error:
            raise ValueError(f"not JSON: {error}") from None


def decoded(data: bytes) -> str:
    """Decode text in `encoding_of` its bytes."""
    return data.decode(encoding_of(data))


def encoding_of(data: bytes) -> str:
    """Tell UTF-16 where marked, UTF-8 with or without a mark where it is that, else Latin-1."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


@contextmanager
def naming(path: Path | str) -> Iterator[None]:
    """Turn what is wrong inside into a ValueError of one line that begins with the path."""
    try:
        yield
    except (ValueError, ArithmeticError, MemoryError) as error:
        refuse(path, error)


def refuse(path: Path | str, error: BaseException | str) -> NoReturn:
    """Raise the ValueError that says what is wrong with a file."""
    name = one_line(str(path), LONGEST_PATH, keep_end=True)
    said = str(error).removeprefix(f"{path}: ").removeprefix(f"{name}: ")
    if isinstance(error, MemoryError):
        said = "too large for this computer's memory"
    elif isinstance(error, UnicodeDecodeError):
        said = f"not {error.encoding} text, or not all of it: {error.reason}"
    if said.startswith((f"{path}, ", f"{name}, ")):  # line and column follow
        said = said.removeprefix(str(path)).removeprefix(name)
        raise ValueError(one_line(name + said)) from None
    raise ValueError(one_line(f"{name}: {said}")) from None


def row_name(path: Path) -> str:
    """What a row is called after its file: of a run's layout.csv, after the run's folder."""
    of_run = path.stem == "layout"
    return one_line(path.resolve().parent.name if of_run else path.stem, 100)


def one_line(text: str, most: int = LONGEST_SENTENCE, *, keep_end: bool = False) -> str:
    """Make text safe to print: nothing that moves a cursor or turns a line, and not too long."""
    text = text[-most:] if keep_end and len(text) > most else text[: most + 1]
    safe = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    if len(safe) <= most:
        return safe
    return "…" + safe[1 - most :] if keep_end else safe[: most - 1] + "…"


def shown(value: object) -> str:
    """Show a value from a file, short enough for a sentence."""
    try:
        return one_line(_SHORT.repr(value), 80)
    except (ValueError, RecursionError):  # whole numbers of thousands of digits have no repr
        return f"a {type(value).__name__} too large to show"
