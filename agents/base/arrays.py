"""Arrays of numbers from .npz files, read without running what a pickle would run."""

from __future__ import annotations

import io
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, is_zipfile

import numpy as np
from numpy.typing import NDArray

from domino_env.core.reading import naming, one_line, read_bytes

# what a torn archive leads its readers to
_TORN = (BadZipFile, zlib.error, EOFError, KeyError, RuntimeError, OSError, ValueError)


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of numbers in an .npz file.

    Raises
    ------
    ValueError
        Where the file is damaged, or holds anything else; pickled objects are not read.
    OSError
        Where it cannot be read.
    """
    with naming(path):
        file = io.BytesIO(read_bytes(path))
        if not is_zipfile(file):
            raise ValueError("it is no archive of arrays (.npz), or only half of one")
        try:
            with np.load(file, allow_pickle=False) as found:
                return dict(found)
        except _TORN as error:
            raise ValueError(f"it does not hold whole arrays of numbers: {error}") from None


def read_weights(
    path: Path, wanted: Mapping[str, tuple[tuple[int, ...], np.dtype[Any]]]
) -> dict[str, NDArray[Any]]:
    """Read arrays of known names, shapes and types from an .npz file, all finite.

    Parameters
    ----------
    path
        The file.
    wanted
        Shape and type of each array, by name.

    Raises
    ------
    ValueError
        Where the file holds anything else.
    """
    arrays = read_arrays(path)
    with naming(path):
        if arrays.keys() != wanted.keys():
            names = one_line(", ".join(sorted(arrays)[:3]), 100)
            raise ValueError(
                "it does not hold the weights of such a policy: it has "
                f"{len(arrays)} arrays, {names} …"
            )
        for name, (shape, kind) in wanted.items():
            found = arrays[name]
            if (found.shape, found.dtype) != (shape, kind):
                raise ValueError(
                    f"'{name}' is {found.dtype} of shape {found.shape}, not {kind} of {shape}"
                )
            if not np.isfinite(found).all():
                raise ValueError(f"{name} holds what is no finite number")
    return arrays
