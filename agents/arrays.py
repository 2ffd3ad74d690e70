"""Arrays from a file of someone else's: nothing in it is run, and it cannot fill the memory."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST = 256 * 2**20  # bytes that all arrays of a file may take, unpacked
DAMAGED = (
    ValueError, OSError, KeyError, EOFError, TypeError, AttributeError, NotImplementedError,
    RuntimeError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays in an .npz file.  ValueError, with the reason, where it holds none."""
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MOST:
            raise ValueError(f"its arrays take {size:,} bytes, where {MOST:,} are accepted")
        with np.load(path, allow_pickle=False) as file:
            # of an entry that is no array NumPy gives the bytes
            arrays = {name: file[name] for name in file.files}
        for name, array in arrays.items():
            if not (isinstance(array, np.ndarray) and array.dtype.kind in "fiub"):
                raise ValueError(f"'{name}' is no array of numbers")
    except DAMAGED as error:
        raise ValueError(str(error) or type(error).__name__) from None
    return arrays
