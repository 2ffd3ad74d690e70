"""The environments against the clock, with Gymnasium's own CartPole beside them in the same run.

Actions are drawn beforehand; resets and observations are part of what is timed.
"""

from __future__ import annotations

import time
from itertools import cycle
from typing import Any

import gymnasium
import numba
import numpy as np

ROWS = 1024
STEPS = 400  # of a vector environment, a turn
TURNS = 7


def environment_steps() -> list[str]:
    """Tabulate what a step costs alone, and how many a second there are together."""
    return [*single_steps(), "", *vector_steps()]


def single_steps() -> list[str]:
    """Tabulate microseconds a step, resets included."""
    lines = [
        "one row, random actions              unwrapped [us]   as gymnasium.make gives it [us]"
    ]
    for name, arguments in _ENVIRONMENTS:
        wrapped = gymnasium.make(name, **arguments)
        rng = np.random.default_rng(0)
        actions = [_drawn(wrapped.action_space, rng) for _ in range(1000)]
        times = [1e6 * _median(_step_alone, env, actions) for env in (wrapped.unwrapped, wrapped)]
        lines.append(f"{_words(name, arguments):38}{times[0]:13.1f}   {times[1]:31.1f}")
    return lines


def vector_steps() -> list[str]:
    """Tabulate steps a second of all rows together, and processor time a step."""
    lines = [
        f"{ROWS} rows, random actions, {numba.get_num_threads()} threads      "
        "steps a second   processor time a step [us]"
    ]
    for name, arguments in _ENVIRONMENTS:
        env = gymnasium.make_vec(
            name, num_envs=ROWS, vectorization_mode="vector_entry_point", **arguments
        )
        rng = np.random.default_rng(0)
        space: Any = env.single_action_space
        actions = [np.stack([_drawn(space, rng) for _ in range(ROWS)]) for _ in range(40)]
        env.reset(seed=0)
        _step_together(env, actions)
        busy = time.process_time()
        seconds = _median(_step_together, env, actions)
        busy = (time.process_time() - busy) / TURNS / (STEPS * ROWS)
        lines.append(f"{_words(name, arguments):38}{1.0 / seconds:16,.0f}   {1e6 * busy:26.2f}")
    return lines


_ENVIRONMENTS: list[tuple[str, dict[str, Any]]] = [
    ("DominoChain-v0", {"scene": "sprint"}),
    ("DominoChain-v0", {"scene": "varied"}),
    ("CartPole-v1", {}),
]


def _words(name: str, arguments: dict[str, Any]) -> str:
    return " ".join([name, *arguments.values()])


def _drawn(space: Any, rng: np.random.Generator) -> Any:
    if isinstance(space, gymnasium.spaces.Discrete):
        return int(rng.integers(space.n))
    return rng.uniform(-1.0, 1.0, space.shape).astype(np.float32)


def _median(task: Any, *arguments: Any) -> float:
    return float(np.median([task(*arguments) for _ in range(TURNS)]))


def _step_alone(env: Any, actions: list[Any]) -> float:
    """Seconds a step."""
    env.reset(seed=0)
    draw, over, number = cycle(actions), False, 4000
    began = time.perf_counter()
    for _ in range(number):
        if over:
            env.reset()
        _, _, terminated, truncated, _ = env.step(next(draw))
        over = terminated or truncated
    return (time.perf_counter() - began) / number


def _step_together(env: Any, actions: list[Any]) -> float:
    """Seconds a step of one row."""
    draw = cycle(actions)
    began = time.perf_counter()
    for _ in range(STEPS):
        env.step(next(draw))
    return (time.perf_counter() - began) / (STEPS * ROWS)
