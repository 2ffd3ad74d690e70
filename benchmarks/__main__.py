"""Run times of simulations and environments, after a first call: ``make bench``.

Each run time is the median of several calls, divided by the number of units of work in a call.
Calls that are compared take turns. The last table has the processor times of first calls in new
processes, which compile code or load it. Compare run times of one run of this program only:
machines differ, and so does their other work.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from itertools import chain, cycle, product, starmap
from typing import Any

import gymnasium
import numpy as np
from numba.core import event

import domino_env as de
from benchmarks.page import time_page
from domino_env.physics.wave import MIN_RTOL
from domino_env.rigid.simulation import largest_difference

Call = Callable[[], object]
ENVIRONMENTS: tuple[tuple[str, dict[str, Any]], ...] = (  # names, and arguments of `make`
    ("DominoChain-v2", {"scene": "sprint"}),
    ("DominoChain-v2", {"scene": "varied"}),
    ("CartPole-v1", {}),
)


def median_times(*calls: Call, turns: int = 60) -> list[float]:
    """Return the median times of calls that take turns [s], after a first turn."""
    times = np.empty((turns + 1, len(calls)))
    for turn in range(turns + 1):
        for k, call in enumerate(calls):
            start = time.perf_counter()
            call()
            times[turn, k] = time.perf_counter() - start
    return [float(seconds) for seconds in np.median(times[1:], axis=0)]


def format_line(name: str, seconds: float, remark: str = "") -> str:
    """Return a line of the table: call and unit of work, time per unit [µs], remark."""
    return f"{name:68}{1e6 * seconds:14.2f}   {remark}"


def time_waves() -> Iterator[str]:
    """Yield lines on single waves, with their errors, and on their gradients."""
    rng = np.random.default_rng(2)
    layouts = {
        "100 uniform, pitch 16 mm": de.Layout.uniform(100, pitch=0.016),
        "100 random, gaps 10-25 mm": de.Layout(rng.uniform(0.010, 0.025, 99), 0.0075),
        "40 random, gaps 2-40 mm": de.Layout(rng.uniform(0.002, 0.040, 39), 0.0075),
    }
    for (name, layout), friction in product(layouts.items(), (0.25, 0.0)):
        physics = de.Physics(friction, 9.81, 8.0)
        exact = de.simulate(layout, physics, rtol=MIN_RTOL)
        for rtol in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12):
            plain = partial(de.simulate, layout, physics, rtol=rtol)
            wave, times = plain(), median_times(plain, partial(_gradient, plain))
            error = largest_difference(wave.arrival_times, exact.arrival_times)
            case = f"{name}, friction {friction:g}, rtol {rtol:.0e}"
            remark = f"error {error:.1e}, estimate {wave.error_estimate:.1e}"
            yield format_line(f"wave: {case}", times[0], remark)
            yield format_line(f"gradient: {case}", times[1], f"{times[1] / times[0]:.2f} waves")


def _gradient(plain: Callable[..., de.Wave]) -> object:
    """Simulate a wave with its gradient, and return the gradient."""
    return plain(gradient=True).gradient()


def time_long_layouts_and_batches() -> Iterator[str]:
    """Yield lines on long layouts, and on batches, which all cores share."""
    rng = np.random.default_rng(3)
    for count in (1_000, 10_000, 100_000):
        random = de.Layout(rng.uniform(0.010, 0.025, count - 1), 0.0075)
        for name, layout in ("uniform", de.Layout.uniform(count, pitch=0.016)), ("random", random):
            (seconds,) = median_times(partial(de.simulate, layout, de.Physics()), turns=3)
            yield format_line(f"{count} {name}, per domino", seconds / count)
    spacing = np.random.default_rng(4).uniform(0.002, 0.040, (4000, 39))
    for rtol in (1e-4, 1e-6, 1e-8):
        batch = partial(de.simulate_batch, spacing, 0.0075, de.Physics(), rtol=rtol, record=False)
        each = median_times(batch, turns=7)[0] / len(spacing)
        name = f"batch of 4000 x 40, speed only, rtol {rtol:.0e}, per layout"
        yield format_line(name, each, f"{1.0 / each:,.0f} layouts per second")


def time_environments(num_envs: int = 1024, steps: int = 400) -> Iterator[str]:
    """Yield lines on steps of environments, resets included.

    Vector environments take turns with the simulation of layouts whose gaps are the same actions,
    of which the time per interval between hits is compared with that of a step.

    Parameters
    ----------
    num_envs
        Number of environments of a vector environment.
    steps
        Steps of a vector environment in a call; single environments take ten times as many.
    """
    batches: dict[str, tuple[Any, list[Any]]] = {}  # vector environments and their actions
    for name, options in ENVIRONMENTS:
        title = " ".join([name, *options.values()])
        wrapped = gymnasium.make(name, **options)
        space: Any = wrapped.action_space
        space.seed(0)
        actions = [space.sample() for _ in range(1000)]
        for kind, env in (("unwrapped", wrapped.unwrapped), ("as made", wrapped)):
            (seconds,) = median_times(partial(_play, env, actions, 10 * steps), turns=7)
            yield format_line(f"step of one {title}, {kind}", seconds / (10 * steps))
        kinds = {"random": [np.stack([space.sample() for _ in range(num_envs)]) for _ in range(39)]}
        if options:
            kinds["zero"] = [np.zeros((num_envs, *space.shape), np.float32)]
        for kind, samples in kinds.items():
            vector = gymnasium.make_vec(
                name, num_envs=num_envs, vectorization_mode="vector_entry_point", **options
            )
            vector.reset(seed=0)
            batches[f"{title}, {kind} actions"] = vector, samples
    scene = de.load_scene("sprint")
    places = de.DominoChainVector(num_envs, scene)
    gaps = places.place_all(
        np.stack(batches[f"{ENVIRONMENTS[0][0]} sprint, random actions"][1], 1)
    )[0]
    simulation = partial(de.simulate_batch, gaps, 0.0075, scene.physics, rtol=1e-6, record=False)
    intervals = int(np.sum(simulation().hit - 1))
    plays = [partial(_play_vector, vector, samples, steps) for vector, samples in batches.values()]
    simulated, *played = median_times(simulation, *plays, turns=7)
    for title, seconds in zip(batches, played, strict=True):
        each = seconds / (steps * num_envs)
        ratio = simulated / intervals / each
        remark = f"{1.0 / each:,.0f} steps per second, {ratio:.2f} of bare simulation"
        yield format_line(f"step of {num_envs} {title}, per environment", each, remark)


def _play(env: Any, actions: Any, steps: int) -> None:
    """Take steps in a single environment, which is reset after each episode."""
    env.reset(seed=0)
    over = False
    for _, action in zip(range(steps), cycle(actions), strict=False):
        if over:
            env.reset()
        _, _, terminated, truncated, _ = env.step(action)
        over = terminated or truncated


def _play_vector(env: Any, actions: Any, steps: int) -> None:
    """Take steps in a vector environment, which resets itself."""
    for _, action in zip(range(steps), cycle(actions), strict=False):
        env.step(action)


def first_calls() -> dict[str, Call]:
    """Return the calls that are timed in a new process, which has loaded no compiled code."""
    spacing, physics = np.random.default_rng(0).uniform(0.01, 0.03, (4, 39)), de.Physics()
    random, uniform = de.Layout(spacing[0], 0.0075), de.Layout.uniform(40, pitch=0.02)
    hills = de.load_scene("hills").replace(count=20)

    def step() -> object:
        env = de.DominoChain("sprint")
        env.reset(seed=0)
        return env.step(env.action_space.sample())

    return {
        "random layout": lambda: de.simulate(random, physics),
        "uniform layout": lambda: de.simulate(uniform, physics),
        "batch": lambda: de.simulate_batch(spacing, 0.0075, physics),
        "gradient": lambda: de.simulate(random, physics, gradient=True).gradient(),
        "batch with gradient": lambda: de.simulate_batch(spacing, 0.0075, physics, gradient=True),
        "uneven ground": lambda: de.simulate_batch(spacing, 0.0075, physics, tilt=0.02),
        "step of an environment": step,
        "placing": lambda: de.DominoChainVector(1, "sprint").place_all(np.zeros((1, 39, 1))),
        "diagnosis": lambda: de.diagnose(random, physics),
        "smallest push": lambda: de.smallest_push(random, physics),
        "steady wave": lambda: de.steady_wave(0.02, 0.0075),
        "steady pattern": lambda: de.steady_pattern([0.02, 0.022], 0.0075),
        "free-standing": lambda: de.simulate_standing(uniform, physics, 0.5),
        "motion": lambda: de.Motion(uniform, physics).angles([0.1]),
        "curved ground": lambda: hills.evaluate(
            hills.batch(spacing[:1, :19], None, None), gradient=True
        ),
        "gradient of placing": lambda: de.DominoChainVector(1, "sprint").place_all_vjp(
            np.zeros((1, 39, 1)), np.ones((1, 39, 3))
        ),
    }


def output_of_new_process(table: str, cache: str) -> str:
    """Return what this program prints in a new process.

    Parameters
    ----------
    table
        Argument of the program.
    cache
        Folder of compiled code, which the process reads and writes.
    """
    command = [sys.executable, "-m", "benchmarks", table]
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout


# Passes of Numba's compiler that the table of compilation names; the others are "other passes"
PHASES = {"nopython_type_inference": "types", "native_lowering": "lowering"}


class _CompilationTimes(event.Listener):
    """Processor times of compilation without those of functions compiled meanwhile, by phase."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self.functions: Counter[str] = Counter()
        self.running: list[list[Any]] = []  # phase and the time since which it is counted

    def on_start(self, event: event.Event) -> None:
        """Begin a phase, in place of that in which it is needed."""
        if event.kind == "numba:compile":
            function = event.data["dispatcher"].py_func
            self.functions[f"{function.__module__}.{function.__qualname__}"] += 1
            return
        self._count()
        phase = "LLVM"
        if event.kind == "numba:run_pass":
            phase = PHASES.get(event.data["name"].partition(" ")[0], "other passes")
        self.running.append([phase, time.process_time()])

    def on_end(self, event: event.Event) -> None:
        """End a phase and continue with the one before."""
        if event.kind != "numba:compile":
            self._count()
            self.running.pop()

    def _count(self) -> None:
        now = time.process_time()
        if self.running:
            phase, since = self.running[-1]
            self.seconds[phase] += now - since
        for entry in self.running:
            entry[1] = now


def compilation_table() -> Iterator[str]:
    """Yield lines on what the first calls of this process compile, in their order."""
    phases = [*PHASES.values(), "other passes", "LLVM"]
    yield f"{'compilation [s]':24}{'sum':>8}" + "".join(f"{name:>14}" for name in phases)
    for name, call in first_calls().items():
        times, start = _CompilationTimes(), time.process_time()
        with ExitStack() as stack:
            for kind in ("numba:compile", "numba:run_pass", "numba:llvm_lock"):
                stack.enter_context(event.install_listener(kind, times))
            call()
        parts = "".join(f"{times.seconds[phase]:14.2f}" for phase in phases)
        own = sum(n for f, n in times.functions.items() if f.startswith("domino_env"))
        again = sum(times.functions.values()) - len(times.functions)
        yield (
            f"{name:24}{time.process_time() - start:8.2f}{parts}   {own} functions, "
            f"{sum(times.functions.values()) - own} of Numba, {again} for other types"
        )


def main() -> None:
    """Print the tables, or the one that an argument names."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure run times of simulations and environments: five minutes.",
    )
    parts = {
        "first-calls": "processor times of the first calls of this process, as JSON",
        "compilation": "what these calls compile",
        "page": "the page in Chromium",
    }
    text = "; ".join(f"{name}: {meaning}" for name, meaning in parts.items())
    parser.add_argument("part", nargs="?", choices=parts, help=f"one table instead of all. {text}")
    print_tables(parser.parse_args().part)


@de.compiled()
def print_tables(part: str | None) -> None:
    """Print a table of this process, or all tables."""
    if part == "first-calls":
        seconds = {}
        for name, call in first_calls().items():
            start = time.process_time()
            call()
            seconds[name] = time.process_time() - start
        print(json.dumps(seconds))
        return
    if part == "compilation":
        print(*compilation_table(), sep="\n")
        return
    if part == "page":
        print(*starmap(format_line, time_page()), sep="\n")
        return
    print(f"{'':68}{'µs per unit':>14}   remark")
    tables = time_waves(), time_long_layouts_and_batches(), time_environments()
    for line in chain(*tables, starmap(format_line, time_page())):
        print(line, flush=True)
    with tempfile.TemporaryDirectory() as cache:
        compiling, loading = (
            json.loads(output_of_new_process("first-calls", cache)) for _ in range(2)
        )
    with tempfile.TemporaryDirectory() as cache:
        print(f"\n{output_of_new_process('compilation', cache)}", end="")
    print(f"\n{'first call':30}{'compiling [s]':>14}{'loading [s]':>14}")
    for name in compiling:
        print(f"{name:30}{compiling[name]:14.2f}{loading[name]:14.2f}")
    print(f"{'sum':30}{sum(compiling.values()):14.2f}{sum(loading.values()):14.2f}")


if __name__ == "__main__":
    main()
