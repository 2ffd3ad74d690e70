"""A search's journal: what every batch of simulations came to, so that a search can go on.

Any method is a deterministic program that asks for scores.  Run again from its seed, and answered
from the journal instead of by simulation, it is soon where it was, to the bit, and goes on from
there.  Each answer is kept with a digest of its question: a method that asks something else than it
did is told so, and no wrong result comes of it.

The file is an SQLite database with a write-ahead log, which sees to torn writes, to the order of
answers, and that one search alone writes: table `search` has a line of JSON that names scene,
method, seed and versions, table `answers` the numbers.
"""

from __future__ import annotations

import hashlib
import json
import math
import sqlite3
import sys
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domino_env.scenes.scene import Scene

Floats = NDArray[np.float64]
Arrays = tuple[Floats, ...]

OURS = int.from_bytes(b"domJ", "big")  # SQLite's application_id of a journal
FORMAT = 3  # of the tables; 1 was the file of version 0.1.0, no database
PAUSE = 1.0  # [s] of work that a kill may lose
CHUNK = 4 * 2**20  # [bytes] kept in memory at most
PAGE = 16384  # [bytes] that the file grows by; some fifty short answers
LARGEST = 2**30  # [bytes] of a journal: some ten minutes of gradients on two cores
KEPT = 128 * 2**20  # [bytes]; a larger one goes when its search has finished
SIDE_FILES = ("-wal", "-shm", "-journal")  # of a database, while it is open or after a kill

SEARCH = "CREATE TABLE IF NOT EXISTS search (header TEXT)"
ANSWERS = """CREATE TABLE IF NOT EXISTS answers (
    number INTEGER PRIMARY KEY, -- in the order of the questions, from 0
    question INTEGER,           -- a digest of it
    seconds REAL,               -- that the search had taken by then
    answer BLOB,                -- arrays of float64, one after the other
    crc INTEGER                 -- of question and answer: half a page of SQLite's reads as zeros
)"""


class Journal:
    """The journal of one search.

    What an earlier search has left is replaced with the first answers. Where the folder cannot have
    a journal, and from where its disk is full, the search goes on without one, and a sentence on
    standard error says so: what it lacks is simulated again by who resumes.

    Parameters
    ----------
    path
        The file.
    scene, method, seed
        Of the search, as of `optimize.search`.
    versions
        Of what its bits depend on, by name.
    resume
        Begin with what is in the file; from the start where there is none.

    Raises
    ------
    ValueError
        For a file that another search is writing; with `resume`, for one that is no journal, or
        that of another search.
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
        self._number = 0  # of answers so far
        self._rows: Iterator[tuple[int, float, bytes, int]] = iter(())
        self._next: tuple[int, float, bytes] | None = None
        self._waiting: list[tuple[int, int, float, bytes, int]] = []
        self._held = 0  # bytes of them
        self._flushed = float("-inf")  # seconds of the search
        self._begun = False  # to write
        self._database: sqlite3.Connection | None = None
        try:
            self._open(resume)
        except BaseException:
            self._leave()
            raise

    @property
    def replaying(self) -> bool:
        """Whether the next answer may come from the file."""
        return self._next is not None

    @property
    def seconds(self) -> float:
        """Time the search has taken; while answers come from the file, what it had taken then."""
        return self._before + (0.0 if self.replaying else time.perf_counter() - self._since)

    def start(self) -> None:
        """Start the clock of the search."""
        self._since = time.perf_counter()

    def answer(
        self,
        question: tuple[object, Floats],
        compute: Callable[[], Arrays],
        shapes: Sequence[tuple[int, ...]],
    ) -> Arrays:
        """Give what `compute` gives, from the file where it is there.

        Parameters
        ----------
        question
            What is asked, and of which designs (B, n).
        compute
            Finds the arrays of the answer.
        shapes
            Theirs; -1 for a first length that depends.

        Raises
        ------
        ValueError
            Where the search asks something else than it did, and for a damaged file.
        """
        digest = _digest(question)
        if self._next is not None:
            known, elapsed, data = self._next
            if known == digest:
                found = _arrays(data, shapes)
                if found is None:
                    raise self._refused("is damaged")
                self._before, self._since = elapsed, time.perf_counter()
                self._number += 1
                self._advance()
                return found
            # A budget may have cut its last batch short, where a larger one asks for all of it.
            self._advance()
            if self._next is not None:
                raise self._refused(
                    f"is of a search that asked something else after {elapsed:.1f} s: the programs "
                    "or their libraries differ"
                )
        found = compute()
        self.keep(question, found, digest)
        return found

    def keep(
        self, question: tuple[object, Floats], found: Arrays, digest: int | None = None
    ) -> None:
        """Write an answer down."""
        if self._database is None:
            return
        digest = _digest(question) if digest is None else digest
        data = b"".join([array.tobytes() for array in found])
        now = self.seconds
        self._waiting.append((self._number, digest, now, data, zlib.crc32(data, digest)))
        self._number += 1
        self._held += len(data)
        if self._held > CHUNK or now - self._flushed > PAUSE:
            self._flush()

    def close(self) -> None:
        """Write what is still in memory, and let others have the file."""
        if self._waiting:
            self._flush()
        self._leave()

    def drop_if_large(self) -> None:
        """Remove the file, once it is closed, where it is too large for what it can still give."""
        if self.path.exists() and self.path.stat().st_size > KEPT:
            self.path.unlink()

    def _flush(self) -> None:
        self._flushed = self.seconds
        if self._database is None:
            return
        try:
            with self._database as database:
                database.execute("BEGIN")
                if not self._begun:  # what follows is of another search, or was cut short
                    database.execute(SEARCH)
                    database.execute(ANSWERS)
                    database.execute(f"PRAGMA application_id = {OURS}")
                    database.execute(f"PRAGMA user_version = {FORMAT}")
                    database.execute("DELETE FROM search")
                    database.execute("INSERT INTO search VALUES (?)", [json.dumps(self._header)])
                    first = self._waiting[0][0]
                    database.execute("DELETE FROM answers WHERE number >= ?", [first])
                # Ctrl-C may have come between this and the next lines: then it is done once more
                database.executemany(
                    "INSERT OR REPLACE INTO answers VALUES (?, ?, ?, ?, ?)", self._waiting
                )
        except sqlite3.Error as error:
            self._leave()
            _tell(f"{self.path} ends here ({error}): the search goes on without a journal")
        self._begun, self._waiting, self._held = True, [], 0

    def _leave(self) -> None:
        if self._database is not None:
            self._database.close()
            self._database = None

    # what is there already ----------------------------------------------------------------------

    def _open(self, resume: bool) -> None:
        there = self.path.exists()
        try:
            self._connect()
        except sqlite3.Error as error:
            kind = getattr(error, "sqlite_errorcode", 0) & 0xFF  # the rest says more closely why
            if kind == sqlite3.SQLITE_BUSY:
                raise ValueError(
                    f"{self.path} is being written by a search that still runs"
                ) from None
            if kind in (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT):
                if resume:
                    raise self._refused("is no journal of a search") from None
                self._renew()
            elif resume and there:
                raise self._refused(f"cannot be opened ({error})") from None
            else:
                self._leave()
                _tell(
                    f"{self.path} cannot be written ({error}): the search goes without a journal, "
                    "so that --resume would begin it anew"
                )
            return
        if resume:
            self._read()
        elif self._pragma("application_id") != OURS or self._pragma("user_version") != FORMAT:
            self._renew()

    def _connect(self) -> None:
        # None: this file says itself where a transaction begins
        self._database = sqlite3.connect(self.path, timeout=0.0, isolation_level=None)
        self._pragma(f"page_size = {PAGE}")
        self._pragma("locking_mode = EXCLUSIVE")  # a log without memory shared among processes
        if self._pragma("journal_mode = WAL") != "wal":
            raise sqlite3.OperationalError("no write-ahead log there")
        self._pragma("synchronous = NORMAL")
        self._pragma(f"max_page_count = {LARGEST // PAGE}")

    def _pragma(self, words: str) -> object:
        assert self._database is not None
        row = self._database.execute(f"PRAGMA {words}").fetchone()
        return row and row[0]

    def _renew(self) -> None:
        """An empty file in place of one that is no journal of ours."""
        self._leave()
        for end in ("", *SIDE_FILES):
            self.path.with_name(self.path.name + end).unlink(missing_ok=True)
        self._connect()

    def _read(self) -> None:
        assert self._database is not None
        try:
            empty = not self._database.execute("SELECT name FROM sqlite_master").fetchall()
            if empty:  # of a search that ended before its first answer
                return
            if self._pragma("application_id") != OURS:
                raise self._refused("is no journal of a search")
            if self._pragma("user_version") != FORMAT:
                raise self._refused("is a journal of another version")
            known = json.loads(self._database.execute("SELECT header FROM search").fetchone()[0])
            self._require_ours(known)
            self._rows = self._database.execute(
                "SELECT question, seconds, answer, crc FROM answers ORDER BY number"
            )
        except (sqlite3.Error, json.JSONDecodeError, TypeError):
            raise self._refused("is damaged") from None
        self._advance()

    def _require_ours(self, known: dict[str, object]) -> None:
        for key, asked in self._header.items():
            if known.get(key) != asked and key != "scene":
                raise self._refused(
                    f"is of a search with {key} = {_short(known.get(key))}, not {_short(asked)}"
                )
        if known.get("scene") != self._header["scene"]:
            raise self._refused(f"is of a search on another scene '{self._header['name']}'")

    def _advance(self) -> None:
        """Look at the next answer."""
        self._next = None
        try:
            for digest, elapsed, data, crc in self._rows:
                if zlib.crc32(data, digest) != crc:
                    raise self._refused("is damaged")
                self._next = digest, float(elapsed), data
                return
        except (sqlite3.Error, TypeError):
            raise self._refused("is damaged") from None

    def _refused(self, why: str) -> ValueError:
        return ValueError(f"{self.path} {why}: begin anew in another folder, without --resume")


def _digest(question: tuple[object, Floats]) -> int:
    what, designs = question
    return zlib.crc32(designs.tobytes(), zlib.crc32(f"{what} {len(designs)}".encode()))


def _arrays(data: bytes, shapes: Sequence[tuple[int, ...]]) -> Arrays | None:
    """The arrays that these bytes are; None where they are too few or too many."""
    numbers = np.frombuffer(data[: len(data) // 8 * 8]).copy()  # theirs to change
    rest = numbers.size - sum(math.prod(shape) for shape in shapes if shape[0] >= 0)
    row = sum(math.prod(shape[1:]) for shape in shapes if shape[0] < 0)
    sizes = [(rest // row if row and n < 0 else n, *more) for n, *more in shapes]
    ends = np.cumsum([math.prod(size) for size in sizes])
    if ends[-1] * 8 != len(data) or min(map(min, sizes)) < 0:
        return None
    parts = np.split(numbers, ends[:-1])
    return tuple(part.reshape(size) for part, size in zip(parts, sizes, strict=True))


def _short(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{k} {v}" for k, v in sorted(value.items()))[:200]
    return repr(value)[:80]


def _tell(sentence: str) -> None:
    print(f"domino: {sentence}", file=sys.stderr, flush=True)
