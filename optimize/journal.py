"""Journal of a search: a table of requests and answers on disk, from which a search resumes.

A method is a deterministic program that requests scores. Started again from its seed, with answers
from the journal instead of simulations, it soon reaches the point where it was stopped, bitwise
the same, and continues from there.

The file is an SQLite database, which is never left with a partial write. Its table `answers` has
one line per request: a digest of the request (scene, versions, kind, design vectors), the time of
the search so far [s], the arrays of the answer, and a checksum of all three, as SQLite has none.
"""

from __future__ import annotations

import hashlib
import sqlite3
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from msgspec import MsgspecError, msgpack

from domino_env.core.files import require_locks
from domino_env.core.types import Floats

SAVE_INTERVAL = 1.0  # [s] between two writes; answers since the last are lost if the process dies
# one process at a time has the file; a process that dies loses no answer in the file
PRAGMAS = ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL")
TABLE = (
    "CREATE TABLE IF NOT EXISTS answers "
    "(request BLOB PRIMARY KEY, seconds REAL, answer BLOB, checksum INTEGER)"
)


class Journal:
    """Journal of one search, which no other search may open at the same time.

    Parameters
    ----------
    path
        The file.
    context
        Everything besides the request that determines an answer, such as scene and versions.
    resume
        True to continue with the answers in the file; otherwise they are deleted.

    Attributes
    ----------
    path
        The file.
    replaying
        True while answers come from the file.

    Raises
    ------
    ValueError
        If another search is writing the file, or if it cannot be written or locked or is damaged.
    """

    def __init__(self, path: Path, context: str, *, resume: bool) -> None:
        self.path = path
        self.replaying = resume and path.exists()
        self._context = hashlib.blake2b(context.encode(), digest_size=16)
        # answers that are not yet in the file
        self._pending: list[tuple[bytes, float, bytes, int]] = []
        self._last_save = float("-inf")  # seconds of the search
        require_locks(path.parent)
        with self._file_errors():
            self._database = sqlite3.connect(path, 0, isolation_level=None, check_same_thread=False)
            for setting in PRAGMAS:
                self._database.execute(f"PRAGMA {setting}")
            self._database.execute(TABLE)
            if not resume:  # delete the answers, not the file, which another search may have open
                self._database.execute("DELETE FROM answers")

    def _digest(self, kind: str, designs: Floats) -> bytes:
        """Return the digest of a request."""
        state = self._context.copy()
        state.update(f"{kind} {designs.shape}".encode())
        state.update(np.ascontiguousarray(designs).tobytes())
        return state.digest()

    def find(self, kind: str, designs: Floats) -> tuple[float, list[Floats]] | None:
        """Find the answer to a request; the first request without an answer ends the replay.

        Parameters
        ----------
        kind
            Kind of the request, such as "scores 1e-06".
        designs
            (B, n) its design vectors.

        Returns
        -------
        tuple of (float, list of ndarray), or None
            Time of the search at the answer [s], and the arrays of the answer; None if the file has
            no answer, or if the replay has ended.

        Raises
        ------
        ValueError
            If the file is damaged.
        """
        if not self.replaying:
            return None
        query = "SELECT request, seconds, answer, checksum FROM answers WHERE request = ?"
        with self._file_errors():
            entry = self._database.execute(query, [self._digest(kind, designs)]).fetchone()
            if entry is not None:
                *line, checksum = entry
                if _checksum(*line) != checksum:
                    raise ValueError("an answer in it is damaged")
                _, seconds, answer = line
                parts = msgpack.decode(answer, type=list[tuple[str, tuple[int, ...], bytes]])
                arrays = [np.frombuffer(x, kind).reshape(shape).copy() for kind, shape, x in parts]
                return seconds, arrays
        self.replaying = False
        return None

    def store(self, kind: str, designs: Floats, seconds: float, arrays: list[Floats]) -> None:
        """Store the answer to a request.

        Parameters
        ----------
        kind, designs
            See `find`.
        seconds
            Time of the search so far [s].
        arrays
            Arrays of the answer.

        Raises
        ------
        ValueError
            If the file cannot be written.
        """
        answer = msgpack.encode([(x.dtype.str, x.shape, x.tobytes()) for x in arrays])
        line = self._digest(kind, designs), seconds, answer
        self._pending.append((*line, _checksum(*line)))
        if seconds - self._last_save > SAVE_INTERVAL:
            self._last_save = seconds
            self._save()

    def close(self) -> None:
        """Write the answers in memory, and release the file.

        Raises
        ------
        ValueError
            If the file cannot be written.
        """
        try:
            self._save()
        finally:
            self._database.close()

    def _save(self) -> None:
        """Write the answers in memory, in one transaction."""
        insert = "INSERT OR IGNORE INTO answers VALUES (?, ?, ?, ?)"
        with self._file_errors(), self._database as database:
            database.execute("BEGIN")
            # after Ctrl-C before `_pending` is emptied, IGNORE allows that they are written again
            database.executemany(insert, self._pending)
        self._pending = []

    @contextmanager
    def _file_errors(self) -> Iterator[None]:
        """Raise errors of the file as ValueError, with the next action."""
        try:
            yield
        except (sqlite3.Error, MsgspecError, TypeError, ValueError) as error:
            raise ValueError(
                f"{self.path} cannot be used ({error}): end the search that still writes it, make "
                "room on the disk, or if it is damaged begin anew in another folder"
            ) from None


def _checksum(request: bytes, seconds: float, answer: bytes) -> int:
    """Return the checksum of a line."""
    return zlib.crc32(request + struct.pack("<d", seconds) + answer)
