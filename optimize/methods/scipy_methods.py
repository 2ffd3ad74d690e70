"""Methods of SciPy: local solvers restarted from one point after the other, and global ones.

- `l-bfgs`: L-BFGS-B on exact gradients (Byrd, Lu, Nocedal, Zhu 1995).
- `slsqp`: a quadratic programme for each step, on exact gradients (Kraft 1988). A given length is
  its constraint. The time of a step grows with the cube of the number of variables.
- `trust-constr`: an interior point method in trust regions, on exact gradients (Byrd, Hribar,
  Nocedal 1999).
- `cobyqa`: quadratic models through known scores, without gradients (Ragonneau 2022).
- `powell`: conjugate directions, one line search after the other, without gradients (Powell 1964).
- `nelder-mead`: a simplex with the step sizes of Gao and Han (2012) for several variables.
- `direct`: a box divided into ever finer thirds, locally biased (Jones et al. 1993, Gablonsky and
  Kelley 2001). When a box is divided finely enough, a smaller one around the best so far follows.
- `dual-annealing`: generalised simulated annealing, with local searches (Xiang et al. 1997).
- `differential-evolution`: populations that change by differences of their members (Storn and
  Price 1997), each with the uniform baseline in it.

Most methods without gradients are for few variables: with them, long layouts are interpolated
between knots.

References
----------
Byrd, R. H., Hribar, M. E., Nocedal, J. (1999). An interior point algorithm for large-scale
nonlinear programming. SIAM Journal on Optimization 9, 877-900.

Byrd, R. H., Lu, P., Nocedal, J., Zhu, C. (1995). A limited memory algorithm for bound constrained
optimization. SIAM Journal on Scientific Computing 16, 1190-1208.

Gablonsky, J. M., Kelley, C. T. (2001). A locally-biased form of the DIRECT algorithm. Journal of
Global Optimization 21, 27-37.

Gao, F., Han, L. (2012). Implementing the Nelder-Mead simplex algorithm with adaptive parameters.
Computational Optimization and Applications 51, 259-277.

Jones, D. R., Perttunen, C. D., Stuckman, B. E. (1993). Lipschitzian optimization without the
Lipschitz constant. Journal of Optimization Theory and Applications 79, 157-181.

Kraft, D. (1988). A software package for sequential quadratic programming. DFVLR-FB 88-28, Cologne.

Powell, M. J. D. (1964). An efficient method for finding the minimum of a function of several
variables without calculating derivatives. The Computer Journal 7, 155-162.

Ragonneau, T. M. (2022). Model-based derivative-free optimization methods and software. PhD thesis,
The Hong Kong Polytechnic University.

Storn, R., Price, K. (1997). Differential evolution: a simple and efficient heuristic for global
optimization over continuous spaces. Journal of Global Optimization 11, 341-359.

Xiang, Y., Sun, D. Y., Fan, W., Gong, X. G. (1997). Generalized simulated annealing algorithm and
its application to the Thomson model. Physics Letters A 233, 216-220.
"""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np
from scipy import optimize

from domino_env.core.types import Floats
from optimize.evaluator import Evaluator
from optimize.methods.starts import ReducedProblem, starts, uniform_design
from optimize.problem import Problem

# Lengths and radii are relative to the box.
SIMPLEX = 0.1  # size of the first simplex
MAX_BFGS = 200  # variables above which trust-constr uses the cheaper SR1
LEAST_MARGIN = 1e-3  # least distance of a start of trust-constr to the faces of the box
COBYQA_EVALUATIONS = 500  # evaluations of one run, over the number of variables plus 1
DIRECT_EVALUATIONS = 100  # evaluations of one box, over the number of variables
DIRECT_ITERATIONS = 10**6  # more than one box takes; SciPy allocates memory for each
# least radius of a box of DIRECT, and least half side of its parts relative to the box; random
# shift of the box over its radius
SMALLEST_BOX, SHIFT = 1e-6, 0.1
# members of a population
MEMBERS_PER_VARIABLE, LEAST_MEMBERS, MOST_MEMBERS = 3, 16, 256
# decimal exponent of the least spread of first members around the uniform baseline
NEAREST_EXPONENT = -2.0
UNLIMITED = 10**9  # iterations and evaluations of a method that only the evaluator ends
# largest number of variables of methods without gradients
MOST_VARIABLES = {"COBYQA": 45, "Powell": 200, "Nelder-Mead": 40, "DIRECT": 24}
# options of each solver
OPTIONS: dict[str, dict[str, Any]] = {
    "L-BFGS-B": {"maxiter": 1000, "ftol": 1e-10, "gtol": 1e-7},
    "SLSQP": {"maxiter": 1000, "ftol": 1e-10},
    "trust-constr": {
        "maxiter": 1000, "gtol": 1e-6, "xtol": 1e-6, "initial_tr_radius": 0.3,
        "initial_barrier_parameter": 1e-4, "initial_barrier_tolerance": 1e-4,
    },
    "COBYQA": {"initial_tr_radius": 0.1, "final_tr_radius": 1e-5, "maxiter": UNLIMITED},
    "Powell": {"maxiter": UNLIMITED, "maxfev": UNLIMITED, "xtol": 1e-4, "ftol": 1e-7},
    "Nelder-Mead": {"maxiter": UNLIMITED, "maxfev": UNLIMITED, "xatol": 1e-6, "fatol": 1e-8},
}  # fmt: skip


def cost(evaluator: Evaluator, design: Floats) -> tuple[float, Floats]:
    """Compute the negative of the score of a design vector (n,), and its gradient (n,)."""
    scores = evaluator.evaluate(design, gradient=True)
    return -scores.score, -scores.gradient


def descend(solver: str, evaluator: Evaluator, start: Floats) -> None:
    """Search from one design vector (n,) until a solver of SciPy ends.

    Parameters
    ----------
    solver
        Name of the solver in SciPy, a key of `OPTIONS`.
    evaluator
        Evaluator of the problem.
    start
        (n,) a design vector.
    """
    x, options = start, OPTIONS[solver]
    arguments: dict[str, Any] = {"jac": True, "bounds": [(0.0, 1.0)] * len(x)}
    function: Any = partial(cost, evaluator)
    if solver in MOST_VARIABLES:
        reduced = ReducedProblem(evaluator, MOST_VARIABLES[solver])
        function, x = reduced.cost, reduced.nearest(start)
        arguments = {"bounds": [(0.0, 1.0)] * len(x)}
    if solver == "trust-constr":
        x = np.clip(x, LEAST_MARGIN, 1.0 - LEAST_MARGIN)  # the method needs an interior start
        arguments["bounds"] = optimize.Bounds(0.0, 1.0, keep_feasible=True)
        arguments["hess"] = optimize.BFGS() if len(x) <= MAX_BFGS else optimize.SR1()
    elif solver == "SLSQP":
        arguments["constraints"] = _length_rule(evaluator.problem)
    elif solver == "COBYQA":
        options = options | {"maxfev": COBYQA_EVALUATIONS * (len(x) + 1)}
    elif solver == "Nelder-Mead":
        # adaptive factors suit many variables; with one, the simplex would shrink to a point
        corners = np.concatenate([x[None], x + np.diag(np.where(x < 0.5, SIMPLEX, -SIMPLEX))])
        options = options | {"initial_simplex": corners, "adaptive": len(x) > 1}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="scipy")  # about gradients that do not change
        optimize.minimize(function, x, method=solver, options=options, **arguments)


def _restart(solver: str, evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Search from one start after the other until a limit is reached."""
    for start in starts(evaluator, rng):
        descend(solver, evaluator, start)


def _length_rule(problem: Problem) -> list[optimize.LinearConstraint]:
    """Return the given length as a linear constraint; none without a given length."""
    if problem.equality is None:
        return []
    coefficients, total = problem.equality
    size = np.abs(coefficients).max()
    return [optimize.LinearConstraint(coefficients / size, total / size, total / size)]


l_bfgs = partial(_restart, "L-BFGS-B")
slsqp = partial(_restart, "SLSQP")
trust_constr = partial(_restart, "trust-constr")
cobyqa = partial(_restart, "COBYQA")
powell = partial(_restart, "Powell")
nelder_mead = partial(_restart, "Nelder-Mead")


def direct(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Run DIRECT on one box after the other."""
    reduced = ReducedProblem(evaluator, MOST_VARIABLES["DIRECT"])
    evaluator.evaluate(uniform_design(evaluator.problem))
    radius = 1.0
    while True:
        centre = reduced.nearest(evaluator.best)
        # The middle of a box is evaluated first. Random shifts make the middles different.
        centre = np.clip(centre + SHIFT * radius * rng.uniform(-1, 1, len(centre)), 0.0, 1.0)
        low, high = np.maximum(centre - radius, 0.0), np.minimum(centre + radius, 1.0)
        optimize.direct(
            reduced.cost, optimize.Bounds(low, high), maxfun=DIRECT_EVALUATIONS * reduced.dimension,
            maxiter=DIRECT_ITERATIONS, locally_biased=True, vol_tol=0.0, len_tol=SMALLEST_BOX,
        )  # fmt: skip
        radius = 0.5 * radius if 0.5 * radius >= SMALLEST_BOX else 1.0


def dual_annealing(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Run dual annealing from the uniform baseline, then from one random start after the other."""
    problem = evaluator.problem
    bounds = [(0.0, 1.0)] * problem.dimension
    start = uniform_design(problem)
    local = {
        "method": "L-BFGS-B", "bounds": bounds, "jac": lambda design: cost(evaluator, design)[1]
    }  # fmt: skip
    while True:
        optimize.dual_annealing(
            lambda design: -evaluator.evaluate(design).score,
            bounds, x0=start, maxfun=UNLIMITED, rng=rng, minimizer_kwargs=local,
        )  # fmt: skip
        start = problem.project(rng.random(problem.dimension)[None])[0]


def differential_evolution(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Run one differential evolution after the other."""
    problem = evaluator.problem
    n = problem.dimension
    uniform = uniform_design(problem)
    members = min(max(LEAST_MEMBERS, MEMBERS_PER_VARIABLE * n), MOST_MEMBERS)
    while True:
        # spread around the baseline, near and far: most layouts from the whole box would be poor
        spread = 10.0 ** rng.uniform(NEAREST_EXPONENT, 0.0, (members, 1))
        first = problem.project(np.clip(uniform + spread * rng.uniform(-1, 1, (members, n)), 0, 1))
        first[0] = uniform
        # smaller mutations and more recombination than SciPy's defaults; a converged run ends
        optimize.differential_evolution(
            lambda columns: -evaluator.evaluate(columns.T).score,
            [(0.0, 1.0)] * n, init=first, strategy="currenttobest1bin", mutation=(0.4, 0.9),
            recombination=0.9, maxiter=UNLIMITED, tol=1e-6, polish=False, updating="deferred",
            vectorized=True, rng=rng,
        )  # fmt: skip
