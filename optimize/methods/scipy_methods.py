"""Methods of SciPy: local solvers restarted from one point after the other, and global ones."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from scipy import optimize

from domino_env.core.types import Floats
from optimize.evaluator import Evaluator
from optimize.methods.starts import FewVariables, starts, uniform_design
from optimize.problem import Problem

SIMPLEX = 0.1  # size of the first simplex, as a part of the box
MANY = 200  # variables from which on trust-constr uses the cheaper SR1
DIRECT_VARIABLES, DIRECT_EVALUATIONS = 24, 100  # at most; for each variable and box
MEMBERS_PER_VARIABLE, MOST_MEMBERS = 3, 256


def cost(evaluator: Evaluator, design: Floats) -> tuple[float, Floats]:
    """Compute minus the score, and its gradient (n,)."""
    found = evaluator.evaluate(design, gradient=True)
    return -found.score, -found.gradient


def _no_constraints(problem: Problem) -> list[optimize.LinearConstraint]:
    return []


def _linear_rules(problem: Problem) -> list[optimize.LinearConstraint]:
    """The given length and the largest change as linear constraints."""
    rules = []
    if problem.equality is not None:
        row, total = problem.equality
        size = np.abs(row).max()
        rules.append(optimize.LinearConstraint(row[None] / size, total / size, total / size))
    if problem.linear is not None:
        rows, most = problem.linear
        size = np.abs(rows).max()
        rules.append(optimize.LinearConstraint(rows / size, -np.inf, most / size))
    return rules


def _simplex(x: Floats) -> dict[str, Any]:
    inwards = np.where(x < 0.5, SIMPLEX, -SIMPLEX)
    corners = np.concatenate([x[None], x + np.diag(inwards)])
    return {"initial_simplex": corners, "adaptive": len(x) > 1}


@dataclass(frozen=True)
class LocalSolver:
    """A solver of `scipy.optimize.minimize`, called as a method.

    Parameters
    ----------
    name
        Its name in SciPy.
    options
        Its options.
    most
        Largest number of variables, with more of which the search is one over schedules; None for a
        solver that follows the gradient, in all variables.
    options_at
        Returns further options for a start.
    constraints
        Returns the constraints of a problem.
    """

    name: str
    options: dict[str, Any]
    most: int | None = None
    options_at: Callable[[Floats], dict[str, Any]] = field(default=lambda x: {})
    constraints: Callable[[Problem], list[optimize.LinearConstraint]] = _no_constraints

    def __call__(self, evaluator: Evaluator, rng: np.random.Generator) -> None:
        """Search from one start after the other until a limit is reached."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="scipy")  # of slopes that did not change
            for start in starts(evaluator, rng):
                self.descend(evaluator, start)

    def descend(self, evaluator: Evaluator, start: Floats) -> None:
        """Search from one design vector (n,) until the solver ends."""
        x = start
        function: Any = partial(cost, evaluator)
        words: dict[str, Any] = {"jac": True}
        if self.most is not None:
            few = FewVariables(evaluator, self.most)
            function, x, words = few.cost, few.nearest(start), {}
        bounds: Any = [(0.0, 1.0)] * len(x)
        if self.name == "trust-constr":
            x = np.clip(x, 1e-3, 1.0 - 1e-3)  # strictly inside, as the method begins
            bounds = optimize.Bounds(0.0, 1.0, keep_feasible=True)
            words["hess"] = optimize.BFGS() if len(x) <= MANY else optimize.SR1()
        constraints = self.constraints(evaluator.problem)
        if constraints:
            words["constraints"] = constraints
        optimize.minimize(
            function, x, method=self.name, bounds=bounds,
            options=self.options | self.options_at(x), **words,
        )  # fmt: skip


l_bfgs = LocalSolver("L-BFGS-B", {"maxiter": 1000, "ftol": 1e-10, "gtol": 1e-7})
"""L-BFGS-B on exact gradients.

Byrd, R. H., Lu, P., Nocedal, J., Zhu, C. (1995). A limited memory algorithm for bound constrained
optimization. SIAM Journal on Scientific Computing 16, 1190-1208.
"""

slsqp = LocalSolver("SLSQP", {"maxiter": 1000, "ftol": 1e-10}, constraints=_linear_rules)
"""SLSQP on exact gradients: a quadratic program for each step.

A given length and a largest change are constraints of the program. Each step costs the cube of the
number of variables.

Kraft, D. (1988). A software package for sequential quadratic programming. DFVLR-FB 88-28, Cologne.
"""

trust_constr = LocalSolver(
    "trust-constr",
    {
        "maxiter": 1000, "gtol": 1e-6, "xtol": 1e-6, "initial_tr_radius": 0.3,
        "initial_barrier_parameter": 1e-4, "initial_barrier_tolerance": 1e-4,
    },
)  # fmt: skip
"""An interior point method in trust regions, on exact gradients.

Byrd, R. H., Hribar, M. E., Nocedal, J. (1999). An interior point algorithm for large-scale
nonlinear programming. SIAM Journal on Optimization 9, 877-900.
"""

cobyqa = LocalSolver(
    "COBYQA",
    {"initial_tr_radius": 0.1, "final_tr_radius": 1e-5, "maxiter": 10**6},
    most=45,
    options_at=lambda x: {"maxfev": 500 * (len(x) + 1)},
)
"""COBYQA: quadratic models through known scores, in a trust region, without gradients.

A step costs the cube of the number of variables: long layouts are searched as schedules.

Ragonneau, T. M. (2022). Model-based derivative-free optimization methods and software. PhD thesis,
The Hong Kong Polytechnic University.
"""

powell = LocalSolver(
    "Powell", {"maxiter": 10**9, "maxfev": 10**9, "xtol": 1e-4, "ftol": 1e-7}, most=200
)
"""Powell's conjugate directions: one line search after the other, without gradients.

Powell, M. J. D. (1964). An efficient method for finding the minimum of a function of several
variables without calculating derivatives. The Computer Journal 7, 155-162.
"""

nelder_mead = LocalSolver(
    "Nelder-Mead",
    {"maxiter": 10**9, "maxfev": 10**9, "xatol": 1e-6, "fatol": 1e-8},
    most=40,
    options_at=_simplex,
)
"""Nelder–Mead with the step sizes of Gao and Han for several variables.

A simplex of more than some forty corners does not converge: long layouts are searched as schedules.

Nelder, J. A., Mead, R. (1965). A simplex method for function minimization. The Computer Journal 7,
308-313.

Gao, F., Han, L. (2012). Implementing the Nelder-Mead simplex algorithm with adaptive parameters.
Computational Optimization and Applications 51, 259-277.
"""


def direct(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """DIRECT, locally biased: the box in ever finer thirds.

    When a box is divided finely enough, a smaller one around the best so far is next. Long layouts
    are searched as schedules.

    References
    ----------
    Jones, D. R., Perttunen, C. D., Stuckman, B. E. (1993). Lipschitzian optimization without the
    Lipschitz constant. Journal of Optimization Theory and Applications 79, 157-181.

    Gablonsky, J. M., Kelley, C. T. (2001). A locally-biased form of the DIRECT algorithm. Journal
    of Global Optimization 21, 27-37.
    """
    few = FewVariables(evaluator, DIRECT_VARIABLES)
    evaluator.evaluate(uniform_design(evaluator.problem))
    radius = 1.0
    while True:
        centre = few.nearest(evaluator.best)
        if radius < 1e-6:
            radius = 1.0
        # the middle of each box is evaluated first: shifted at random, no two are the same
        centre = np.clip(centre + 0.1 * radius * rng.uniform(-1, 1, len(centre)), 0.0, 1.0)
        low, high = np.maximum(centre - radius, 0.0), np.minimum(centre + radius, 1.0)
        optimize.direct(
            few.cost, optimize.Bounds(low, high), maxfun=DIRECT_EVALUATIONS * few.dimension,
            maxiter=10**6, locally_biased=True, vol_tol=0.0, len_tol=1e-6,
        )  # fmt: skip
        radius *= 0.5


def dual_annealing(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Dual annealing: random leaps that cool, and local searches after good ones.

    References
    ----------
    Xiang, Y., Sun, D. Y., Fan, W., Gong, X. G. (1997). Generalized simulated annealing algorithm
    and its application to the Thomson model. Physics Letters A 233, 216-220.
    """
    problem = evaluator.problem
    bounds = [(0.0, 1.0)] * problem.dimension
    start = uniform_design(problem)
    local = {
        "method": "L-BFGS-B", "bounds": bounds, "jac": lambda design: cost(evaluator, design)[1]
    }  # fmt: skip
    while True:
        optimize.dual_annealing(
            lambda design: -evaluator.evaluate(design).score,
            bounds, x0=start, maxiter=1000, maxfun=10**9, rng=rng, minimizer_kwargs=local,
        )  # fmt: skip
        start = problem.project(rng.random(problem.dimension)[None])[0]


def differential_evolution(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Differential evolution: populations that move along their own differences.

    Each has the uniform baseline in it.

    References
    ----------
    Storn, R., Price, K. (1997). Differential evolution: a simple and efficient heuristic for global
    optimization over continuous spaces. Journal of Global Optimization 11, 341-359.
    """
    problem = evaluator.problem
    n = problem.dimension
    mark = uniform_design(problem)
    members = min(max(16, MEMBERS_PER_VARIABLE * n), MOST_MEMBERS)
    while True:
        # around the baseline near and far: most layouts from all over the box would be poor
        spread = 10.0 ** rng.uniform(-2.0, 0.0, (members, 1))
        first = problem.project(np.clip(mark + spread * rng.uniform(-1, 1, (members, n)), 0, 1))
        first[0] = mark
        optimize.differential_evolution(
            lambda columns: -evaluator.evaluate(columns.T).score,
            [(0.0, 1.0)] * n, init=first, strategy="currenttobest1bin", mutation=(0.4, 0.9),
            recombination=0.9, maxiter=10**9, tol=1e-6, polish=False, updating="deferred",
            vectorized=True, rng=rng,
        )  # fmt: skip
