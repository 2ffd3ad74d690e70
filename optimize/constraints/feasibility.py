"""Whether any row at all keeps a scene's rules; if not, which of them clash."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from domino_env.scenes.scene import Scene

if TYPE_CHECKING:
    from collections.abc import Iterable

MM = 1e3  # the programme is in millimetres: HiGHS takes rules as kept to 1e-6, a nanometre then


def require_feasible(scene: Scene) -> None:
    """Raise ValueError naming the rules that clash, if no layout keeps all of them."""
    if _plainly_feasible(scene):
        return
    found = clashing_rules(scene)
    if found:
        raise ValueError(
            f"scene '{scene.name}': no layout of {scene.count} dominoes keeps all its rules; these "
            f"clash: {'; '.join(found)}: change one of them"
        )


def _plainly_feasible(scene: Scene) -> bool:
    """Without a programme: bounds, lists and changes alone always leave equal gaps."""
    if scene.stock is not None and sum(scene.stock.count) < scene.count:
        return False
    if scene.length is None:
        return True
    if scene.stock or scene.spacing_values or scene.thickness_values:
        return False
    pairs = scene.count - 1
    least, most = (pairs * (scene.spacing[k] + scene.thickness[k]) for k in (0, 1))
    return least - 1e-12 <= scene.length <= most + 1e-12


def clashing_rules(scene: Scene) -> list[str]:
    """List rules none of which can be left out without the others getting along; empty if all do.

    Every rule in turn is left out for good if the others clash without it.

    Raises
    ------
    RuntimeError
        Where the solver gives no answer.
    """
    rules = _rules(scene)
    if _feasible(rules.values()):
        return []
    kept = dict(rules)
    for name in rules:
        fewer = {other: rule for other, rule in kept.items() if other != name}
        if not _feasible(fewer.values()):
            kept = fewer
    return list(kept)


def _feasible(rules: Iterable[list[Any]]) -> bool:
    import cvxpy as cp

    programme = cp.Problem(cp.Minimize(0.0), [one for rule in rules for one in rule])
    programme.solve(solver=cp.HIGHS)
    if programme.status not in ("optimal", "infeasible", "infeasible_or_unbounded"):
        raise RuntimeError(f"whether the rules of the scene clash is not known: {programme.status}")
    return bool(programme.status == "optimal")


def _rules(scene: Scene) -> dict[str, list[Any]]:
    """Each rule in words, and as constraints of one programme over gaps and thicknesses [mm]."""
    import cvxpy as cp

    pairs = scene.count - 1
    gaps, thick = cp.Variable(pairs, nonneg=True), cp.Variable(pairs, nonneg=True)
    low, high = scene.spacing
    found = {_bounds("spacing", low, high): [gaps >= MM * low, gaps <= MM * high]}
    if scene.spacing_values is not None:
        found[f"spacing only {_list(scene.spacing_values)}"] = _on_list(gaps, scene.spacing_values)
    if scene.largest_change is not None and pairs > 1:
        rule = [cp.abs(cp.diff(gaps)) <= MM * scene.largest_change]
        found[f"spacing.largest_change = {scene.largest_change:g} m"] = rule
    if scene.stock is not None:
        kinds = np.array(scene.stock.thickness)
        taken = cp.Variable((pairs, len(kinds)), boolean=True)
        first = scene.stock.kind(scene.first_thickness)
        left = np.array(scene.stock.count) - (np.arange(len(kinds)) == first)
        found[f"the stock: {scene.stock.in_words()}"] = [
            thick == taken @ (MM * kinds),
            cp.sum(taken, axis=1) == 1,
            cp.sum(taken, axis=0) <= left,
        ]
    else:
        low, high = scene.thickness
        found[_bounds("thickness", low, high)] = [thick >= MM * low, thick <= MM * high]
        if scene.thickness_values is not None:
            name = f"thickness only {_list(scene.thickness_values)}"
            found[name] = _on_list(thick, scene.thickness_values)
    if scene.length is not None:
        rule = [cp.sum(gaps) + cp.sum(thick) == MM * scene.length]
        found[f"row.length = {scene.length:.10g} m"] = rule
    return found


def _on_list(variable: Any, values: tuple[float, ...]) -> list[Any]:
    import cvxpy as cp

    listed = MM * np.array(values)
    steps = np.diff(listed)
    if len(values) > 2 and np.ptp(steps) < 1e-9:
        number = cp.Variable(variable.size, integer=True)
        top = len(values) - 1
        return [variable == listed[0] + steps.mean() * number, number >= 0, number <= top]
    chosen = cp.Variable((variable.size, len(values)), boolean=True)
    return [variable == chosen @ listed, cp.sum(chosen, axis=1) == 1]


def _bounds(name: str, low: float, high: float) -> str:
    return f"{name} from {low:g} to {high:g} m" if low < high else f"{name} = {low:g} m"


def _list(values: tuple[float, ...]) -> str:
    if len(values) > 6:
        return f"{values[0]:g}, {values[1]:g}, … {values[-1]:g} m"
    return ", ".join(f"{v:g}" for v in values) + " m"
