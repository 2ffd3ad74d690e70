"""What an unsteady hand costs, and how much of it can be had back by looking while building.

    python -m agents.lab.unsteady

Every gap is off by a normal error, which is known once the domino stands. Five ways to build are
compared over the same errors: equal gaps; the best known row; the row whose mean score over other
errors is best (open loop: nobody looks); that row planned anew after every domino that stands
(closed loop); and the best known row with all errors known beforehand, which bounds what looking
can do.

Planning anew maximises the mean score over errors that are still to come, drawn afresh for every
domino, by a few steps of L-BFGS-B along exact gradients, and goes part of the way there, as an
average over drawings would.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from domino_env import Scene, load_scene
from domino_env.core.tables import markdown_table
from domino_env.scenes.unsteady import LEAST_GAP, errors, placed
from optimize import best_known

Floats = NDArray[np.float64]

DEVIATIONS = (0.0005, 0.001, 0.002, 0.004)  # [m]
PLANNED_ON, CLIMB = 256, 200  # errors that the open loop is planned on, steps of its climb
AHEAD, STEPS, PART = 48, 4, 0.7  # of planning anew: errors drawn, steps, part of the way


@dataclass(frozen=True)
class Ways:
    """Scores of the ways to build over the same errors: (H,) each, `closed_loop` the first (R,)."""

    uniform: Floats
    nominal: Floats
    open_loop: Floats
    closed_loop: Floats
    hindsight: Floats


class Builder:
    """Plans rows of a scene whose gaps come out wrong by a normal error.

    Parameters
    ----------
    scene
        With free gaps, equal dominoes and an unsteady hand.
    seed
        Of the errors that plans are made on.
    """

    def __init__(self, scene: Scene, seed: int = 1) -> None:
        self.scene, self.pairs = scene, scene.count - 1
        self.rng = np.random.default_rng(seed)

    def errors(self, rows: int) -> Floats:
        """Draw errors (rows, N-1) [m]."""
        drawn = errors(self.scene.placement_deviation, rows * self.pairs, self.rng)
        return drawn.reshape(rows, self.pairs)

    def planned(self, start: Floats, errors: Floats, stands: Floats, steps: int) -> Floats:
        """Climb from a row to one whose mean score over errors is best; some gaps stand already."""
        done = len(stands)

        def loss(ahead: Floats) -> tuple[float, Floats]:
            gaps = np.empty_like(errors)
            gaps[:, :done] = stands
            gaps[:, done:] = placed(ahead, errors[:, done:])
            score, slope, *_ = self.scene.score_batch_gradient(gaps, None, rtol=1e-6)
            moves = gaps[:, done:] > LEAST_GAP
            return -float(score.mean()), -(slope[:, done:] * moves).mean(axis=0)

        bounds = [self.scene.spacing] * (self.pairs - done)
        options = {"maxiter": steps}
        found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
        return np.asarray(found.x)

    def open_loop(self, starts: list[Floats]) -> Floats:
        """Plan the row whose mean score is best, from several starts."""
        errors, nothing = self.errors(PLANNED_ON), np.empty(0)
        rows = [self.planned(start, errors, nothing, CLIMB) for start in starts]
        return max(rows, key=lambda row: self.scores(row, errors).mean())

    def closed_loop(self, plan: Floats, errors: Floats) -> Floats:
        """Place a row (N-1,) domino by domino with these errors, planning anew after each."""
        plan, stands = plan.copy(), np.empty(0)
        for i in range(self.pairs):
            if i > 0:
                half = self.errors(AHEAD // 2)
                drawn = np.concatenate((half, -half))
                better = self.planned(plan[i:], drawn, stands, STEPS)
                plan[i:] += PART * (better - plan[i:])
            stands = np.append(stands, placed(plan[i], errors[i]))
        return stands

    def scores(self, row: Floats, errors: Floats) -> Floats:
        """Score a row as it comes to stand with each of the errors."""
        return self.scene.score_batch(placed(row, errors), None)


def ways(scene: Scene, best: Floats, rows: int = 32, hands: int = 1024) -> Ways:
    """Compare the ways to build over the same errors.

    Parameters
    ----------
    scene
        With free gaps, equal dominoes and an unsteady hand.
    best
        (N-1,) gaps of its best row without errors [m].
    rows
        R, how many rows are planned anew while they are built.
    hands
        H, R or more: how many rows all other ways build, with the errors of seeds 0, 1, ….
    """
    builder = Builder(scene)
    drawn = [scene.placement_errors(np.random.default_rng(seed)) for seed in range(hands)]
    off = np.array(drawn)
    equal = scene.uniform().layout.spacing
    plan = builder.open_loop([best, equal])
    looked = np.array([builder.closed_loop(plan, one) for one in off[:rows]])
    known = placed(np.clip(best - off, *scene.spacing), off)
    return Ways(
        uniform=builder.scores(equal, off),
        nominal=builder.scores(best, off),
        open_loop=builder.scores(plan, off),
        closed_loop=scene.score_batch(looked, None),
        hindsight=scene.score_batch(known, None),
    )


def main() -> None:
    """Print the table of the site's page on environments."""
    scene, best = load_scene("sprint"), best_known()["sprint"].layout.spacing
    lines = []
    for deviation in DEVIATIONS:
        found = ways(replace(scene, placement_deviation=deviation), best)
        more = found.closed_loop - found.open_loop[: len(found.closed_loop)]
        lines.append(
            [f"{1e3 * deviation:g} mm"]
            + [
                f"{way.mean():.4f} ({np.mean(way <= 0.0):.1%})"
                for way in (found.uniform, found.nominal, found.open_loop)
            ]
            + [f"+{more.mean():.5f} ± {more.std() / np.sqrt(len(more)):.5f}"]
            + [f"{found.hindsight.mean():.4f}"]
        )
    heads = ["error", "equal gaps", "best known row", "open loop", "looking adds", "all known"]
    print("\n".join(markdown_table(heads, lines)))


if __name__ == "__main__":
    main()
