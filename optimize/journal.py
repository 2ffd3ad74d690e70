"""A search's journal: what every batch of simulations came to, so that a search can go on.

Any method is a deterministic program that asks for scores.  Run again from its seed, and answered
from the journal instead of by simulation, it is soon where it was, to the bit, and goes on from
there.  Each answer is kept with a digest of its question: a method that asks something else than it
did is told so, and no wrong result comes of it.

The file: a header (MAGIC, length, CRC, JSON that names scene, method, seed and versions), then a
record each: question's CRC, elapsed seconds, payload's length, CRC of these and the payload; the
payload is arrays of float64, each after its number of dimensions and these.  A record that a kill
or a full disk has torn ends the journal; the next one is written over it.
"""

from __future__ import annotations

import hashlib
import json
import math
import struct
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from domino_env.files import write_bytes
from domino_env.scene import Scene

Floats = NDArray[np.float64]
Arrays = tuple[Floats, ...]

MAGIC = b"DOMINOJ1"  # the last digit is the version of the format
PAUSE = 1.0  # [s] of work that a kill may lose
CHUNK = 4 * 2**20  # [bytes] kept in memory at most
LARGEST = 2**30  # [bytes] of a journal: some ten minutes of gradients on two cores
LARGEST_HEADER = 2**16

_LENGTHS = struct.Struct("<II")  # header: length, CRC
_RECORD = struct.Struct("<IdI")  # question's CRC, elapsed [s], payload's length
_CRC = struct.Struct("<I")


class Journal:
    """The journal of one search.

    path: the file; it appears with the first answer, and replaces that of an earlier search.
    resume: begin with what is in the file; from the start where there is no file.
    most: bytes from which on nothing more is kept: what comes after will be simulated again.
    replaying: whether the next answer may come from the file.
    seconds: that the search has taken, those before it was stopped and resumed among them.

    Raises ValueError for a file that is no journal, or that of another search.
    """

    def __init__(
        self, path: Path, scene: Scene, method: str, seed: int, versions: dict[str, str],
        *, resume: bool,
    ) -> None:  # fmt: skip
        self.path = path
        self._header = {
            "scene": hashlib.sha256(scene.to_toml().encode()).hexdigest()[:16],
            "name": scene.name,
            "method": method,
            "seed": seed,
            "versions": versions,
        }
        self._before = 0.0  # seconds at the last answer from the file
        self._since = time.perf_counter()  # when that was
        self._records: Iterator[tuple[int, float, bytes, int]] | None = None
        self._next: tuple[int, float, bytes, int] | None = None
        self._file: BinaryIO | None = None
        self._waiting: list[bytes] = []
        self._size = self._held = 0
        self._flushed = float("-inf")
        self._closed = False
        if resume and path.exists():
            self._open()

    @property
    def replaying(self) -> bool:
        """Whether the next answer may come from the file."""
        return self._next is not None

    @property
    def seconds(self) -> float:
        """That the search has taken; while it is answered from the file, that it had taken then."""
        return self._before + (0.0 if self.replaying else time.perf_counter() - self._since)

    def start(self) -> None:
        """The search begins now."""
        self._since = time.perf_counter()

    def answer(
        self,
        question: tuple[object, Floats],
        compute: Callable[[], Arrays],
        shapes: Sequence[tuple[int, ...]] | None = None,
    ) -> Arrays:
        """What `compute` gives, from the file where it is there.

        question: what is asked, and of which designs (B, n).
        shapes: of the arrays, -1 for any length; None for one of (B,).
        ValueError where the search asks something else than it did.
        """
        digest = _digest(question)
        if self._next is not None:
            known, elapsed, payload, place = self._next
            if known == digest:
                found = _unpacked(payload)
                if not _have(found, shapes or [question[1].shape[:1]]):
                    raise ValueError(
                        f"{self.path} is damaged after {elapsed:.1f} s: begin anew, without "
                        "--resume"
                    )
                self._before, self._since = elapsed, time.perf_counter()
                self._advance()
                return found
            # A budget may have cut its last batch short, where a larger one asks for all of it.
            self._advance()
            if self._next is not None:
                raise ValueError(
                    f"{self.path} is of a search that asked something else after {elapsed:.1f} s: "
                    "the programs or their libraries differ; begin anew, without --resume"
                )
            self._go_live(place)
        found = compute()
        self.keep(question, found, digest)
        return found

    def keep(
        self, question: tuple[object, Floats], found: Arrays, digest: int | None = None
    ) -> None:
        """Write an answer down; what could not be written is simulated again by who resumes."""
        if self._closed:
            return
        payload = _packed(found)
        head = _RECORD.pack(
            _digest(question) if digest is None else digest, self.seconds, len(payload)
        )
        record = head + _CRC.pack(zlib.crc32(payload, zlib.crc32(head))) + payload
        if self._size + self._held + len(record) > LARGEST:
            self.close()
            return
        self._waiting.append(record)
        self._held += len(record)
        if self._held > CHUNK or time.monotonic() - self._flushed > PAUSE:
            self._flush()

    def close(self) -> None:
        """Write what is still in memory."""
        if not self._closed and self._waiting:
            self._flush()
        self._closed = True
        if self._file is not None:
            self._file.close()
            self._file = None

    def remove_if_larger(self, most: int) -> None:
        """Take the file away if it has more bytes; a journal that ended early says too little."""
        if self.path.exists() and self.path.stat().st_size > most:
            self.path.unlink()

    def _flush(self) -> None:
        self._flushed = time.monotonic()
        data = b"".join(self._waiting)
        try:
            if self._file is None:
                header = json.dumps(self._header, sort_keys=True).encode()
                start = MAGIC + _LENGTHS.pack(len(header), zlib.crc32(header)) + header
                write_bytes(self.path, lambda file: file.write(start))
                self._file = self.path.open("r+b", buffering=0)
                _hold(self._file, self.path)
                self._size = len(start)
            self._file.seek(self._size)  # over what Ctrl-C has left half written
            left = memoryview(data)
            while len(left):
                left = left[self._file.write(left) :]
        except (OSError, ValueError):
            # A full disk must not cost the search; the torn record ends the journal.
            self._closed = True
        else:
            # nothing can come between these: what is written is not written twice
            self._size, self._waiting, self._held = self._size + len(data), [], 0

    # what is there already ----------------------------------------------------------------------

    def _open(self) -> None:
        if not self.path.is_file():  # a pipe would be waited for without end
            raise ValueError(f"{self.path} is no plain file: begin anew, without --resume")
        try:
            self._file = self.path.open("r+b", buffering=0)
            _hold(self._file, self.path)
            start = self._header_end(self._file)
        except OSError as error:
            raise ValueError(f"{self.path} cannot be opened: {error.strerror}") from None
        except ValueError:
            if self._file is not None:
                self._file.close()
            raise
        self._size = start
        self._records = _records(self.path, start)
        self._advance()
        if self._next is None:
            self._go_live(self._size)

    def _header_end(self, file: BinaryIO) -> int:
        said = file.read(len(MAGIC) + _LENGTHS.size)
        if said[: len(MAGIC)] != MAGIC:
            newer = said[: len(MAGIC) - 1] == MAGIC[:-1]
            what = "a journal of another version" if newer else "no journal of a search"
            raise ValueError(f"{self.path} is {what}: begin anew, without --resume")
        lengths = said[len(MAGIC) :].ljust(_LENGTHS.size, b"\xff")
        length, crc = _LENGTHS.unpack(lengths)
        text = file.read(min(length, LARGEST_HEADER))
        known = None
        if len(text) == length and zlib.crc32(text) == crc:
            with suppress(ValueError, RecursionError):
                known = json.loads(text)
        if not isinstance(known, dict):
            raise ValueError(f"{self.path} is damaged at its start: begin anew, without --resume")
        for key, asked in self._header.items():
            if known.get(key) != asked and key != "scene":
                raise ValueError(
                    f"{self.path} is of a search with {key} = {_short(known.get(key))}, not "
                    f"{_short(asked)}: begin anew, without --resume"
                )
        if known.get("scene") != self._header["scene"]:
            raise ValueError(
                f"{self.path} is of a search on another scene '{self._header['name']}': begin "
                "anew, without --resume"
            )
        return len(said) + len(text)

    def _advance(self) -> None:
        """Look at the next record; after the last, go on behind it."""
        assert self._records is not None
        before = self._next
        self._next = next(self._records, None)
        if self._next is None and before is not None:
            end = before[3] + _RECORD.size + _CRC.size + len(before[2])
            self._go_live(end)

    def _go_live(self, end: int) -> None:
        """Cut the file there: what follows is torn, or will be asked differently."""
        self._next = None
        self._size = end
        if self._file is not None:
            try:
                self._file.truncate(end)
            except OSError:
                self._closed = True


def _records(path: Path, start: int) -> Iterator[tuple[int, float, bytes, int]]:
    """Question's CRC, elapsed [s], payload and place of each whole record."""
    with path.open("rb", buffering=2**20) as file:
        whole = file.seek(0, 2)
        at = file.seek(start)
        while True:
            head = file.read(_RECORD.size)
            crc = file.read(_CRC.size)
            if len(crc) < _CRC.size:
                return
            digest, elapsed, length = _RECORD.unpack(head)
            if length > whole - at:
                return
            payload = file.read(length)
            if len(payload) < length or (zlib.crc32(payload, zlib.crc32(head)),) != _CRC.unpack(
                crc
            ):
                return
            yield digest, elapsed, payload, at
            at += len(head) + len(crc) + length


def _digest(question: tuple[object, Floats]) -> int:
    what, designs = question
    start = zlib.crc32(f"{what} {designs.shape}".encode())
    return zlib.crc32(np.ascontiguousarray(designs).data, start)


def _packed(arrays: Arrays) -> bytes:
    parts: list[bytes] = []
    for array in arrays:
        parts.append(struct.pack(f"<{1 + array.ndim}I", array.ndim, *array.shape))
        parts.append(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return b"".join(parts)


def _unpacked(payload: bytes) -> Arrays:
    """The arrays again; none where the payload is no whole number of them."""
    found: list[Floats] = []
    at = 0
    try:
        while at < len(payload):
            (dimensions,) = struct.unpack_from("<I", payload, at)
            shape = struct.unpack_from(f"<{dimensions}I", payload, at + 4)
            at += 4 * (1 + dimensions)
            count = math.prod(shape)
            array = np.frombuffer(payload, "<f8", count, at) if count else np.empty(0)
            found.append(array.astype(np.float64).reshape(shape))  # a copy, its own to change
            at += 8 * count
    except (struct.error, ValueError, OverflowError):
        return ()
    return tuple(found)


def _have(arrays: Arrays, shapes: Sequence[tuple[int, ...]]) -> bool:
    """Whether arrays of numbers have these shapes, -1 for any length."""
    return len(arrays) == len(shapes) and all(
        array.ndim == len(shape)
        and all(asked in (-1, had) for had, asked in zip(array.shape, shape, strict=True))
        and bool(np.isfinite(array).all())
        for array, shape in zip(arrays, shapes, strict=True)
    )


def _hold(file: BinaryIO, path: Path) -> None:
    """Keep a second search from writing here too; systems without such locks go without."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ValueError(f"{path} is being written by a search that still runs") from None
    except OSError:  # a file system that has none
        return


def _short(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k} {v}" for k, v in sorted(value.items()))[:200]
    return repr(value)[:80]
