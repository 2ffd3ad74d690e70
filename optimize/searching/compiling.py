"""What a search compiles before its clock starts."""

from __future__ import annotations

from optimize.problem import Problem


def compile_scores(problem: Problem) -> None:
    """Compile, or load from the cache, a problem's scores of a batch and their gradients.

    The best uniform row is scored once, and once with its gradient: so the machine code is what
    this problem's scene needs, whatever its objective and its limits. The uniform row itself is
    found here where it is not known yet.
    """
    mark = problem.design(problem.scene.uniform().layout)[None]
    problem.scores(mark)
    problem.scores_and_gradients(mark, of_dying=False)
