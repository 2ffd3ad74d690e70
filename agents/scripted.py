"""Scripted policies: baselines for the trained ones, evaluated in the same way."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize.elementwise import find_root

from agents.draw import fit_gaps, open_loop, shipped_references
from agents.draw import rule as rule_policy
from agents.rollout import Rollout, build, evaluation_seeds, make_rollout
from domino_env.core.checks import require_type
from domino_env.core.types import Floats, Ints
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.placement import add_errors
from domino_env.scenes.scene import SCORE_RTOL, Scene
from optimize.experiments.best_known import best_known_of
from optimize.searching import search

RAMPS = 4000  # approximate number of ramps that are sampled
BEST_RAMPS = 20  # number of best ramps around which others are sampled
PLANNING = 40  # evaluations of a search for a plan
NO_HIT = 1e3  # [s] lateness of a domino that is not hit
GAP_TOLERANCE = 1e-8  # [m] tolerance of the gaps that the controller solves for


def uniform(scene: Scene) -> Rollout:
    """Build the uniform baseline."""
    return make_rollout(scene, scene.uniform().layout)


def ramp(scene: Scene) -> Rollout:
    """Build the best of about `RAMPS` layouts whose gaps change linearly at both ends.

    Gaps between the ends are equal. The parameters are the first gap, that of the middle, the last
    gap, and the fraction of the chain that each end takes; if thicknesses are free, also the
    thickness of all dominoes.

    Raises
    ------
    ValueError
        If the scene has a stock, or gaps in heights.
    """
    if scene.stock is not None or scene.in_heights:
        raise ValueError(
            f"scene '{scene.name}' has {'a stock' if scene.stock else 'gaps in heights'}: ramp "
            "chooses gaps and thicknesses in metres; use another policy"
        )
    start = time.perf_counter()
    rng = np.random.default_rng(0)
    best = rng.random((RAMPS // 2, 5))
    simulations = len(best) + 1
    best = best[np.argsort(-scene.evaluate(_ramps(scene, best)).score)[:BEST_RAMPS]]
    for deviation in (0.1, 0.03, 0.01):  # standard deviation of the samples, of parameters 0 to 1
        centres = best[rng.integers(BEST_RAMPS, size=RAMPS // 6)]
        neighbours = np.clip(centres + deviation * rng.standard_normal(centres.shape), 0.0, 1.0)
        pool = np.concatenate([best, neighbours])
        simulations += len(pool)
        best = pool[np.argsort(-scene.evaluate(_ramps(scene, pool)).score)[:BEST_RAMPS]]
    layout = _ramps(scene, best[:1]).layout(0)
    return make_rollout(scene, layout, time.perf_counter() - start, simulations)


def _ramps(scene: Scene, parameters: Floats) -> LayoutBatch:
    """Return ramps with parameters (B, 5) in [0, 1]; the nearest ones of the scene's length."""
    space, position = scene.space, np.linspace(0.0, 1.0, scene.count - 1)[None]
    first, middle, last, fraction, thickness = np.split(parameters, 5, axis=1)
    fraction = 0.02 + 0.48 * fraction  # 2 to 50 % of the chain
    at_start = np.clip(1.0 - position / fraction, 0.0, 1.0)
    at_end = np.clip(1.0 - (1.0 - position) / fraction, 0.0, 1.0)
    gaps = middle + (first - middle) * at_start + (last - middle) * at_end
    values = space.low + space.select(gaps, thickness, 1.0) * (space.high - space.low)
    return scene.batch(*space.sizes(space.project(values)))


def plan(scene: Scene) -> Rollout:
    """Build the best known layout without reaction to observations.

    If pieces are drawn in random order, take a fixed sequence of gaps and desired thicknesses: the
    shipped one in the scene "draw", else one of `agents.draw.fit_gaps`. With placement noise, a
    scene without a best known layout is searched with `PLANNING` evaluations.

    Raises
    ------
    ValueError
        If no best known layout of a scene without placement noise is shipped.
    """
    references = shipped_references()
    if scene.hand and scene == load_scene("draw"):
        return build(open_loop(scene, references["plan"]), scene)
    if scene.hand:
        return build(rule_policy(scene, fit_gaps(scene, references["rule"], reacts=False)), scene)
    record = best_known_of(scene)
    if record is None and scene.placement is not None:
        found = search(scene, budget=PLANNING, seed=0)
        return make_rollout(scene, found.layout, found.seconds, found.evaluations)
    if record is None:
        raise ValueError(
            f"no best known layout of scene '{scene.name}' is shipped: use another policy"
        )
    return make_rollout(scene, record.layout)


def rule(scene: Scene) -> Rollout:
    """Choose gaps and desired thicknesses from position and pieces, by `agents.draw.rule`.

    The shipped rule is for the scene "draw"; for others, `agents.draw.fit_gaps` adapts its gaps.

    Raises
    ------
    ValueError
        If the scene does not draw its pieces in random order, or for the reasons of
        `agents.draw.rule`.
    """
    if not scene.hand:
        raise ValueError(
            f"scene '{scene.name}' draws no pieces in random order: rule chooses among those in "
            "hand; use another policy"
        )
    coefficients = shipped_references()["rule"]
    if scene != load_scene("draw"):
        coefficients = fit_gaps(scene, coefficients)
    return build(rule_policy(scene, coefficients), scene)


def controller(scene: Scene) -> Rollout:
    """Choose each gap so that, without its placement error, the next domino is hit on schedule.

    Thicknesses are those of `plan` if they are free. If no gap within the bounds meets the
    schedule, the nearest bound is taken.

    Raises
    ------
    ValueError
        If the hits of the scene have no schedule, if it draws its pieces in random order, or for
        the reasons of `plan`.
    """
    tempo = scene.tempo
    if tempo is None or scene.hand:
        raise ValueError(
            f"scene '{scene.name}' has the objective {scene.objective} and a hand of {scene.hand}: "
            'controller keeps the schedule of objective = "tempo" without a hand; use another one'
        )
    planned = plan(scene) if scene.free_thickness else uniform(scene)
    generators = map(np.random.default_rng, evaluation_seeds(scene))
    errors = np.array([scene.placement_errors(generator) for generator in generators])
    episodes = np.arange(len(errors))
    thickness = np.tile(planned.layout.thickness[1:], (len(errors), 1))
    gaps, (low, high) = np.empty(errors.shape), scene.spacing
    start, simulations = time.perf_counter(), 0
    for n, due in enumerate(tempo.schedule(scene.count)):

        def lateness(gap: Floats, index: Ints, n: int = n, due: float = due) -> Floats:
            """Return how late domino n + 1 is hit [s] in some episodes, after given gaps."""
            spacing = np.concatenate([gaps[index, :n], gap[:, None]], axis=1)
            times = scene.batch(spacing, thickness[index, : n + 1]).simulate().total_time
            return np.where(np.isfinite(times), times - due, NO_HIT)

        bracket = np.full(len(errors), low), np.full(len(errors), high)
        root = find_root(lateness, bracket, args=(episodes,), tolerances={"xatol": GAP_TOLERANCE})
        simulations += int(root.nfev.sum())
        nearest = np.where(root.f_bracket[0] > 0.0, low, high)  # if no gap meets the schedule
        gaps[:, n] = add_errors(np.where(root.success, root.x, nearest), errors[:, n])
    scores = scene.as_placed.evaluate(scene.batch(gaps, thickness, rtol=SCORE_RTOL)).score
    seconds = (time.perf_counter() - start) / len(errors)
    layout = scene.layout(gaps[0], thickness[0])
    return make_rollout(scene, layout, seconds, simulations // len(errors), scores=scores)


SCRIPTED: dict[str, Callable[[Scene], Rollout]] = {
    policy.__name__: policy for policy in (uniform, ramp, plan, rule, controller)
}


@dataclass(frozen=True)
class ScriptedPolicy:
    """Scripted policy with a name in `SCRIPTED`."""

    name: str

    def build(self, scene: Scene) -> Rollout:
        """Build a layout; raise ValueError for a scene that the policy cannot handle."""
        require_type("scene", scene, Scene, "a Scene, as load_scene returns")
        return SCRIPTED[self.name](scene)
