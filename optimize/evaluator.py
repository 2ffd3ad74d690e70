"""Evaluator: scores for a search method, within limits, with the best so far and a journal."""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from functools import partial

import numpy as np

from domino_env.core.checks import numbers, require, require_type
from domino_env.core.files import amount
from domino_env.core.threads import allowed_threads
from domino_env.core.types import Floats
from domino_env.rigid.simulation import StoppedError
from optimize.executors import loss_as_error
from optimize.journal import Journal
from optimize.problem import Problem, Scores

CHUNK_DOMINOES = 40_000  # dominoes simulated between two checks of the limits, some 30 ms
MAX_CHUNK = 256  # designs between two checks, so that enough good ones become finalists
EXECUTOR_LOAD = 2_000_000  # dominoes that fill an executor, some 3 s of one core
GRADIENT_COST = 4  # simulations that take as long as a gradient
TOLERANCE = 1e-4  # relative gain of the second half of a search without a limit that ends it
# Evaluations of a search without a limit, times the mean of dominoes and variables: before its gain
# is considered, and at most with the default tolerance. They are some 12 and 13 s of one core.
LEAST_EFFORT, MOST_EFFORT = 5_000_000, 5_500_000
# such means below and above which the number of evaluations is the same
LEAST_SIZE, LARGEST_SIZE = 40, 250
MAX_FINALISTS = 8  # best designs kept, to be simulated closely at the end

# evaluations, simulated intervals between hits, seconds and best score at an improvement
TraceEntry = tuple[int, int, float, float]


class BudgetSpent(BaseException):  # no error: the ordinary end of a search
    """Raised into a method when its evaluator has reached a limit.

    An `except Exception` of a method does not catch it.
    """


class Evaluator:
    """Evaluator of design vectors for a method, within limits.

    It counts evaluations, keeps the best layouts, and stores every answer in a journal, from which
    a stopped search can resume. At a limit it raises `BudgetSpent`. Its clock starts with the
    object.

    Parameters
    ----------
    problem
        The problem.
    max_evaluations
        Largest number of layouts that may be simulated; None for no limit.
    max_seconds
        Time that may be spent; None for no limit.
    tolerance
        Relative gain of the second half of the effort below which the search ends, after a least
        effort; the largest effort is inverse to it. None for no such end.
    callback
        Function that is called with the evaluator after every batch; by default, nothing is.
    journal
        Journal of the search; None for none.
    executor
        Executor that simulates batches in chunks; None for this process.
    clock
        Function that returns seconds, such as `time.process_time`.

    Attributes
    ----------
    evaluations
        Number of layouts simulated so far.
    falls
        Number of intervals between hits simulated so far; an evaluation of a "robust" scene
        simulates hundreds of layouts.
    trace
        (evaluations, falls, seconds, best score) at every improvement.
    finalists
        The last improvements, (score, design) each, the best last.
    status
        Text of the method about the reliability of its best layout.
    effort
        Number of evaluations so far, each gradient counted as four.
    """

    def __init__(
        self,
        problem: Problem,
        max_evaluations: int | None = None,
        max_seconds: float | None = None,
        *,
        tolerance: float | None = None,
        callback: Callable[[Evaluator], None] = lambda _: None,
        journal: Journal | None = None,
        executor: Executor | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        require_type("problem", problem, Problem, "a Problem, such as Problem('sprint')")
        require("max_evaluations", max_evaluations, 1, whole=True, optional=True)
        require("max_seconds", max_seconds, above=0.0, unit="s", optional=True)
        self.problem, self.tolerance = problem, tolerance
        self.max_evaluations, self.max_seconds = max_evaluations, max_seconds
        self.evaluations = self.falls = self.effort = 0
        self.trace: list[TraceEntry] = []
        self.finalists: deque[tuple[float, Floats]] = deque(maxlen=MAX_FINALISTS)
        self.status = ""
        self._efforts: list[int] = []  # at the improvements
        cost = min(max(0.5 * (problem.scene.count + problem.dimension), LEAST_SIZE), LARGEST_SIZE)
        cost *= (problem.dominoes / problem.scene.count) ** 0.5  # simulations of a score
        self.most_effort = MOST_EFFORT / cost * TOLERANCE / tolerance if tolerance else np.inf
        self.least_effort = min(LEAST_EFFORT / cost, self.most_effort)
        self._callback, self._journal, self._executor = callback, journal, executor
        self._chunk = min(max(8, CHUNK_DOMINOES // problem.dominoes), MAX_CHUNK)
        self._stop: Callable[[], bool] | None = None
        if max_seconds is not None and problem.scene.floor_friction is not None:
            self._chunk = min(self._chunk, allowed_threads())  # each may take seconds
            self._stop = lambda: bool(self.finalists) and self.seconds >= max_seconds
        self._clock = clock
        # [s] spent before the search, and at the last replay
        self._seconds_before = self._seconds_replayed = 0.0
        self._start = clock()

    # limits -------------------------------------------------------------------------------------

    @property
    def seconds(self) -> float:
        """Time of the search so far, including the time before it was stopped and resumed [s]."""
        replaying = self._journal is not None and self._journal.replaying
        running = 0.0 if replaying else self._clock() - self._start
        return self._seconds_before + self._seconds_replayed + running

    @property
    def remaining(self) -> float:
        """Number of evaluations that remain; inf without a limit of evaluations."""
        return float(self.max_evaluations or np.inf) - self.evaluations

    @property
    def remaining_seconds(self) -> float | None:
        """Time that is left [s], more than 0; None without a limit."""
        return None if self.max_seconds is None else max(self.max_seconds - self.seconds, 1e-9)

    @property
    def progress(self) -> float:
        """Spent fraction, 0 to 1, of the limit that is reached first."""
        evaluations = self.evaluations / (self.max_evaluations or np.inf)
        seconds = self.seconds / (self.max_seconds or np.inf)
        return min(max(self.effort / self.most_effort, evaluations, seconds), 1.0)

    @property
    def stop_reason(self) -> str:
        """Limit that is reached, in words; empty while more may be evaluated."""
        if not self.finalists:  # even a limit of no time allows a first evaluation
            return ""
        if self.max_evaluations is not None and self.evaluations >= self.max_evaluations:
            return f"limit of {amount(self.max_evaluations, 'layout')} reached"
        if self.max_seconds is not None and self.seconds >= self.max_seconds:
            return f"limit of {self.max_seconds:g} s reached"
        if self.tolerance is not None and self.effort >= self.least_effort:
            gain = self.late_gain
            if gain < self.tolerance or self.effort >= self.most_effort:
                return (
                    f"the second half of the search gained {gain:.2g} of the score (tolerance "
                    f"{self.tolerance:g}); twice the time, by --seconds, may gain as much again"
                )
        return ""

    @property
    def late_gain(self) -> float:
        """Gain of the second half of the effort, relative to the score.

        The best score rises about with the logarithm of the effort, or more slowly, so that as much
        effort again is not expected to gain more.
        """
        i = bisect_right(self._efforts, self.effort // 2) - 1
        earlier = self.trace[i][3] if i >= 0 else -np.inf
        return (self.best_score - earlier) / abs(self.best_score)

    def require_more(self) -> None:
        """Raise `BudgetSpent`, with the reason, if a limit is reached."""
        reason = self.stop_reason
        if reason:
            raise BudgetSpent(reason)

    @property
    def batch_size(self) -> int:
        """Size of a batch that fills an executor, for methods that evaluate any number at once."""
        return max(1, EXECUTOR_LOAD // (self.problem.dominoes * self._chunk)) * self._chunk

    def add_seconds(self, seconds: float) -> None:
        """Count time spent before the search [s], for example on a training."""
        require("seconds", seconds, 0.0, unit="s")
        self._seconds_before += seconds

    # the best so far ----------------------------------------------------------------------------

    @property
    def best_score(self) -> float:
        """Best score so far; -inf before the first."""
        return self.finalists[-1][0] if self.finalists else -np.inf

    @property
    def best(self) -> Floats:
        """Best design vector (n,) so far.

        Raises
        ------
        ValueError
            If nothing has been evaluated yet.
        """
        if not self.finalists:
            raise ValueError("nothing has been scored yet: call `evaluate` first")
        return self.finalists[-1][1]

    def record(self, scores: Scores, design: Callable[[int], Floats]) -> None:
        """Count layouts that were simulated elsewhere at the tolerance of the problem.

        Parameters
        ----------
        scores
            Scores of the layouts.
        design
            Function that returns the design vector of layout i; called only for a new best.

        Raises
        ------
        ValueError
            If there are more layouts than remaining evaluations.
        """
        require_type("scores", scores, Scores, "Scores, as Problem.evaluate returns")
        hint = "see `remaining`"
        require("layouts to record", len(scores.score), 0, self.remaining, hint=hint, whole=True)
        self._count(scores)
        self._update_best(scores, design)

    # evaluation ---------------------------------------------------------------------------------

    def evaluate(
        self,
        designs: Floats,
        gradient: bool = False,
        *,
        rtol: float | None = None,
        differences: bool = True,
        relaxed: bool = False,
    ) -> Scores:
        """Simulate design vectors and score them.

        Parameters
        ----------
        designs, gradient, rtol, differences, relaxed
            See `Problem.evaluate`.

        Returns
        -------
        Scores
            Scores, reaches and falls, and gradients if requested.

        Raises
        ------
        BudgetSpent
            If fewer evaluations remain; as many as remain are simulated first.
        """
        designs = numbers("designs", designs, None)
        single = designs.ndim < 2
        designs = designs[None] if single else designs
        if not len(designs):
            raise ValueError("no designs are given: evaluate one or more")
        results: list[Scores] = []
        rtol = self.problem.rtol if rtol is None else rtol
        # the same chunks with and without an executor: no result may depend on it
        step = max(1, self._chunk // GRADIENT_COST) if gradient else self._chunk
        batch = step if gradient or self._executor is None else self.batch_size
        start = 0
        while start < len(designs):
            self.require_more()
            end = start + int(min(batch, len(designs) - start, self.remaining))
            chunks = [designs[i : min(i + step, end)] for i in range(start, end, step)]
            outputs = self._evaluate(chunks, gradient, rtol, relaxed)
            try:
                for chunk, scores in zip(chunks, outputs, strict=True):
                    self._count(scores)
                    if gradient and differences:
                        self.problem.fill_gradients(chunk, scores, self.evaluate)
                    self._update_best(scores, chunk.__getitem__)
                    results.append(scores)
            except StoppedError:  # during a simulation that takes seconds
                raise BudgetSpent(self.stop_reason) from None
            start = end
        arrays = zip(*map(_pack, results), strict=True)
        scores = _unpack([np.concatenate(parts) for parts in arrays])
        return scores.squeeze() if single else scores

    def lateness(self, design: Floats) -> tuple[Scores, Floats, Floats]:
        """Compute how late each domino of a layout is hit: see `Problem.lateness`.

        Raises
        ------
        BudgetSpent
            If no evaluation remains.
        """
        self.require_more()
        design = np.asarray(design, dtype=np.float64)
        answer = self._replay("lateness", design[None])
        if answer is None:
            scores, lateness, gradient = self.problem.lateness(design)
            answer = [*_pack(scores), lateness, gradient]
            self._store("lateness", design[None], answer)
        *arrays, lateness, gradient = answer
        scores = _unpack(arrays)
        self._count(scores)
        self._update_best(scores, lambda _: design)
        return scores, lateness, gradient

    @contextmanager
    def borrow(self, problem: Problem, evaluations: int) -> Iterator[Evaluator]:
        """Provide an evaluator of shorter layouts, which are counted by their dominoes.

        It has no journal: a resumed search evaluates these layouts again.

        Parameters
        ----------
        problem
            Problem of the shorter layouts.
        evaluations
            Largest number of shorter layouts; at most half of the remaining evaluations is used.

        Raises
        ------
        BudgetSpent
            At the end, if this evaluator has reached a limit.
        """
        cost = problem.dominoes / self.problem.dominoes  # of a shorter layout, in evaluations
        if self.max_evaluations is not None:
            evaluations = max(1, min(evaluations, int(0.5 * self.remaining / cost)))
        shorter = Evaluator(
            problem, evaluations, self.remaining_seconds, callback=lambda _: self._callback(self),
            clock=self._clock,
        )  # fmt: skip
        try:
            yield shorter
        except BudgetSpent:
            pass
        finally:
            self.evaluations += math.ceil(shorter.evaluations * cost)
            self.effort += math.ceil(shorter.effort * cost)
            self.falls += shorter.falls
        self.require_more()

    def _evaluate(
        self, chunks: Sequence[Floats], gradient: bool, rtol: float, relaxed: bool
    ) -> Iterator[Scores]:
        """Yield the scores of one chunk after the other, from the journal as far as it goes."""
        kind = f"gradient {relaxed}" if gradient else f"scores {rtol}"
        chunks = list(chunks)
        results: Iterator[Scores]
        while chunks and (arrays := self._replay(kind, chunks[0])) is not None:
            chunks.pop(0)
            yield _unpack(arrays)
        evaluate = partial(
            self.problem.evaluate, gradient=gradient, rtol=rtol, differences=False, relaxed=relaxed
        )
        with loss_as_error():
            if self._executor is None or len(chunks) < 2:
                results = (evaluate(chunk, stop=self._stop) for chunk in chunks)
            else:
                results = self._executor.map(evaluate, chunks)
            for chunk, scores in zip(chunks, results, strict=True):
                self._store(kind, chunk, _pack(scores))
                yield scores

    def _replay(self, kind: str, designs: Floats) -> list[Floats] | None:
        """Return the answer of the journal, if there is one, and continue from its time."""
        entry = None if self._journal is None else self._journal.find(kind, designs)
        if entry is None:
            return None
        seconds, arrays = entry
        self._seconds_replayed, self._start = max(self._seconds_replayed, seconds), self._clock()
        return arrays

    def _store(self, kind: str, designs: Floats, arrays: list[Floats]) -> None:
        """Write an answer into the journal, if there is one."""
        if self._journal is not None:
            self._journal.store(kind, designs, self.seconds - self._seconds_before, arrays)

    def _count(self, scores: Scores) -> None:
        """Add the effort of simulated layouts."""
        self.evaluations += len(scores.score)
        self.effort += len(scores.score) * (1 if scores.gradient is None else GRADIENT_COST)
        self.falls += int(scores.falls.sum())

    def _update_best(self, scores: Scores, design: Callable[[int], Floats]) -> None:
        """Keep the best of the layouts, if it is a new best, and call the callback."""
        i = int(np.argmax(scores.score))
        score = float(scores.score[i])
        if score > self.best_score:
            best = np.array(design(i))
            self._efforts.append(self.effort)
            self.trace.append((self.evaluations, self.falls, self.seconds, score))
            self.finalists.append((score, best))
        self._callback(self)


def _pack(scores: Scores) -> list[Floats]:
    """Return the arrays that a journal stores."""
    arrays = [scores.score, scores.reach, scores.falls.astype(np.float64)]
    return arrays if scores.gradient is None else [*arrays, scores.gradient]


def _unpack(arrays: Sequence[Floats]) -> Scores:
    """Return the scores of arrays that a journal has stored."""
    score, reach, falls, *gradient = arrays
    return Scores(score, reach, falls.astype(np.int64), *gradient)
