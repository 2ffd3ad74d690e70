"""Arrays from a file of someone else's: nothing in it is run, and it cannot fill the memory."""

from __future__ import annotations

import io
import math
import struct
import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env.limits import POLICY_BYTES
from domino_env.reading import read_bytes

DAMAGED = (
    ValueError, OSError, KeyError, EOFError, TypeError, AttributeError, NotImplementedError,
    RuntimeError, SyntaxError, TokenError, IndexError, struct.error, zlib.error,
    zipfile.BadZipFile,
)  # fmt: skip


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of numbers in an .npz file, whatever their names and shapes.

    ValueError, with the reason, where it holds none.
    """
    data = read_bytes(path, POLICY_BYTES)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            sizes = {entry.filename: entry.file_size for entry in archive.infolist()}
            POLICY_BYTES.require(sum(sizes.values()), "unpacked, it has")
            torn = archive.testzip()  # NumPy reads arrays without a look at their checksums
            if torn is not None:
                raise ValueError(f"'{torn}' is damaged")
            for name in sizes:
                _require_size(archive, name, sizes[name])
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except DAMAGED as error:
        raise ValueError(str(error) or type(error).__name__) from None


def _require_size(archive: zipfile.ZipFile, name: str, size: int) -> None:
    """ValueError where an entry is no array of numbers, or says that it is larger than it is."""
    with archive.open(name) as entry:
        version = np.lib.format.read_magic(entry)
        if version != (1, 0):
            raise ValueError(f"'{name}' is an array of format {version}, where (1, 0) is known")
        shape, _, kind = np.lib.format.read_array_header_1_0(entry, max_header_size=2000)
        if kind.kind not in "fiub":
            raise ValueError(f"'{name}' is no array of numbers")
        if entry.tell() + kind.itemsize * math.prod(shape) != size:
            raise ValueError(f"'{name}' does not have the size that it says")
