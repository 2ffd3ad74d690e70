"""Reading and writing of whole files, and error messages of one line."""

from __future__ import annotations

import json
import os
import reprlib
import secrets
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, BinaryIO, NoReturn

LARGEST_FILE = 256 * 2**20  # [bytes]; a layout of a million different dominoes takes 105 MB
LONGEST_SENTENCE, LONGEST_PATH = 480, 160  # [characters]
# of values in messages: at most 60 characters, 4 items and 2 levels of nesting
_SHORT_REPR = reprlib.Repr()
_SHORT_REPR.maxstring = _SHORT_REPR.maxother = _SHORT_REPR.maxlong = 60
_SHORT_REPR.maxlist = _SHORT_REPR.maxdict = _SHORT_REPR.maxtuple = 4
_SHORT_REPR.maxlevel = 2


def read_bytes(path: Path) -> bytes:
    """Return the bytes of a file; raise a ValueError above `LARGEST_FILE`."""
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise_with_path(path, f"the file has {size:,} bytes: give one of at most {LARGEST_FILE:,}")
    return path.read_bytes()


def read_json(path: Path) -> Any:
    """Return the document of a JSON file; raise a ValueError with the path for other text."""
    with errors_with_path(path):
        try:
            return json.loads(read_text(path))
        except RecursionError:
            raise ValueError("not JSON: nested too deeply; use fewer levels") from None
        except json.JSONDecodeError as error:
            raise ValueError(f"not JSON: {error}") from None


def read_text(path: Path) -> str:
    """Return the text of a file, decoded by `decode`."""
    return decode(read_bytes(path))


def decode(data: bytes) -> str:
    """Decode UTF-16 if its byte order mark is there, else UTF-8 if valid, else Latin-1."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


@contextmanager
def errors_with_path(path: Path | str) -> Iterator[None]:
    """Replace errors of values, arithmetic and memory by a ValueError of one line with the path."""
    try:
        yield
    except (ValueError, ArithmeticError, MemoryError) as error:
        raise_with_path(path, error)


def raise_with_path(path: Path | str, error: BaseException | str) -> NoReturn:
    """Raise a ValueError of one line that begins with the path of a file."""
    name = one_line(str(path), LONGEST_PATH, keep_end=True)
    text = str(error).removeprefix(f"{path}: ").removeprefix(f"{name}: ")
    if isinstance(error, MemoryError):
        text = "too large for this computer's memory: give a smaller file"
    elif isinstance(error, UnicodeDecodeError):
        text = f"not valid {error.encoding} text ({error.reason}): save it as UTF-8"
    if text.startswith((f"{path}, ", f"{name}, ")):  # line and column follow
        text = text.removeprefix(str(path)).removeprefix(name)
        raise ValueError(one_line(name + text)) from None
    raise ValueError(one_line(f"{name}: {text}")) from None


def write_bytes(path: Path, fill: Callable[[BinaryIO], object]) -> None:
    """Write a temporary file by `fill(file)`, then rename it to the path in one step.

    Raises
    ------
    OSError
        If the file cannot be written; the message has the path and the reason.
    """
    temporary = path.parent / f".{secrets.token_hex(8)}.tmp"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("xb") as file:
            fill(file)
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileNotFoundError):  # a new file
            temporary.chmod(path.stat().st_mode)
        temporary.replace(path)
    except OSError as error:  # its message has the temporary file, or no file if the disk is full
        if error.errno is None:  # raised by `fill`, not by the operating system
            raise
        raise type(error)(f"{path} cannot be written: {error.strerror}") from None
    finally:
        with suppress(OSError):  # a read-only file system raises even for a missing file
            temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a file of UTF-8 text, as `write_bytes` does."""
    write_bytes(path, lambda file: file.write(text.encode()))


def require_unused(folder: Path, names: Iterable[str]) -> None:
    """Raise a ValueError if a folder holds a file with one of the names."""
    taken = next((name for name in names if (folder / name).exists()), None)
    if taken is not None:
        raise ValueError(
            f"{folder} holds {taken} already: resume the same run, or name another folder"
        )


def require_writable(folder: Path) -> None:
    """Raise a ValueError if no file can be written to a folder, without creating the folder."""
    base = next(f for f in (folder, *folder.absolute().parents) if f.exists())
    if not base.is_dir():
        raise ValueError(f"{base} is a file: name a folder")
    try:
        TemporaryFile(dir=base).close()
    except OSError as error:
        raise ValueError(f"{base}: {error.strerror}; name a folder that can be written") from None


def one_line(text: str, max_length: int = LONGEST_SENTENCE, *, keep_end: bool = False) -> str:
    """Return text with control characters escaped, shortened to `max_length` characters by "…".

    If `keep_end` is True, the beginning of a long text is left out, otherwise its end.
    """
    text = text[-max_length:] if keep_end and len(text) > max_length else text[: max_length + 1]
    safe = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    if len(safe) <= max_length:
        return safe
    return "…" + safe[1 - max_length :] if keep_end else safe[: max_length - 1] + "…"


def amount(number: int, noun: str) -> str:
    """Return a number and its noun, such as "1 layout" or "2 layouts"."""
    plural = "" if number == 1 else "es" if noun.endswith("ch") else "s"
    return f"{number} {noun}{plural}"


def as_text(value: object) -> str:
    """Return the repr of a value for an error message, shortened to 80 characters."""
    try:
        return one_line(_SHORT_REPR.repr(value), 80)
    except (ValueError, RecursionError):  # an int of thousands of digits raises ValueError
        return f"a {type(value).__name__} too large to show"


def require_locks(folder: Path) -> None:
    """Check that files in a folder can be locked, which some network file systems refuse.

    SQLite waits for a refused lock as for one that another process holds.

    Raises
    ------
    ValueError
        If the file system refuses a lock.
    """
    try:
        import fcntl

        file = TemporaryFile(dir=folder)  # noqa: SIM115 - closed below
    except (ImportError, OSError):  # Windows always locks; a folder that cannot be written
        return
    with file:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise ValueError(
                f"the file system of {folder} refuses locks ({error.strerror}): name a folder on "
                "another, such as a local disk"
            ) from None
