"""Journal of a search: a table of requests and answers on disk, from which a search resumes.

A method is a deterministic program that requests scores. Started again from its seed, with answers
from the journal instead of simulations, it soon reaches the point where it was stopped, bitwise
the same, and continues from there.

The file is an SQLite database, which guards against torn writes. Its table `answers` has one line
per request: a digest of the request (scene, versions, kind, design vectors), the seconds of the
search so far, and the arrays of the answer.
"""

from __future__ import annotations

import hashlib
import sqlite3
import sys
from pathlib import Path

import numpy as np
from msgspec import MsgspecError, msgpack

from domino_env.core.types import Floats

PAUSE = 1.0  # [s] of work that a kill may lose
SIDE_FILES = ("-wal", "-shm", "-journal")  # of a database, while it is open or after a kill
SETTINGS = ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL")
TABLE = "CREATE TABLE IF NOT EXISTS answers (request BLOB PRIMARY KEY, seconds REAL, answer BLOB)"


class Journal:
    """The journal of one search, which no other search may open at the same time.

    Where a folder cannot hold a journal, and once its disk is full, the search continues without
    one, and one line on standard error says so.

    Parameters
    ----------
    path
        The file.
    context
        Everything besides the request that determines an answer, such as scene and versions.
    resume
        Continue with the answers in the file; otherwise they are deleted.

    Attributes
    ----------
    replaying
        The next answer may come from the file.

    Raises
    ------
    ValueError
        For a file that another search is writing and, with `resume`, for one that is damaged or no
        journal.
    """

    def __init__(self, path: Path, context: str, *, resume: bool) -> None:
        self.path = path
        self.replaying = resume and path.exists()
        self._context = hashlib.blake2b(context.encode(), digest_size=16)
        self._waiting: list[tuple[bytes, float, bytes]] = []
        self._saved = float("-inf")
        self._database: sqlite3.Connection | None = None
        if not resume:
            for end in ("", *SIDE_FILES):
                path.with_name(path.name + end).unlink(missing_ok=True)
        try:
            self._database = sqlite3.connect(path, timeout=0.0, isolation_level=None)
            for setting in SETTINGS:
                self._database.execute(f"PRAGMA {setting}")
            self._database.execute(TABLE)
        except sqlite3.Error as error:
            self._release()
            if "locked" in str(error):
                raise ValueError(f"{path} is being written by a search that still runs") from None
            if self.replaying:
                raise self._damaged(error) from None
            _print(
                f"{path} cannot be written ({error}): the search runs without a journal, so "
                "--resume will begin it anew"
            )

    def digest(self, kind: str, designs: Floats) -> bytes:
        """Return the digest of a request.

        Parameters
        ----------
        kind
            Kind of the request.
        designs
            (B, n) its design vectors.
        """
        state = self._context.copy()
        state.update(f"{kind} {designs.shape}".encode())
        state.update(np.ascontiguousarray(designs).tobytes())
        return state.digest()

    def find(self, request: bytes) -> tuple[float, list[Floats]] | None:
        """Return the seconds and the arrays of an answer; the first one missing ends the replay.

        Raises
        ------
        ValueError
            For a damaged file.
        """
        if not self.replaying or self._database is None:
            return None
        query = "SELECT seconds, answer FROM answers WHERE request = ?"
        try:
            entry = self._database.execute(query, [request]).fetchone()
            if entry is not None:
                parts = msgpack.decode(entry[1], type=list[tuple[tuple[int, ...], bytes]])
                arrays = [np.frombuffer(data).reshape(shape).copy() for shape, data in parts]
                return float(entry[0]), arrays
        except (sqlite3.Error, MsgspecError, TypeError, ValueError) as error:
            raise self._damaged(error) from None
        self.replaying = False
        return None

    def keep(self, request: bytes, seconds: float, arrays: list[Floats]) -> None:
        """Store an answer, with the seconds of the search so far."""
        if self._database is None:
            return
        answer = msgpack.encode([(array.shape, array.tobytes()) for array in arrays])
        self._waiting.append((request, seconds, answer))
        if seconds - self._saved > PAUSE:
            self._saved = seconds
            self._save()

    def close(self) -> None:
        """Write what is still in memory, and release the file."""
        self._save()
        self._release()

    def _save(self) -> None:
        if self._database is None or not self._waiting:
            return
        try:
            with self._database as database:
                database.execute("BEGIN")
                # Ctrl-C may come between this and the next lines: then they are repeated
                database.executemany(
                    "INSERT OR IGNORE INTO answers VALUES (?, ?, ?)", self._waiting
                )
        except sqlite3.Error as error:
            self._release()
            _print(f"{self.path} ends here ({error}): the search continues without a journal")
        self._waiting = []

    def _release(self) -> None:
        if self._database is not None:
            self._database.close()
            self._database = None

    def _damaged(self, error: Exception) -> ValueError:
        return ValueError(
            f"{self.path} is damaged or no journal of a search ({error}): begin anew in another "
            "folder, without --resume"
        )


def _print(sentence: str) -> None:
    print(f"domino: {sentence}", file=sys.stderr, flush=True)
