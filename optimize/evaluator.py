"""Budget: what a search may spend, what it has spent, and the best it has found."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from domino_env.scenes.objectives import Evaluation
from optimize.problem import STEP_RTOL, Problem
from optimize.recorder import Recorder
from optimize.variables import Floats

PIECE = 40_000  # dominoes simulated between two looks at the clock, some 30 ms
MOST_ROWS = 256  # between two looks, so that enough of the good ones become finalists
BULK = 2_000_000  # dominoes that fill an executor, some 3 s of one core
GRADIENT_COST = 4  # waves that a gradient takes as long as
GAIN = 1e-5  # a smaller relative gain is none
PATIENT = 20_000  # least evaluations of a search without any limit
KEPT = 8  # best designs kept for a closer look at the end

Step = tuple[int, int, float, float]


def slope_left(design: Floats, gradient: Floats) -> float:
    """Find the largest slope along which a design can still rise within the box.

    Parameters
    ----------
    design, gradient
        (n,) a design and the gradient of its score.

    Returns
    -------
    float
        In score over the whole range of a variable.
    """
    held = ((design <= 0.0) & (gradient < 0.0)) | ((design >= 1.0) & (gradient > 0.0))
    return float(np.abs(np.where(held, 0.0, gradient)).max())


class BudgetSpent(Exception):  # noqa: N818  no error: the ordinary end of a search
    """Raised into a method when its budget is used up."""


class Budget:
    """A meter: methods ask it for scores until it raises `BudgetSpent`.

    The clock starts with the object.

    Parameters
    ----------
    recorder
        Who is asked, and remembers.
    evaluations
        Layouts that may be simulated; None for no limit.
    seconds
        Time that may be spent; None for no limit.
    watch
        Called with the budget after every batch.

    Attributes
    ----------
    problem
        What is searched.
    spent
        Layouts simulated so far.
    falls
        Single falls simulated so far; an evaluation of a "robust" scene topples hundreds of rows.
    trace
        (evaluations, falls, seconds, best score) at every improvement.
    slopes
        The steepest slope left at each of them, see `slope_left`; None where it is not known.
    finalists
        The last improvements, (score, design) each, the best last.
    standing
        What the method says of its best so far: how much it is to be trusted, what it has tried.
    gained
        Evaluations at the last gain worth the name.
    """

    def __init__(
        self,
        recorder: Recorder,
        evaluations: int | None = None,
        seconds: float | None = None,
        watch: Callable[[Budget], None] | None = None,
    ) -> None:
        self.problem = recorder.problem
        self.evaluations = evaluations
        self.seconds = seconds
        self.spent = 0
        self.falls = 0
        self.trace: list[Step] = []
        self.slopes: list[float | None] = []
        self.finalists: deque[tuple[float, Floats]] = deque(maxlen=KEPT)
        self.standing = ""
        self.gained = 0
        self._reached = np.nan  # before the first
        self._unlimited = evaluations is None and seconds is None
        self._recorder = recorder
        self._watch = watch
        self._piece = min(max(8, PIECE // self.problem.dominoes), MOST_ROWS)
        self._before = 0.0  # seconds that went into what the search builds on
        recorder.start()

    @property
    def elapsed(self) -> float:
        """Seconds since the search began, those before it was stopped and resumed among them."""
        return self._before + self._recorder.seconds

    @property
    def replaying(self) -> bool:
        """Whether the search still comes to what it had found before it was stopped."""
        return self._recorder.replaying

    @property
    def bulk(self) -> int:
        """Designs that fill an executor: so many may be asked for at once where any number may.

        A multiple of what is scored between two looks at the clock.
        """
        return max(1, BULK // (self.problem.dominoes * self._piece)) * self._piece

    @property
    def part(self) -> float:
        """Part that is spent, 0 to 1, of what runs out first; without limits, see `over`."""
        parts = [0.0]
        if self._unlimited:
            parts.append(self.spent / max(PATIENT, 2 * self.gained))
        if self.evaluations is not None:
            parts.append(self.spent / self.evaluations)
        if self.seconds is not None:
            parts.append(self.elapsed / self.seconds)
        return min(max(parts), 1.0)

    @property
    def over(self) -> str:
        """Why nothing more may be spent; empty while something may.

        Without any limit it is over where half of many evaluations have gained nothing.
        """
        if not self.finalists:  # even a budget of no time gets a first look
            return ""
        if self.evaluations is not None and self.spent >= self.evaluations:
            return f"limit of {self.evaluations} rows reached"
        if self.seconds is not None and self.elapsed >= self.seconds:
            return f"limit of {self.seconds:g} s reached"
        if self._unlimited and self.spent >= max(PATIENT, 2 * self.gained):
            return f"nothing gained in the last {self.spent - self.gained} rows"
        return ""

    def require_more(self) -> None:
        """Raise `BudgetSpent`, which says why, where nothing more may be spent."""
        if self.over:
            raise BudgetSpent(self.over)

    @property
    def left(self) -> float:
        """Evaluations that may still be spent; inf where only the clock ends the search."""
        if self.evaluations is None:
            return np.inf
        return float(self.evaluations - self.spent)

    @property
    def best_score(self) -> float:
        """Best score so far; -inf before the first."""
        return self.finalists[-1][0] if self.finalists else -np.inf

    @property
    def best(self) -> Floats:
        """Best design (n,) so far.

        Raises
        ------
        ValueError
            Before the first evaluation.
        """
        if not self.finalists:
            raise ValueError("nothing has been scored yet")
        return self.finalists[-1][1]

    def scores(self, designs: Floats, rtol: float | None = None) -> Floats:
        """Score designs.

        Parameters
        ----------
        designs
            (B, n) designs.
        rtol
            How closely to simulate; as the problem does where None.

        Returns
        -------
        ndarray
            (B,) scores.

        Raises
        ------
        BudgetSpent
            Where not all can be paid for. What can be is simulated first, so that nothing of the
            budget is lost.
        """
        designs = np.asarray(designs, dtype=np.float64)
        scores = np.empty(len(designs))
        at = 0
        while at < len(designs):
            self.require_more()
            most = self.bulk if self._recorder.elsewhere else self._piece
            size = min(most, len(designs) - at)
            if self.evaluations is not None:
                size = min(size, self.evaluations - self.spent)
            # the same pieces with and without an executor: what is noted must not depend on it
            pieces = [
                designs[i : min(i + self._piece, at + size)]
                for i in range(at, at + size, self._piece)
            ]
            parts = self._recorder.evaluations(pieces, rtol)
            for piece, part in zip(pieces, parts, strict=True):
                scores[at : at + len(piece)] = part.score
                self._count(part)
                self._note(piece, part.score)
                at += len(piece)
        return scores

    def score(self, design: Floats) -> float:
        """Score one design (n,)."""
        return float(self.scores(np.asarray(design)[None])[0])

    def score_and_gradient(self, design: Floats) -> tuple[float, Floats]:
        """Score one design (n,), with its gradient (n,): see `Problem.score_and_gradient`."""
        scores, gradients = self.scores_and_gradients(np.asarray(design)[None])
        return float(scores[0]), gradients[0]

    def scores_and_gradients(
        self, designs: Floats, *, of_dying: bool = True, at_will: bool = False
    ) -> tuple[Floats, Floats]:
        """Score designs, with the gradient of each: see `Problem.scores_and_gradients`.

        Parameters
        ----------
        designs
            (B, n) designs.
        of_dying
            Whether a wave that dies gets a gradient too, which takes 2n more evaluations; otherwise
            it is zero.
        at_will
            As of `Problem.scores_and_gradients`.

        Returns
        -------
        scores : ndarray
            (B,) scores.
        gradients : ndarray
            (B, n) gradients by the designs.

        Raises
        ------
        BudgetSpent
            Where not all can be paid for; what can be is simulated first.
        """
        designs = np.asarray(designs, dtype=np.float64)
        scores, gradients = np.empty(len(designs)), np.empty(designs.shape)
        piece = max(1, self._piece // GRADIENT_COST)
        at = 0
        while at < len(designs):
            self.require_more()
            size = min(piece, len(designs) - at)
            if self.evaluations is not None:
                size = min(size, self.evaluations - self.spent)
            part = slice(at, at + size)
            found, slopes = self._recorder.evaluations_and_gradients(designs[part], at_will=at_will)
            self._count(found)
            for b in np.flatnonzero(found.without_gradient) if of_dying else ():
                around = self.scores(self.problem.neighbours(designs[at + b]), STEP_RTOL)
                slopes[b] = self.problem.difference(designs[at + b], around)
            scores[part], gradients[part] = found.score, slopes
            self._note(designs[part], found.score, slopes)
            at += size
        return scores, gradients

    def lateness(self, design: Floats) -> tuple[float, Floats, Floats]:
        """Find how late each domino of one design is hit: see `Problem.lateness`.

        Raises
        ------
        BudgetSpent
            Where it cannot be paid for.
        """
        self.require_more()
        design = np.asarray(design, dtype=np.float64)
        found, late, slopes = self._recorder.lateness(design)
        self._count(found)
        self._note(design[None], found.score)
        return float(found.score[0]), late, slopes

    def note(self, found: Evaluation, design: Callable[[int], Floats]) -> None:
        """Count rows that were simulated elsewhere, as closely as the problem's, and remember them.

        Parameters
        ----------
        found
            What the scene gives for them.
        design
            Gives the design of row i, asked for only where it is the best so far.

        Raises
        ------
        ValueError
            Where there are more than the budget has left: whoever simulates has to ask.
        """
        scores = found.score
        if len(scores) > self.left:
            raise ValueError(f"{len(scores)} rows are noted, where {self.left:g} are left to spend")
        self._count(found)
        i = int(np.argmax(scores))
        if scores[i] > self.best_score:
            self._note(np.asarray(design(i))[None], scores[i : i + 1])
        else:
            self._look()

    @contextmanager
    def lend(self, problem: Problem, evaluations: int) -> Iterator[Budget]:
        """Give a budget for smaller rows of the same kind, which count by their dominoes.

        What is asked of it no journal keeps: a search that goes on asks again.

        Parameters
        ----------
        problem
            Of the smaller rows.
        evaluations
            Most of them; half of what this budget can pay for at most.

        Raises
        ------
        BudgetSpent
            At the end, where it has used this one up; its own end is none.
        """
        share = problem.dominoes / self.problem.dominoes
        if self.evaluations is not None:
            evaluations = max(1, min(evaluations, int(0.5 * self.left / share)))
        seconds = None if self.seconds is None else max(self.seconds - self.elapsed, 1e-9)
        recorder = self._recorder.beside(problem)
        own = Budget(recorder, evaluations, seconds, lambda _: self._look())
        try:
            yield own
        except BudgetSpent:
            pass
        finally:
            self.spent += math.ceil(own.spent * share)
            self.falls += own.falls
        self.require_more()

    def already_spent(self, seconds: float) -> None:
        """Count time that went into what the search builds on, before it began [s]."""
        self._before += seconds

    def _count(self, found: Evaluation) -> None:
        self.spent += len(found.score)
        self.falls += int(found.falls.sum())

    def _note(self, designs: Floats, scores: Floats, gradients: Floats | None = None) -> None:
        i = int(np.argmax(scores))
        if scores[i] > self.best_score:
            self.trace.append((self.spent, self.falls, self.elapsed, float(scores[i])))
            self.slopes.append(None if gradients is None else slope_left(designs[i], gradients[i]))
            self.finalists.append((float(scores[i]), designs[i].copy()))
            if not scores[i] <= self._reached + GAIN * abs(self._reached):
                self._reached, self.gained = float(scores[i]), self.spent
        self._look()

    def _look(self) -> None:
        if self._watch is not None:
            self._watch(self)
