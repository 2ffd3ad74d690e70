"""Recorder: whoever asks a problem asks here, and what was answered once is not simulated again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from types import TracebackType

import numpy as np

from optimize.evaluation.bulk import scores_of_pieces
from optimize.evaluation.journal import Journal
from optimize.problem import Floats, Problem


class Recorder:
    """A problem that remembers: answers go into a journal, and come from it where it has them.

    As a context it closes the journal at its end.

    Parameters
    ----------
    problem
        Who answers what no journal has.
    journal
        Of the search, which nobody else touches; None: nothing is remembered.
    executor
        Scores batches of several pieces, see `optimize.evaluation.bulk`; None: this process.
    clock
        Gives the seconds where there is no journal; processor time where the machine has other
        things to do.

    Attributes
    ----------
    problem
        The problem.
    elsewhere
        Whether an executor does the work, so that it pays to ask for many pieces at once.
    """

    def __init__(
        self,
        problem: Problem,
        journal: Journal | None = None,
        executor: Executor | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.problem = problem
        self.elsewhere = executor is not None
        self._journal = journal
        self._executor = executor
        self._clock = clock
        self._began = clock()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._journal is not None:
            self._journal.close()

    @property
    def replaying(self) -> bool:
        """Whether the next answer may come from the journal."""
        return self._journal is not None and self._journal.replaying

    @property
    def seconds(self) -> float:
        """Seconds since `start`, those before the search was stopped and resumed among them."""
        if self._journal is not None:
            return self._journal.seconds
        return self._clock() - self._began

    def start(self) -> None:
        """Begin to count the seconds."""
        self._began = self._clock()
        if self._journal is not None:
            self._journal.start()

    def finish(self) -> None:
        """Let a journal go that is too large to be kept of a search that has finished."""
        if self._journal is not None:
            self._journal.drop_if_large()

    def scores(self, pieces: Sequence[Floats], rtol: float | None = None) -> Iterator[Floats]:
        """Score pieces of designs, one piece after the other.

        Parameters
        ----------
        pieces
            (B, n) designs each; a piece is a question.
        rtol
            How closely to simulate; as the problem does where None.

        Yields
        ------
        ndarray
            (B,) scores of the next piece.

        Raises
        ------
        ExecutorLost
            Where the executor is gone.
        """
        rtol, pieces = rtol or self.problem.rtol, list(pieces)
        while pieces and self.replaying:
            piece = pieces.pop(0)
            yield self._answer((rtol, piece), self._scored(piece, rtol), (len(piece),))[0]
        parts = scores_of_pieces(self.problem, pieces, rtol, self._executor)
        for piece, found in zip(pieces, parts, strict=True):
            if self._journal is not None:
                self._journal.keep((rtol, piece), (found,))
            yield found

    def scores_and_gradients(
        self, designs: Floats, *, at_will: bool = False
    ) -> tuple[Floats, Floats]:
        """Score designs (B, n), with the exact gradient of each, zero where there is none.

        See `Problem.scores_and_gradients`.
        """

        def simulated() -> tuple[Floats, ...]:
            return self.problem.scores_and_gradients(designs, of_dying=False, at_will=at_will)

        question = (f"gradient {at_will}", designs)
        found, gradients = self._answer(question, simulated, (len(designs),), designs.shape)
        return found, gradients

    def lateness(self, design: Floats) -> tuple[float, Floats, Floats]:
        """Find how late each domino of one design (n,) is hit: see `Problem.lateness`."""

        def simulated() -> tuple[Floats, ...]:
            score, late, slopes = self.problem.lateness(design)
            return np.array([score]), late, slopes

        shapes = (1,), (-1,), (-1, self.problem.dimension)
        score, late, slopes = self._answer(("lateness", design[None]), simulated, *shapes)
        return float(score[0]), late, slopes

    def _scored(self, piece: Floats, rtol: float) -> Callable[[], tuple[Floats, ...]]:
        return lambda: (self.problem.scores(piece, rtol),)

    def _answer(
        self,
        question: tuple[object, Floats],
        simulated: Callable[[], tuple[Floats, ...]],
        *shapes: tuple[int, ...],
    ) -> tuple[Floats, ...]:
        if self._journal is None:
            return simulated()
        return self._journal.answer(question, simulated, shapes)
