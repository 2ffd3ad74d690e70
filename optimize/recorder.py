"""Recorder: whoever asks a problem asks here, and what was answered once is not simulated again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from types import TracebackType

import numpy as np

from domino_env.scenes.objectives import Evaluation
from optimize.bulk import evaluations
from optimize.journal import Journal
from optimize.problem import Problem
from optimize.variables import Floats


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
        Scores batches of several pieces, see `optimize.bulk`; None: this process.
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

    def beside(self, problem: Problem) -> Recorder:
        """Give one for another problem, by the same clock, that remembers nothing."""
        return Recorder(problem, clock=self._clock)

    def start(self) -> None:
        """Begin to count the seconds."""
        self._began = self._clock()
        if self._journal is not None:
            self._journal.start()

    def finish(self) -> None:
        """Let a journal go that is too large to be kept of a search that has finished."""
        if self._journal is not None:
            self._journal.drop_if_large()

    def evaluations(
        self, pieces: Sequence[Floats], rtol: float | None = None
    ) -> Iterator[Evaluation]:
        """Evaluate pieces of designs, one piece after the other.

        Parameters
        ----------
        pieces
            (B, n) designs each; a piece is a question.
        rtol
            How closely to simulate; as the problem does where None.

        Yields
        ------
        Evaluation
            Of the next piece.

        Raises
        ------
        ExecutorLost
            Where the executor is gone.
        """
        rtol, pieces = rtol or self.problem.rtol, list(pieces)
        while pieces and self.replaying:
            piece = pieces.pop(0)
            shapes = [(len(piece),)] * 3
            yield _unpacked(*self._answer((rtol, piece), self._evaluated(piece, rtol), *shapes))
        parts = evaluations(self.problem, pieces, rtol, self._executor)
        for piece, found in zip(pieces, parts, strict=True):
            if self._journal is not None:
                self._journal.keep((rtol, piece), _packed(found))
            yield found

    def evaluations_and_gradients(
        self, designs: Floats, *, at_will: bool = False
    ) -> tuple[Evaluation, Floats]:
        """Evaluate designs (B, n), with the exact gradient of each, zero where there is none.

        See `Problem.evaluate_with_gradients`.
        """

        def simulated() -> tuple[Floats, ...]:
            found, gradients = self.problem.evaluate_with_gradients(designs, at_will=at_will)
            return *_packed(found), gradients

        question, each = (f"gradient {at_will}", designs), (len(designs),)
        *found, gradients = self._answer(question, simulated, each, each, each, designs.shape)
        return _unpacked(*found), gradients

    def lateness(self, design: Floats) -> tuple[Evaluation, Floats, Floats]:
        """Find how late each domino of one design (n,) is hit: see `Problem.lateness`."""

        def simulated() -> tuple[Floats, ...]:
            found, late, slopes = self.problem.lateness(design)
            return *_packed(found), late, slopes

        shapes = (1,), (1,), (1,), (-1,), (-1, self.problem.dimension)
        *found, late, slopes = self._answer(("lateness", design[None]), simulated, *shapes)
        return _unpacked(*found), late, slopes

    def _evaluated(self, piece: Floats, rtol: float) -> Callable[[], tuple[Floats, ...]]:
        return lambda: _packed(self.problem.evaluate(piece, rtol))

    def _answer(
        self,
        question: tuple[object, Floats],
        simulated: Callable[[], tuple[Floats, ...]],
        *shapes: tuple[int, ...],
    ) -> tuple[Floats, ...]:
        if self._journal is None:
            return simulated()
        return self._journal.answer(question, simulated, shapes)


def _packed(found: Evaluation) -> tuple[Floats, Floats, Floats]:
    """As a journal keeps it."""
    return found.score, found.reach, found.falls.astype(np.float64)


def _unpacked(score: Floats, reach: Floats, falls: Floats) -> Evaluation:
    return Evaluation(score, reach, falls.astype(np.int64))
