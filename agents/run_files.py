"""Run files: what a training left in its folder, read back as a stranger's.

Nothing in them is run, every number is looked at before it costs memory, and what does not fit is
refused with a sentence.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from agents.presets import ALGORITHMS, Preset
from domino_env.support.reading import naming, read_json, shown

WIDEST, DEEPEST = 4096, 16  # of a network
OPTIONS = {
    "alive_bonus_offset", "batch_size", "buffer_size", "clip_range", "clip_range_vf", "delta_std",
    "ent_coef", "gae_lambda", "gamma", "gradient_steps", "learning_starts", "max_grad_norm",
    "n_delta", "n_epochs", "n_eval_episodes", "n_steps", "n_top", "normalize_advantage",
    "policy_delay", "target_entropy", "target_kl", "target_noise_clip", "target_policy_noise",
    "target_update_interval", "tau", "top_quantiles_to_drop_per_net", "train_freq", "vf_coef",
    "zero_policy",
}  # fmt: skip
"""What a file may ask of an algorithm: numbers.  Not where it writes, nor what code it runs."""
_WORDS = re.compile(r"auto(_[0-9.]{1,8})?")


@dataclass(frozen=True)
class Begun:
    """What a run was begun with, from its config.json."""

    algorithm: str
    seed: int
    steps: int
    plan: Preset


def read_config(folder: Path) -> Begun:
    """The config.json of a run.  ValueError, naming it, for anything else."""
    path = folder / "config.json"
    document = read_json(path)
    with naming(path):
        document = _object(document, "this")
        algorithm = document.get("algorithm")
        if algorithm not in ALGORITHMS:
            raise ValueError(f"algorithm = {shown(algorithm)}: choose {', '.join(ALGORITHMS)}")
        seed = _whole(document.get("seed"), "seed", 0, 2**32 - 1)
        steps = _whole(document.get("steps"), "steps", 1, 10**15)
        plan = _preset(_object(document.get("preset"), "preset"))
        require_memory(plan)
        return Begun(str(algorithm), seed, steps, plan)


def read_reference(folder: Path) -> float:
    """The speed that the policy of a run is used to, over the uniform row's."""
    path = folder / "policy.json"
    document = read_json(path)
    with naming(path):
        told: Any = _object(document, "this").get("reference_over_uniform")
        if type(told) not in (int, float) or not 0.0 < told <= 1e3:
            raise ValueError(f"reference_over_uniform = {shown(told)}: give a number, 0 to 1000")
        return float(told)


def require_memory(plan: Preset) -> None:
    """ValueError for networks and rows that no learner has."""
    if not (1 <= plan.width <= WIDEST and 0 <= plan.depth <= DEEPEST and plan.rows >= 1):
        raise ValueError(
            f"width = {plan.width}, depth = {plan.depth}, rows = {plan.rows}: give networks of at "
            f"most {DEEPEST} layers of {WIDEST}, and at least one row"
        )


def require_progress(more: Mapping[str, Any], columns: int) -> None:
    """ValueError where what a training kept of its progress is not that.

    columns: of its learning curve.
    """
    for name in ("best", "sampled", "seconds", "processor_seconds", "reference"):
        require_number(name, more.get(name), scores=name in ("best", "sampled"))
    for name in ("next_look", "next_keep"):
        _whole(more.get(name), name, 0, 2**60)
    if more.get("clone_score") is not None:
        require_number("clone_score", more["clone_score"], scores=True)
    require_curve(more.get("curve"), columns)


def require_curve(curve: object, columns: int) -> None:
    """ValueError for what is no list of rows of so many numbers."""
    for row in curve if isinstance(curve, list) else [curve]:
        if not isinstance(row, list) or len(row) != columns:
            raise ValueError(f"curve holds {shown(row)}: expected {columns} numbers")
        for value in row:
            require_number("curve", value, scores=True)


def _object(value: object, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{where} is {shown(value)}: expected an object")
    return value


def _whole(value: object, where: str, low: int, high: int) -> int:
    if type(value) is not int or not low <= value <= high:
        raise ValueError(f"{where} = {shown(value)}: give a whole number from {low} to {high}")
    return value


def _preset(document: dict[str, Any]) -> Preset:
    known = {field.name: field.default for field in fields(Preset)}
    for key, value in document.items():
        if key not in known:
            raise ValueError(f"preset has an unknown key {shown(key)}")
        if key != "options":
            whole = key in ("rows", "steps", "width", "depth")
            _setting(f"preset.{key}", value, whole, isinstance(known[key], bool))
    options = _object(document.get("options", {}), "preset.options")
    for key, value in options.items():
        if key not in OPTIONS:
            raise ValueError(f"preset.options has an unknown key {shown(key)}")
        _option(f"preset.options.{key}", value)
    for key in ("rows", "steps"):
        if key not in document:
            raise ValueError(f"preset.{key} is missing")
    return Preset(**document)


def _setting(where: str, value: object, whole: bool, yes_or_no: bool) -> None:
    if yes_or_no:
        if not isinstance(value, bool):
            raise ValueError(f"{where} = {shown(value)}: give true or false")
    elif whole:
        _whole(value, where, 0, 10**15)
    else:
        require_number(where, value)


def _option(where: str, value: object) -> None:
    if value is None or isinstance(value, bool):
        return
    if isinstance(value, str) and _WORDS.fullmatch(value):
        return
    require_number(where, value)


def require_number(where: str, value: object, *, scores: bool = False) -> None:
    """ValueError for what is no finite number; scores of rows that were never built are -inf."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if number and (-1e15 <= value <= 1e15 or (scores and value == -math.inf)):  # type: ignore[operator]
        return
    raise ValueError(f"{where} = {shown(value)}: give a finite number")
