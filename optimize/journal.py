"""Journal of a search: a table of questions and answers on disk, from which a search resumes.

A method is a deterministic program that asks for scores. Started again from its seed and answered
from the journal instead of by simulation, it soon reaches the point where it was stopped, bitwise
the same, and continues from there.

The file is an SQLite database, which takes care of torn writes. Its table `answers` has one line
per question: a digest of the question (scene, versions, kind of question, design vectors), the
seconds of the search so far, and the arrays of the answer.
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
TABLE = "CREATE TABLE IF NOT EXISTS answers (question BLOB PRIMARY KEY, seconds REAL, answer BLOB)"


class Journal:
    """The journal of one search, which no other search may open at the same time.

    Where a folder cannot hold a journal, and once its disk is full, the search continues without
    one, and one line on standard error says so.

    Parameters
    ----------
    path
        The file.
    context
        Everything besides the question that decides an answer, such as scene and versions.
    resume
        Continue with the answers in the file; otherwise they are deleted.

    Attributes
    ----------
    replaying
        Whether the next answer may come from the file.

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
            for words in ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL"):
                self._database.execute(f"PRAGMA {words}")
            self._database.execute(TABLE)
        except sqlite3.Error as error:
            self._leave()
            if "locked" in str(error):
                raise ValueError(f"{path} is being written by a search that still runs") from None
            if self.replaying:
                raise self._damaged(error) from None
            _tell(
                f"{path} cannot be written ({error}): the search goes without a journal, "
                "so that --resume would begin it anew"
            )

    def digest(self, kind: str, designs: Floats) -> bytes:
        """Return the digest of a question.

        Parameters
        ----------
        kind
            What is asked.
        designs
            (B, n) design vectors about which it is asked.
        """
        question = self._context.copy()
        question.update(f"{kind} {designs.shape}".encode())
        question.update(np.ascontiguousarray(designs).tobytes())
        return question.digest()

    def find(self, question: bytes) -> tuple[float, list[Floats]] | None:
        """Return the seconds and the arrays of an answer; the first one missing ends the replay.

        Raises
        ------
        ValueError
            For a damaged file.
        """
        if not self.replaying or self._database is None:
            return None
        words = "SELECT seconds, answer FROM answers WHERE question = ?"
        try:
            row = self._database.execute(words, [question]).fetchone()
            if row is not None:
                parts = msgpack.decode(row[1], type=list[tuple[tuple[int, ...], bytes]])
                arrays = [np.frombuffer(data).reshape(shape).copy() for shape, data in parts]
                return float(row[0]), arrays
        except (sqlite3.Error, MsgspecError, TypeError, ValueError) as error:
            raise self._damaged(error) from None
        self.replaying = False
        return None

    def keep(self, question: bytes, seconds: float, arrays: list[Floats]) -> None:
        """Write down an answer, with the seconds of the search so far."""
        if self._database is None:
            return
        answer = msgpack.encode([(array.shape, array.tobytes()) for array in arrays])
        self._waiting.append((question, seconds, answer))
        if seconds - self._saved > PAUSE:
            self._saved = seconds
            self._save()

    def close(self) -> None:
        """Write what is still in memory, and release the file."""
        self._save()
        self._leave()

    def _save(self) -> None:
        if self._database is None or not self._waiting:
            return
        try:
            with self._database as database:
                database.execute("BEGIN")
                # Ctrl-C may come between this and the next lines: then it is done once more
                database.executemany(
                    "INSERT OR IGNORE INTO answers VALUES (?, ?, ?)", self._waiting
                )
        except sqlite3.Error as error:
            self._leave()
            _tell(f"{self.path} ends here ({error}): the search goes on without a journal")
        self._waiting = []

    def _leave(self) -> None:
        if self._database is not None:
            self._database.close()
            self._database = None

    def _damaged(self, error: Exception) -> ValueError:
        return ValueError(
            f"{self.path} is damaged or no journal of a search ({error}): begin anew in another "
            "folder, without --resume"
        )


def _tell(sentence: str) -> None:
    print(f"domino: {sentence}", file=sys.stderr, flush=True)
