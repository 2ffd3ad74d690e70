"""Writing files whole: a reader, or a crash, never sees half of one."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import BinaryIO


def write_bytes(path: Path, fill: Callable[[BinaryIO], object]) -> None:
    """Let `fill` write into a new file beside `path`, then put it in its place in one step."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f".{path.name}.{os.getpid()}-{secrets.token_hex(4)}")
    try:
        with new.open("xb") as file:
            fill(file)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    except OSError as error:  # of a full disk nothing says which; else the name is that of `new`
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        new.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text whole."""
    write_bytes(path, lambda file: file.write(text.encode()))


def require_none(folder: Path, names: Iterable[str]) -> None:
    """Refuse a folder for a new run that holds a file by one of its names, an earlier run's or not.

    Other files, such as notes, may be there.

    Raises
    ------
    ValueError
        With the name, and what to do.
    """
    taken = next((name for name in names if (folder / name).exists()), None)
    if taken is not None:
        raise ValueError(
            f"{folder} holds {taken} already: go on with --resume, or name another folder"
        )


def require_room(folder: Path) -> None:
    """Refuse a folder that cannot be written, before any time is spent; it is made if need be.

    Raises
    ------
    ValueError
        With the reason.
    """
    probe = folder / f".writable-{os.getpid()}-{secrets.token_hex(4)}"
    try:
        write_text(probe, " " * 4096)  # a full disk may have room for nothing
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{folder} cannot be written: {error.strerror}") from None
