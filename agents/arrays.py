"""Arrays from a file of someone else's: nothing in it is run, and it cannot fill the memory."""

from __future__ import annotations

import io
import math
import struct
import warnings
import zlib
from collections.abc import Mapping
from pathlib import Path
from tokenize import TokenError
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from domino_env.limits import ARRAYS_BYTES, CHECKPOINT_BYTES, POLICY_BYTES, Limit
from domino_env.reading import one_line, read_bytes, shown, told_of

# what a torn archive, or a header that is none, leads its readers to
_TORN = (
    BadZipFile, zlib.error, struct.error, EOFError, RuntimeError, KeyError, OSError, TypeError,
    SyntaxError, TokenError, IndexError, AttributeError,
)  # fmt: skip
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of numbers in an .npz file.  ValueError where it holds anything else."""
    with told_of(path), _archive(read_bytes(path, ARRAYS_BYTES), ARRAYS_BYTES) as archive:
        names = [member.filename for member in archive.infolist()]
        if len(set(names)) < len(names):
            raise ValueError("two of its arrays have the same name")
        try:
            return {name.removesuffix(".npy"): _array(archive, name) for name in names}
        except _TORN as error:
            raise ValueError(f"damaged: {error}") from None


def read_weights(
    path: Path, wanted: Mapping[str, tuple[tuple[int, ...], np.dtype[Any]]]
) -> dict[str, NDArray[Any]]:
    """Arrays of these names, shapes and kinds from an .npz file, all finite.

    ValueError for any other file.  What the file says of sizes is compared, never allocated.
    """
    with told_of(path):
        with _archive(read_bytes(path, POLICY_BYTES), POLICY_BYTES) as archive:
            found = sorted(member.filename for member in archive.infolist())
            if found != sorted(f"{name}.npy" for name in wanted):
                unlike = f"it has {len(found)} arrays, {one_line(', '.join(found[:3]), 100)} …"
                raise ValueError(f"it does not hold the weights of such a policy: {unlike}")
            try:
                arrays = {
                    name: _array(archive, f"{name}.npy", kind) for name, kind in wanted.items()
                }
            except _TORN as error:
                raise ValueError(f"damaged: {error}") from None
        for name, values in arrays.items():
            if not np.isfinite(values).all():
                raise ValueError(f"{name} holds what is no finite number")
        return arrays


def require_whole_archive(data: bytes) -> None:
    """ValueError where a checkpoint's bytes are no archive, torn, or would unpack to too much."""
    with _archive(data, CHECKPOINT_BYTES) as archive:
        try:
            torn = archive.testzip()
        except _TORN as error:
            raise ValueError(f"damaged: {error}") from None
        if torn is not None:
            raise ValueError(f"damaged: {shown(torn)}")


def _archive(data: bytes, limit: Limit) -> ZipFile:
    try:
        archive = ZipFile(io.BytesIO(data))
    except (*_TORN, ValueError) as error:
        raise ValueError(f"it does not hold what a training wrote: {error}") from None
    limit.require(sum(member.file_size for member in archive.infolist()), "unpacked, it has")
    return archive


def _array(
    archive: ZipFile, name: str, wanted: tuple[tuple[int, ...], np.dtype[Any]] | None = None
) -> NDArray[Any]:
    """One of the arrays; nothing is allocated that is not there."""
    called = shown(name.removesuffix(".npy"))
    with archive.open(name) as member, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about headers of old programs
        version = np.lib.format.read_magic(member)
        if version not in _HEADERS:
            raise ValueError(f"{called} has format {version}, where (1, 0) is known")
        shape, by_columns, kind = _HEADERS[version](member, max_header_size=2000)
        if wanted is not None and (shape, kind) != wanted:
            raise ValueError(
                f"{called} is {kind} of shape {shown(shape)}, not {wanted[1]} of {wanted[0]}"
            )
        if kind.kind not in "fiub" or any(size < 0 for size in shape):
            raise ValueError(f"{called} is no array of numbers")
        size = math.prod(shape) * kind.itemsize
        data = member.read()  # as much as the archive says, which its limit allows
    if len(data) != size:
        raise ValueError(f"damaged: {called} has {len(data)} bytes, not {size}")
    return np.frombuffer(data, kind).reshape(shape, order="F" if by_columns else "C").copy()
