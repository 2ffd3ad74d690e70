"""Checkpoint: whether what a file holds fits the learner that is to go on from it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from agents.run_files import require_curve, require_number
from domino_env.support.reading import naming, shown

WORDS = 624  # of the state of NumPy's old generator
TAUGHT = ("learner", "done", "curve", "seconds", "processor_seconds")
MOMENTS = ("step", "exp_avg", "exp_avg_sq")  # of Adam, which all learners use
BUFFER = ("observations", "next_observations", "actions", "rewards", "dones")


def read_checkpoint(model: Any, path: Path) -> dict[str, Any]:
    """The state in a checkpoint of such a learner: plain numbers and tensors, no code.

    ValueError, naming the file, for what is damaged, too large, or another learner's.
    """
    with naming(path):
        state = _plain(path)
        _fits(state, model)
        return dict(state)


def read_teaching(learner: Any, path: Path, columns: int) -> dict[str, Any]:
    """The same of a designer that is taught a family of scenes.

    columns: of its learning curve.
    """
    with naming(path):
        state, held = _plain(path), learner.state()
        _same_keys("checkpoint", state, dict.fromkeys(TAUGHT))
        _same_keys("learner", state["learner"], held)
        for name, values in held.items():
            found, owner = state["learner"][name], getattr(learner, name)
            if isinstance(owner, torch.optim.Optimizer):
                _optimiser(name, found, values, owner)
            else:
                _same_tensors(name, found, values)
        if type(state["done"]) is not int or not 0 <= state["done"] < 2**60:
            raise ValueError(f"done = {shown(state['done'])}: not a count")
        require_curve(state["curve"], columns)
        for name in ("seconds", "processor_seconds"):
            require_number(name, state[name])
        return dict(state)


def _plain(path: Path) -> Any:
    """What a file of torch's holds, if that is numbers alone."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return torch.load(path, weights_only=True, map_location="cpu")
    except Exception as error:  # the unpickler raises whatever the bytes lead it to
        raise ValueError(f"not a checkpoint: {error}") from None


def _fits(state: Any, model: Any) -> None:
    wanted = {"parameters", "steps", "updates", "episodes", "torch", "numpy", "place", "more"}
    if not isinstance(state, dict) or not wanted <= set(state):
        raise ValueError("not a checkpoint: a part of it is missing")
    for name in ("steps", "updates", "episodes"):
        if type(state[name]) is not int or not 0 <= state[name] < 2**60:
            raise ValueError(f"{name} = {shown(state[name])}: not a count")
    if type(state["place"]) is not int or not 0 <= state["place"] <= WORDS:
        raise ValueError(f"place = {shown(state['place'])}: not a place among {WORDS}")
    _tensor("torch", state["torch"], torch.get_rng_state())
    _tensor("numpy", state["numpy"], torch.zeros(WORDS, dtype=torch.int64))
    if not isinstance(state["more"], dict):
        raise ValueError("more: not what a training keeps")
    _numbers("more", state["more"], 3)
    held = model.get_parameters()
    _same_keys("parameters", state["parameters"], held)
    for name, values in held.items():
        found, where = state["parameters"][name], f"parameters.{name}"
        owner = model
        for part in name.split("."):
            owner = getattr(owner, part)
        if isinstance(owner, torch.optim.Optimizer):
            _optimiser(where, found, values, owner)
        else:
            _same_tensors(where, found, values)
    if "entropy" in state:
        _tensor("entropy", state["entropy"], getattr(model, "log_ent_coef", None))
    if "buffer" in state:
        buffer = getattr(model, "replay_buffer", None)
        _same_keys("buffer", state["buffer"], dict.fromkeys(BUFFER))
        for name in BUFFER:
            _tensor(f"buffer.{name}", state["buffer"][name], getattr(buffer, name, None))
        place, full = _pair(state.get("buffer_place"))
        if type(place) is not int or type(full) is not bool or not 0 <= place < buffer.buffer_size:  # type: ignore[union-attr]
            raise ValueError(f"buffer_place = {shown(place)}: not a place in the buffer")


def _pair(value: Any) -> tuple[Any, Any]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise ValueError(f"buffer_place = {shown(value)}: expected a place and whether it is full")
    return value[0], value[1]


def _same_keys(where: str, found: Any, wanted: Mapping[str, Any]) -> None:
    if not isinstance(found, dict) or set(found) != set(wanted):
        raise ValueError(f"{where}: not those of such a learner")


def _same_tensors(where: str, found: Any, wanted: Any) -> None:
    """The same names with tensors of the same shapes; or one tensor like the other."""
    if not isinstance(wanted, Mapping):
        _tensor(where, found, wanted)
        return
    _same_keys(where, found, wanted)
    for name, value in wanted.items():
        _tensor(f"{where}.{name}", found[name], value)


def _tensor(where: str, found: Any, wanted: Any) -> None:
    if not isinstance(found, torch.Tensor) or wanted is None:
        raise ValueError(f"{where}: {shown(type(found).__name__)} where numbers should stand")
    like = wanted if isinstance(wanted, torch.Tensor) else torch.from_numpy(wanted)
    # as a slice of what is stored: one number may otherwise pass for a billion
    if found.shape != like.shape or found.dtype != like.dtype or not found.is_contiguous():
        raise ValueError(
            f"{where}: {found.dtype} of shape {tuple(found.shape)}, not {like.dtype} of "
            f"{tuple(like.shape)}"
        )
    if not torch.isfinite(found).all():
        raise ValueError(f"{where} holds what is no finite number")


def _optimiser(where: str, found: Any, held: Any, owner: torch.optim.Optimizer) -> None:
    _same_keys(where, found, held)
    parameters = [p for group in owner.param_groups for p in group["params"]]
    groups = found["param_groups"]
    if not isinstance(groups, list) or len(groups) != len(held["param_groups"]):
        raise ValueError(f"{where}.param_groups: not those of such a learner")
    for group, like in zip(groups, held["param_groups"], strict=True):
        _same_keys(f"{where}.param_groups", group, like)
        _numbers(f"{where}.param_groups", group, 2)
        # the rate changes along the way
        if any(group[name] != value for name, value in like.items() if name != "lr"):
            raise ValueError(f"{where}.param_groups: not those of such a learner")
        if not isinstance(group["lr"], float) or not 0.0 <= group["lr"] <= 1e3:
            raise ValueError(f"{where}.param_groups.lr = {shown(group['lr'])}: no rate of learning")
    states = found["state"]
    if not isinstance(states, dict):
        raise ValueError(f"{where}.state: not that of such a learner")
    for key, state in states.items():
        if type(key) is not int or not 0 <= key < len(parameters) or not isinstance(state, dict):
            raise ValueError(f"{where}.state: not that of such a learner")
        _same_keys(f"{where}.state.{key}", state, dict.fromkeys(MOMENTS))
        for name, value in state.items():
            like = torch.zeros(()) if name == "step" else parameters[key]
            _tensor(f"{where}.state.{key}.{name}", value, like)


def _numbers(where: str, value: Any, depth: int) -> None:
    """Plain numbers, none of them nan, in lists and dicts that are not deep."""
    if isinstance(value, dict | list | tuple) and depth > 0:
        for one in value.values() if isinstance(value, dict) else value:
            _numbers(where, one, depth - 1)
    elif not (value is None or isinstance(value, bool | int | float)) or value != value:
        raise ValueError(f"{where}: {shown(value)} where a number should stand")
    elif isinstance(value, int) and abs(value) >= 2**63:
        raise ValueError(f"{where}: {shown(value)} is too large")
