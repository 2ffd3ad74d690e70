"""Evaluator: scores of design vectors for a search method, within limits."""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from functools import partial
from threading import RLock
from typing import cast

import numpy as np

from domino_env.core.checks import require, require_type
from domino_env.core.files import amount
from domino_env.core.threads import allowed_threads
from domino_env.core.types import Floats
from domino_env.rigid.simulation import StoppedError
from domino_env.scenes.objectives import Scores
from domino_env.scenes.placement import MOST_DRAWN_DOMINOES
from optimize.executors import loss_as_error, require_executor
from optimize.journal import Journal
from optimize.problem import Problem

CHUNK_DOMINOES = 40_000  # dominoes of a chunk, simulated in some 30 ms by two cores
MAX_CHUNK = 256  # layouts of a chunk, of which only the best one can become a finalist
EXECUTOR_LOAD = 2_000_000  # dominoes that fill an executor, some 3 s of one core
GRADIENT_COST = 4  # simulations that take as long as a gradient
TOLERANCE = 1e-4  # a search without a limit ends if its second half gains relatively less
# The size of a problem is the mean of its numbers of dominoes and variables, clipped to LEAST_SIZE
# and LARGEST_SIZE. A search with a tolerance has an effort of at least LEAST_EFFORT / size (some
# 12 s of one core) and, with the default tolerance, of at most MOST_EFFORT / size (some 13 s).
LEAST_EFFORT, MOST_EFFORT = 5_000_000, 5_500_000
LEAST_SIZE, LARGEST_SIZE = 40, 250
MAX_FINALISTS = 8  # improvements kept, to be simulated at a tight tolerance at the end

# evaluations, simulated intervals between hits, seconds and best score at an improvement
TraceEntry = tuple[int, int, float, float]


class BudgetSpent(BaseException):  # no error: the ordinary end of a search
    """Exception that ends a method when its evaluator has reached a limit.

    An `except Exception` of the method does not catch it.
    """


class Evaluator:
    """Evaluator of design vectors for a method, within limits.

    It counts evaluations, keeps the best layouts, and stores every answer in a journal, from which
    a stopped search can resume. At a limit it raises `BudgetSpent`. Its time begins when it is
    constructed. Several threads may call `evaluate`; one at a time is served.

    Parameters
    ----------
    problem
        The problem.
    max_evaluations
        Largest number of layouts that may be simulated; None for no limit.
    max_seconds
        Time that may be spent [s]; None for no limit.
    tolerance
        Relative gain of the second half of the effort below which the search ends, after
        `least_effort`; `most_effort` is inversely proportional to it. None for no such end.
    callback
        Function that is called with the evaluator after every batch; it does nothing by default.
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
        Number of intervals between hits simulated so far; an evaluation with draws of
        placement noise simulates many layouts.
    trace
        (evaluations, falls, seconds, best score) at every improvement.
    finalists
        The last improvements, at most eight, as (score, design vector), the best last.
    status
        Text of the method about the reliability of its best layout.
    effort
        Number of evaluations so far, each gradient counted as four.
    least_effort
        Effort from which on `tolerance` may end the search.
    most_effort
        Effort at which a search with a tolerance ends; inf without a tolerance.

    Raises
    ------
    ValueError
        If a limit is out of its range.
    TypeError
        If an argument is of another type.
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
        require_options(tolerance, callback, executor, clock)
        require_type("journal", journal, Journal | None, "a Journal, or None")
        self.problem, self.tolerance = problem, tolerance
        self.max_evaluations, self.max_seconds = max_evaluations, max_seconds
        self.evaluations = self.falls = self.effort = 0
        self.trace: list[TraceEntry] = []
        self.finalists: deque[tuple[float, Floats]] = deque(maxlen=MAX_FINALISTS)
        self.status = ""
        self._lock = RLock()  # one thread evaluates at a time
        self._efforts: list[int] = []  # effort at each improvement
        size = min(max(0.5 * (problem.scene.count + problem.dimension), LEAST_SIZE), LARGEST_SIZE)
        # a score that takes k simulations is computed less often, by a factor of √k
        size *= (problem.dominoes / problem.scene.count) ** 0.5
        self.most_effort = MOST_EFFORT / size * TOLERANCE / tolerance if tolerance else np.inf
        self.least_effort = min(LEAST_EFFORT / size, self.most_effort)
        self._callback, self._journal, self._executor = callback, journal, executor
        # layouts of a chunk, which are simulated between two checks of the limits
        drawn = problem.dominoes // problem.scene.simulator.cost  # dominoes in memory per layout
        least = min(max(1, MOST_DRAWN_DOMINOES // drawn), 8)
        self._chunk = min(max(least, CHUNK_DOMINOES // problem.dominoes), MAX_CHUNK)
        self._stop: Callable[[], bool] | None = None
        if max_seconds is not None and problem.scene.simulator.is_slow:
            self._chunk = min(self._chunk, allowed_threads())  # each simulation may take seconds
            self._stop = lambda: bool(self.finalists) and self.seconds >= max_seconds
        self._clock = clock
        # time spent before the search, and time of the search at the last replayed answer [s]
        self._seconds_before = self._seconds_replayed = 0.0
        self._start = clock()

    # limits -------------------------------------------------------------------------------------

    @property
    def seconds(self) -> float:
        """Time of the search so far [s], with that of earlier runs and of `add_seconds`."""
        replaying = self._journal is not None and self._journal.replaying
        running = 0.0 if replaying else self._clock() - self._start
        return self._seconds_before + self._seconds_replayed + running

    @property
    def remaining(self) -> float:
        """Number of evaluations that remain; inf without a limit of evaluations."""
        return float(self.max_evaluations or np.inf) - self.evaluations

    @property
    def remaining_seconds(self) -> float | None:
        """Time that is left [s], at least 1e-9, as a limit must be positive; None without one."""
        return None if self.max_seconds is None else max(self.max_seconds - self.seconds, 1e-9)

    @property
    def may_end(self) -> bool:
        """True if a method may end before a limit: with a tolerance, or without any limit."""
        is_limited = self.max_evaluations is not None or self.max_seconds is not None
        return self.tolerance is not None or not is_limited

    @property
    def progress(self) -> float:
        """Spent fraction, 0 to 1, of the limit that is nearest."""
        evaluations = self.evaluations / (self.max_evaluations or np.inf)
        seconds = self.seconds / (self.max_seconds or np.inf)
        return min(max(self.effort / self.most_effort, evaluations, seconds), 1.0)

    @property
    def stop_reason(self) -> str:
        """Limit that is reached, in words; empty while more may be evaluated."""
        if not self.finalists:  # the first evaluation is allowed even if no time is left
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
        """Gain of the second half of the effort, relative to the score; inf if only it has scores.

        The best score rises about with the logarithm of the effort, or more slowly. So doubling the
        effort is not expected to gain more than this.
        """
        i = bisect_right(self._efforts, self.effort // 2) - 1
        earlier = self.trace[i][3] if i >= 0 else -np.inf
        return (self.best_score - earlier) / abs(self.best_score)

    def require_more(self) -> None:
        """Raise `BudgetSpent`, with the reason, if a limit is reached."""
        if reason := self.stop_reason:
            raise BudgetSpent(reason)

    @property
    def batch_size(self) -> int:
        """Number of layouts that fill an executor, for methods that evaluate any number at once."""
        return max(1, EXECUTOR_LOAD // (self.problem.dominoes * self._chunk)) * self._chunk

    def add_seconds(self, seconds: float) -> None:
        """Count time spent before the search [s], for example on a training."""
        require("seconds", seconds, 0.0, unit="s")
        self._seconds_before += seconds

    # best so far --------------------------------------------------------------------------------

    @property
    def best_score(self) -> float:
        """Best score so far; -inf before the first."""
        return self.finalists[-1][0] if self.finalists else -np.inf

    @property
    def best(self) -> Floats:
        """Copy of the best design vector (n,) so far.

        Raises
        ------
        ValueError
            If nothing has been evaluated yet.
        """
        if not self.finalists:
            raise ValueError("nothing has been scored yet: call `evaluate` first")
        return self.finalists[-1][1].copy()

    def record(self, scores: Scores, design: Callable[[int], Floats]) -> None:
        """Count layouts that were simulated elsewhere, and keep the best of them.

        Parameters
        ----------
        scores
            Scores of the layouts, at the tolerance of the problem.
        design
            Function that returns the design vector of layout i; called only for a new best.
        """
        self._count(scores)
        self._update_best(scores, design)

    # evaluation ---------------------------------------------------------------------------------

    def evaluate(self, designs: Floats, gradient: bool = False) -> Scores:
        """Simulate design vectors and score them.

        Parameters
        ----------
        designs, gradient
            See `Problem.evaluate`.

        Returns
        -------
        Scores
            Scores, reaches and falls, and gradients if requested.

        Raises
        ------
        BudgetSpent
            If a limit is reached first; the layouts simulated before it count.
        ExecutorLost
            If the executor has ended.
        ValueError
            If no design vectors are given, and for the reasons of `Problem.evaluate`.
        """
        single, designs = np.ndim(designs) < 2, self.problem.check(designs)
        if not len(designs):
            raise ValueError("no designs are given: evaluate one or more")
        results: list[Scores] = []
        # the same chunks with and without an executor: no result may depend on it
        size = max(1, self._chunk // GRADIENT_COST) if gradient else self._chunk
        batch = size if gradient or self._executor is None else self.batch_size
        start = 0
        with self._lock:
            while start < len(designs):
                self.require_more()
                end = start + int(min(batch, len(designs) - start, self.remaining))
                chunks = [designs[i : min(i + size, end)] for i in range(start, end, size)]
                outputs = self._evaluate(chunks, gradient)
                try:
                    for chunk, scores in zip(chunks, outputs, strict=True):
                        self._count(scores)
                        self._update_best(scores, chunk.__getitem__)
                        results.append(scores)
                except StoppedError:  # no time was left during a free-standing simulation
                    raise BudgetSpent(self.stop_reason) from None
                start = end
        scores = Scores(*map(np.concatenate, zip(*map(_pack, results), strict=True)))
        return scores.squeeze() if single else scores

    def evaluate_by(
        self, kind: str, design: Floats, compute: Callable[[Floats], tuple[Scores, list[Floats]]]
    ) -> tuple[Scores, list[Floats]]:
        """Score a design vector by a function that computes more than its score.

        Parameters
        ----------
        kind
            Name of the function in the journal.
        design
            (n,) the design vector.
        compute
            Function of the design vector that returns its scores, (1,) each and without a gradient,
            and more arrays.

        Returns
        -------
        scores : Scores
            The scores.
        arrays : list of ndarray
            The other arrays.

        Raises
        ------
        BudgetSpent
            If a limit is reached.
        """
        self.require_more()
        design = self.problem.check(design)[0]
        answer = self._replay(kind, design[None])
        if answer is None:
            scores, arrays = compute(design)
            answer = [*_pack(scores), *arrays]
            self._store(kind, design[None], answer)
        scores, arrays = Scores(*answer[:3]), answer[3:]
        self._count(scores)
        self._update_best(scores, lambda _: design)
        return scores, arrays

    @contextmanager
    def borrow(self, problem: Problem, evaluations: int) -> Iterator[Evaluator]:
        """Open a context with a second evaluator, of shorter layouts.

        The first evaluator counts each of them in proportion to its dominoes. A limit of the second
        ends the context without an exception. The second has no journal: a resumed search evaluates
        these layouts again.

        Parameters
        ----------
        problem
            Problem of the shorter layouts.
        evaluations
            Largest number of shorter layouts; at most half of the remaining evaluations is used.

        Yields
        ------
        Evaluator
            Evaluator of the shorter layouts.

        Raises
        ------
        BudgetSpent
            At the end, if the first evaluator has reached a limit.
        ValueError
            If `evaluations` is less than 1.
        TypeError
            If `problem` is no `Problem`.
        """
        require_type("problem", problem, Problem, "the Problem of shorter layouts")
        require("evaluations", evaluations, 1, whole=True)
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

    def _evaluate(self, chunks: Sequence[Floats], gradient: bool) -> Iterator[Scores]:
        """Yield the scores of one chunk after the other, from the journal if it has them."""
        kind = "gradient" if gradient else f"scores {self.problem.rtol}"
        chunks = list(chunks)
        results: Iterator[Scores]
        while chunks and (arrays := self._replay(kind, chunks[0])) is not None:
            chunks.pop(0)
            yield Scores(*arrays)
        evaluate = partial(self.problem.evaluate, gradient=gradient)
        with loss_as_error():
            if self._executor is None or len(chunks) < 2:
                results = (evaluate(chunk, stop=self._stop) for chunk in chunks)
            else:
                with loss_as_error(RuntimeError):  # after `shutdown`
                    results = self._executor.map(evaluate, chunks)
            for chunk, scores in zip(chunks, results, strict=True):
                self._store(kind, chunk, _pack(scores))
                yield scores

    def _replay(self, kind: str, designs: Floats) -> list[Floats] | None:
        """Return the answer in the journal and continue from its time; None if there is none."""
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
        """Count simulated layouts, their effort and their intervals between hits."""
        self.evaluations += len(scores.score)
        self.effort += len(scores.score) * (1 if scores.gradient is None else GRADIENT_COST)
        self.falls += int(scores.falls.sum())

    def _update_best(self, scores: Scores, design: Callable[[int], Floats]) -> None:
        """Keep the best of the layouts if it improves on the best so far; call the callback."""
        i = int(np.argmax(scores.score))
        score = float(scores.score[i])
        if score > self.best_score:
            best = np.array(design(i))
            self._efforts.append(self.effort)
            self.trace.append((self.evaluations, self.falls, self.seconds, score))
            self.finalists.append((score, best))
        self._callback(self)


def require_options(tolerance: object, callback: object, executor: object, clock: object) -> None:
    """Raise an error unless these are options of `Evaluator`, and the clock returns a number."""
    require("tolerance", tolerance, above=0.0, below=1.0, hint="a relative gain", optional=True)
    require_executor(executor)
    require_type("callback", callback, Callable, "a function of the Evaluator")
    require_type("clock", clock, Callable, "a function that returns seconds")
    require("clock()", cast("Callable[[], float]", clock)(), unit="s")


def _pack(scores: Scores) -> list[Floats]:
    """Return the arrays of scores that a journal stores."""
    arrays = [scores.score, scores.reach, scores.falls]
    return arrays if scores.gradient is None else [*arrays, scores.gradient]
