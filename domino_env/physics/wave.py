"""Waves: `simulate`, `simulate_batch`, and the outcomes of waves."""

from __future__ import annotations

import enum
import time
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

import numpy as np
from msgspec.structs import astuple
from numpy.typing import ArrayLike, NDArray

from domino_env.core.checks import numbers, require, require_choice, require_type
from domino_env.core.lazy import Lazy
from domino_env.core.results import draw
from domino_env.core.threads import share_pieces
from domino_env.core.types import Floats, Ints, ReadOnlyArrays, read_only
from domino_env.kernels import arrays as kernel_arrays
from domino_env.kernels.adjoint.chain import vjp, vjp_batch
from domino_env.kernels.adjoint.contact import PHYSICS_BAR
from domino_env.kernels.chain import solve_batch
from domino_env.physics import footing
from domino_env.physics.gradient import Gradient, arrays_from, with_length_gradient
from domino_env.physics.layout import Layout, require_sizes
from domino_env.physics.physics import STANDARD, Physics, require_arguments, require_physics
from domino_env.physics.standard import DENSITY, HEIGHT

MIN_RTOL, MAX_RTOL = 1e-13, 1e-3
_NO_TAPE = np.empty(0, kernel_arrays.EVENT)


class Outcome(enum.IntEnum):
    """Reason why a wave ended."""

    PROPAGATED = kernel_arrays.PROPAGATED
    STALLED = kernel_arrays.STALLED
    OUT_OF_REACH = kernel_arrays.OUT_OF_REACH
    JAMMED = kernel_arrays.JAMMED
    NO_RIGID_ANSWER = kernel_arrays.NO_RIGID_ANSWER

    def __str__(self) -> str:
        return self.name

    @property
    def explanation(self) -> str:
        """Meaning of the outcome and the next action, in a sentence."""
        return _EXPLANATIONS[self]

    @property
    def label(self) -> str:
        """Name in lower case, such as "out of reach"."""
        return self.name.lower().replace("_", " ")


_EXPLANATIONS = {
    Outcome.PROPAGATED: "the wave completed: the last domino passed its tipping angle",
    Outcome.STALLED: "the wave stalled: the leading domino stopped before it reached the next; "
    "push harder, or use wider gaps or thinner dominoes near where it stopped",
    Outcome.OUT_OF_REACH: "a gap is out of reach: it is not smaller than the height of the domino "
    "before it; bring the next domino closer",
    Outcome.JAMMED: "the chain jammed: friction is too high for the stack to pass the push on; use "
    "less friction, thinner dominoes or narrower gaps there",
    Outcome.NO_RIGID_ANSWER: "rigid bodies have no answer here (Painlevé's paradox: the effective "
    "inertia is not positive); use less friction or thinner dominoes there",
}


class Results(ReadOnlyArrays):
    """Results of a wave, or of B waves with a leading B.

    Attributes
    ----------
    summary
        Results of a whole wave, a `kernels.arrays.Summary`, which the properties show.
    arrivals
        Records for each domino, likewise.
    """

    summary: Any
    arrivals: NDArray[np.record]

    outcome = property(attrgetter("summary.outcome"))
    hit = property(attrgetter("summary.hit"))
    toppled = property(attrgetter("summary.toppled"))
    reach = property(attrgetter("summary.reach"))
    total_time = property(attrgetter("summary.total_time"))
    error_estimate = property(attrgetter("summary.estimate"))
    flushes = property(attrgetter("summary.flushes"))
    releases = property(attrgetter("summary.releases"))
    largest_flush_loss = property(attrgetter("summary.flush_loss"))
    lowest_stall_margin = property(attrgetter("summary.lowest_margin"))
    arrival_times = property(lambda self: self.arrivals["time"])
    release_velocity = property(lambda self: self.arrivals["release"])
    impact_velocity = property(lambda self: self.arrivals["impact"][..., :-1])
    stall_margin = property(lambda self: self.arrivals["margin"])
    converged = property(lambda self: self.error_estimate <= self.rtol)
    propagated = property(lambda self: self.summary.outcome == kernel_arrays.PROPAGATED)


@dataclass(frozen=True, eq=False)
class Wave(Results, Lazy):
    """Wave of a layout: arrival times, velocities and outcome.

    Waves are equal if layouts, physics, tolerances and reaches are equal.

    Attributes
    ----------
    layout, physics
        Layout and physics that were simulated.
    rtol
        Relative error allowed in the arrival times.
    outcome
        Reason why the wave ended; `explanation` is a sentence about it, with the place.
    propagated
        True if the wave completed.
    hit
        Number of dominoes struck. The first counts, and so does one that is struck but not moved.
    toppled
        Number of dominoes that passed their tipping angle; all of them if the wave propagated.
    arrival_times
        (N,) times at which each domino is first moved [s]: 0 for the first, inf where not reached.
    total_time
        Arrival time at the last domino [s]; inf for a wave that did not propagate.
    release_velocity
        (N,) angular velocity just after being hit [rad/s], the push for domino 0; nan where not
        reached.
    impact_velocity
        (N-1,) angular velocity just before hitting the next [rad/s]; nan where it did not.
    stall_margin
        (N,) lowest u = ω² of each leader over its value just after the hit: 0 where the wave
        stalled, nan where not reached.
    lowest_stall_margin
        Smallest stall margin of all leaders.
    reach
        Part of the chain that the wave passed: the number of intervals between hits, with the
        fraction of the last one, over N; 1 if it propagated.
    error_estimate
        Estimate of the largest |error|/t_k over the arrival times t_k; inf where errors or rounding
        decide whether a leader stalls.
    converged
        True if the estimate is at most `rtol`; near a stall, rounding may prevent it. Then the
        outcome is certain too.
    flushes
        Number of contacts whose faces met in a face impact, after which they are corner contacts.
    releases
        Number of separations.
    largest_flush_loss
        Largest fraction of the leader's speed lost in one face impact.
    run_time
        Time of the computation [s].
    summary, arrivals
        Results of the whole wave and of its dominoes, which these attributes show.
    tape
        Saved states for `pullback`; None if simulated without `gradient=True`.
    """

    layout: Layout
    physics: Physics
    rtol: float
    summary: kernel_arrays.Summary
    arrivals: NDArray[np.record]
    run_time: float
    tape: NDArray[np.record] | None = field(default=None, repr=False)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Wave):
            return NotImplemented
        # a simulation repeats bit by bit; the reach of an episode may be that in a longer row
        names = "layout", "physics", "rtol", "reach"
        return all(getattr(self, name) == getattr(other, name) for name in names)

    def __hash__(self) -> int:
        return hash((self.layout, self.physics, self.rtol))

    @property
    def outcome(self) -> Outcome:
        """Reason why the wave ended."""
        return Outcome(self.summary.outcome)

    def __repr__(self) -> str:
        count = self.layout.count
        if self.mean_speed > 0.0:
            end = self.arrival_times[-1]
            result = f"{count} dominoes in {end:.6g} s, {self.mean_speed:.6g} m/s"
        else:
            result = f"{self.hit} of {count} dominoes were hit, {self.toppled} toppled"
        return f"Wave({self.outcome.label}: {result})"

    def _repr_png_(self) -> Any:
        # False: not a figure of pyplot
        return draw("wave", self, None, False)._repr_png_()

    def plot(self, ax: Any = None) -> Any:
        """Draw the layout to scale, and gaps and speed along it.

        Parameters
        ----------
        ax
            Matplotlib axes in which only the local speed is drawn; None for a new figure.

        Returns
        -------
        matplotlib.figure.Figure
            The figure; notebooks show it, and `pyplot.show` does if pyplot is imported.
        """
        return draw("wave", self, ax)

    def pullback(self, arrival_bar: ArrayLike) -> Gradient:
        """Compute the gradient of Σ_k arrival_bar[k] t_k with respect to layout and physics.

        One pass of reverse mode takes a time proportional to N. The gradient is exact up to the
        tolerance of the simulation, near a stall too.

        Parameters
        ----------
        arrival_bar
            (N,) derivatives of some number with respect to the arrival times.

        Returns
        -------
        Gradient
            Gradient of that number.

        Raises
        ------
        ValueError
            For a wave simulated without `gradient=True`, for a wrong shape, for numbers that are
            not finite, and if arrival_bar is not 0 for a domino that the wave did not reach.
        """
        # a leading domino beyond the layout would be read beyond the end of its arrays
        if self.tape is None or self.tape["leader"].max(initial=0) >= self.layout.count:
            raise ValueError(
                "this wave has no saved states of its layout to differentiate: simulate it with "
                "simulate(layout, physics, gradient=True)"
            )
        shape = (self.layout.count,)
        meaning = "a number for each domino"
        bar = numbers("arrival_bar", arrival_bar, shape=shape, meaning=meaning, finite=True)
        unreached = np.flatnonzero((bar != 0.0) & ~np.isfinite(self.arrival_times))
        if len(unreached):
            k = int(unreached[0])
            raise ValueError(
                f"arrival_bar[{k}] = {bar[k]}, but the wave did not reach domino {k}: leave it at 0"
            )
        arrays, physics_bars = arrays_from(self.layout), np.zeros(1, PHYSICS_BAR)
        setting, bars = checked_setting(self.physics, self.rtol), _empty_bars(arrays)
        # a copy can be written, as the kernel is compiled for the tape of a batch
        vjp(arrays, setting, self.tape.copy(), bar, bars, physics_bars)
        derivatives: list[Any] = [*bars[:4], *physics_bars[0].item(), *bars[4:]]
        return Gradient(*derivatives)

    def gradient(self, quantity: str = "time") -> Gradient:
        """Return the gradient of the last arrival time or of the mean speed.

        Parameters
        ----------
        quantity
            "time" for the arrival time at the last domino [s], "speed" for the mean speed [m/s].

        Returns
        -------
        Gradient
            Gradient with respect to layout and physics.

        Raises
        ------
        ValueError
            For another quantity, if the wave does not reach the last domino (for the speed: does
            not propagate), and as for `pullback`.
        """
        require_choice("quantity", quantity, ("time", "speed"))
        count, total = self.layout.count, float(self.arrival_times[-1])
        exists = np.isfinite(total) if quantity == "time" else self.outcome == Outcome.PROPAGATED
        if count < 2 or not exists:
            reason = "a single domino has none" if count < 2 else self.explanation
            raise ValueError(f"there is no {quantity} to differentiate: {reason}")
        bar = np.zeros(count)
        bar[-1] = 1.0 if quantity == "time" else -self.mean_speed / total
        gradient = self.pullback(bar)
        if quantity == "time":
            return gradient
        return with_length_gradient(gradient, self.layout, 1.0 / total)

    def as_batch(self) -> WaveBatch:
        """Return the wave as a batch of one, without gradient."""
        summary = kernel_arrays.Summary._make(np.array([number]) for number in self.summary)
        results = summary, self.arrivals[None], np.array([self.mean_speed]), self.run_time
        return WaveBatch(_batch_of_one(self.layout), self.physics, self.rtol, *results)

    @property
    def mean_speed(self) -> float:
        """Length of the layout over the last arrival time [m/s]; 0 for a wave that stops."""
        if self.outcome != Outcome.PROPAGATED or len(self.arrival_times) < 2:
            return 0.0
        return float(self.layout.length / self.arrival_times[-1])

    @property
    def local_speed(self) -> Floats:
        """Pitches over the times between hits (N-1,) [m/s]; nan where not reached."""
        times = np.where(np.isfinite(self.arrival_times), self.arrival_times, np.nan)
        return read_only(self.layout.pitch / np.diff(times))

    @property
    def explanation(self) -> str:
        """Reason why the wave ended, the place and the next action, in a sentence."""
        hint = f"; {self.layout.unit_hint}" if self.layout.unit_hint else ""
        if self.outcome == Outcome.PROPAGATED:
            return f"{self.outcome.explanation}{hint}."
        leader = int(np.isfinite(self.stall_margin).sum()) - 1
        reason = self.outcome.explanation
        if self.outcome == Outcome.STALLED and leader == 0:
            reason = (
                f"the wave stalled: the push of {self.physics.push:g} rad/s is too small, the "
                "first domino falls back; push harder (smallest_push computes how hard)"
            )
        return (
            f"{reason} (leading domino {leader}; {self.hit} of "
            f"{len(self.arrival_times)} were hit, {self.toppled} toppled){hint}."
        )


@dataclass(frozen=True, eq=False)
class WaveBatch(Results):
    """Waves of B layouts of N dominoes each; `batch[b]` is a `Wave`.

    It has the attributes of `Wave` but layout and tape, with a leading B, and those below.
    With `record=False` or a gradient the attributes per domino, such as `arrival_times`, are empty.

    Attributes
    ----------
    arrays
        Arrays of the layouts for the kernels.
    physics, rtol
        Physics and relative error of all waves.
    outcome
        (B,) values of `Outcome`.
    mean_speed
        (B,) mean speeds, as for `Wave` [m/s].
    lowest_stall_margin
        (B,) smallest stall margins of all leaders; without attributes per domino, u = ω² is
        compared at the nodes of the quadrature only.
    run_time
        Time of the computation of all waves [s].
    gradient
        Gradient of the total time, 0 for a wave that did not propagate; None if not requested.
    """

    arrays: kernel_arrays.Arrays
    physics: Physics
    rtol: float
    summary: Any
    arrivals: NDArray[np.record]
    mean_speed: Floats
    run_time: float
    gradient: Gradient | None = None

    @property
    def count(self) -> int:
        """Number of dominoes N."""
        return int(self.arrays.thickness.shape[1])

    @property
    def falls(self) -> Ints:
        """(B,) numbers of simulated intervals between hits.

        N for a wave that completes, as the last domino falls too.
        """
        return np.asarray(np.ceil(self.reach * self.count), np.int64)

    def pullback(self, arrival_bar: Floats) -> Gradient:
        """Return the gradient of Σ_k arrival_bar[b, k] t_k of every layout b.

        The layouts are simulated again.

        Parameters
        ----------
        arrival_bar
            (B, N) derivatives of B numbers with respect to the arrival times of their layouts.

        Returns
        -------
        Gradient
            Arrays with a leading B, 0 for a wave that did not propagate.

        Raises
        ------
        ValueError
            For another shape than (B, N), or a number that is not finite.
        """
        setting, shape = checked_setting(self.physics, self.rtol), self.arrays.thickness.shape
        bars = numbers("arrival_bar", arrival_bar, True, shape, "that of the thicknesses", True)
        # those of an unpickled batch can be written
        arrays = kernel_arrays.Arrays(*(read_only(a) for a in self.arrays if a is not None))
        return _pullback_batch(arrays, setting, bars, np.empty(len(self), kernel_arrays.SUMMARY))

    def wave(self, b: int, layout: Layout | None = None) -> Wave:
        """Return one wave as `simulate` returns it.

        Parameters
        ----------
        b
            Index in the batch.
        layout
            The layout that was simulated; None to make it from the arrays.

        Returns
        -------
        Wave
            Wave without saved states.

        Raises
        ------
        IndexError
            For an index out of the batch.
        ValueError
            For a batch without fields per domino, and a layout with another number of dominoes.
        TypeError
            For an index that is not a whole number, and anything but a layout.
        """
        require_type("b", b, int | np.integer, "the index of a wave")
        if not -len(self) <= b < len(self):
            raise IndexError(f"b = {b}: give an index less than {len(self)}, the number of waves")
        if not self.arrivals.shape[1]:
            raise ValueError("no fields per domino: simulate with record=True, without gradient")
        if layout is None:
            parts = self.arrays._asdict().items()  # those that all layouts share have length 1
            layout = Layout(**{name: a[b % len(a)] for name, a in parts if a is not None})
        require_arguments(layout, self.physics)
        numbers("layout.thickness", layout.thickness, None, self.arrivals.shape[1:])
        summary = kernel_arrays.Summary._make(column[b].item() for column in self.summary)
        arrivals, seconds = self.arrivals[b].copy(), self.run_time / len(self)
        arrivals.flags.writeable = False
        return Wave(layout, self.physics, self.rtol, summary, arrivals, seconds)

    def __getitem__(self, b: int) -> Wave:
        return self.wave(b)

    def __len__(self) -> int:
        return len(self.mean_speed)

    def __repr__(self) -> str:
        counts = [(int(np.sum(self.outcome == kind)), kind.label) for kind in Outcome]
        text = ", ".join(f"{number} {label}" for number, label in counts if number)
        speeds = self.mean_speed[self.mean_speed > 0.0]
        if len(speeds):
            text += f"; {speeds.min():.6g} to {speeds.max():.6g} m/s"
        return f"WaveBatch({len(self)} waves: {text or 'none'})"


def require_wave(name: str, wave: object) -> None:
    """Raise a TypeError for anything but a Wave."""
    require_type(name, wave, Wave, "a Wave, such as simulate(layout, physics)")


def simulate(
    layout: Layout, physics: Physics = STANDARD, *, rtol: float = 1e-8, gradient: bool = False
) -> Wave:
    """Simulate the wave of a layout.

    Parameters
    ----------
    layout
        The layout.
    physics
        Friction, gravity and push; by default those of `Physics()`.
    rtol
        Relative error allowed in the arrival times, 1e-13 to 1e-3.
    gradient
        True to save the states that `Wave.pullback` and `Wave.gradient` need, some 200 bytes per
        interval between hits.

    Returns
    -------
    Wave
        The wave, also if it stops; see `Wave.outcome`.

    Raises
    ------
    ValueError
        For a tolerance out of its range.
    TypeError
        For a layout or physics of another type.

    Notes
    -----
    The dynamics are exact up to the tolerance, for chains in which every domino may differ. They
    have tip and corner contacts, separations, inelastic face impacts, and sliding friction.

    References
    ----------
    J. M. J. van Leeuwen, The domino effect (2004), arXiv physics/0401018;
    Chapman, The physics of toppling dominoes, eqs. 1-9.

    Examples
    --------
    >>> wave = simulate(Layout.uniform(100, pitch=0.024))
    >>> wave.outcome.name, round(wave.mean_speed, 3)
    ('PROPAGATED', 0.855)
    """
    began = time.perf_counter()
    require_arguments(layout, physics)
    arrays, setting, count = _batch_of_one(layout), checked_setting(physics, rtol), layout.count
    summaries = np.empty(1, kernel_arrays.SUMMARY)
    arrivals = np.empty((1, count), kernel_arrays.ARRIVAL)
    # usually long enough; otherwise the wave is simulated again with as many entries as events
    tape = np.empty(4 * count + 16, kernel_arrays.EVENT) if gradient else _NO_TAPE
    while True:
        solve_batch(0, 1, arrays, setting, True, summaries, arrivals, tape)
        summary = kernel_arrays.Summary._make(summaries.item())
        if summary.event_count <= len(tape) or not gradient:
            break
        tape = np.empty(summary.event_count, kernel_arrays.EVENT)
    # bytes cannot be written
    saved = np.frombuffer(tape[: summary.event_count].tobytes(), tape.dtype) if gradient else None
    arrivals.flags.writeable = False
    run_time = time.perf_counter() - began
    return Wave(layout, physics, rtol, summary, arrivals[0], run_time, saved)


def _batch_of_one(layout: Layout) -> kernel_arrays.Arrays:
    """Return the arrays of a layout for the kernels, as a batch of one."""
    ground = () if layout.is_flat else (layout.rise[None], layout.tilt[None])
    sizes = layout.spacing[None], layout.thickness[None], layout.height[None], layout.density[None]
    return kernel_arrays.Arrays(*sizes, *ground)


def simulate_batch(
    spacing: ArrayLike,
    thickness: ArrayLike,
    physics: Physics = STANDARD,
    *,
    height: ArrayLike = HEIGHT,
    density: ArrayLike = DENSITY,
    rise: ArrayLike = 0.0,
    tilt: ArrayLike = 0.0,
    rtol: float = 1e-6,
    record: bool = True,
    gradient: bool = False,
) -> WaveBatch:
    """Simulate B layouts of N dominoes on all cores, bitwise as `simulate` at an equal `rtol`.

    Parameters
    ----------
    spacing
        (B, N-1) free gaps [m].
    thickness
        Scalar, (N,) or (B, N) [m].
    physics
        Friction, gravity and push of all; by default those of `Physics()`.
    height
        Scalar, (N,) or (B, N) [m].
    density
        Scalar, (N,) or (B, N) [kg/m³].
    rise
        Scalar, (N-1,) or (B, N-1), as for `Layout` [m].
    tilt
        Scalar, (N,) or (B, N), as for `Layout` [rad].
    rtol
        As for `simulate`, by default 1e-6.
    record
        True to keep the fields per domino.
    gradient
        True to compute the gradient of the total time, `WaveBatch.gradient`; fields per domino
        are then not kept.

    Returns
    -------
    WaveBatch
        The waves.

    Raises
    ------
    TypeError
        For physics of another type.
    ValueError
        For wrong shapes, values or a tolerance out of range, and dominoes that cannot stand, with
        the indices of layout and domino.

    Notes
    -----
    The number of threads is Numba's (`numba.set_num_threads`).
    """
    began = time.perf_counter()
    require_physics(physics)
    arrays = _check_batch(spacing, thickness, height, density, rise, tilt)
    (number, count), setting = arrays.thickness.shape, checked_setting(physics, rtol)
    record, time_gradient = bool(record) and not gradient, None
    summaries = np.empty(number, kernel_arrays.SUMMARY)
    arrivals = np.empty((number, count if record else 0), kernel_arrays.ARRIVAL)
    inputs = number, count, arrays, setting
    if gradient:
        time_gradient = _pullback_batch(arrays, setting, np.eye(1, count, count - 1), summaries)
    else:
        share_pieces(solve_batch, *inputs, record, summaries, arrivals, _NO_TAPE)
    summaries.flags.writeable = arrivals.flags.writeable = False
    summary = columns_of(summaries)
    speed, run_time = _mean_speeds(arrays, summary.total_time), time.perf_counter() - began
    return WaveBatch(arrays, physics, rtol, summary, arrivals, speed, run_time, time_gradient)


def columns_of(summaries: NDArray[np.record]) -> Any:
    """Return the fields of summaries (B,) as a Summary of arrays (B,)."""
    return kernel_arrays.Summary._make(summaries[name] for name in kernel_arrays.Summary._fields)


def _mean_speeds(arrays: kernel_arrays.Arrays, total_time: Floats) -> Floats:
    """Return the mean speeds (B,) of waves [m/s]."""
    pitches = footing.pitches(arrays.spacing, arrays.thickness, arrays.rise, arrays.tilt)
    # summed as Layout.length is, so that speeds agree to the last bit
    length = np.cumsum(pitches, axis=1)[:, -1] if pitches.shape[1] else np.zeros(len(pitches))
    # 1e-300: no division by zero where the mask excludes the quotient
    has_speed = np.isfinite(total_time) & (total_time > 0.0)
    return read_only(np.where(has_speed, length / np.maximum(total_time, 1e-300), 0.0))


def _pullback_batch(
    arrays: kernel_arrays.Arrays,
    setting: tuple[float, ...],
    arrival_bar: Floats,
    summaries: NDArray[np.record],
) -> Gradient:
    """Simulate layouts, write their summaries, and return the gradient of arrival times."""
    bars, physics_bars = _empty_bars(arrays), np.zeros(len(summaries), PHYSICS_BAR)
    inputs = *arrays.thickness.shape, arrays, setting
    share_pieces(vjp_batch, *inputs, arrival_bar, summaries, bars, physics_bars)
    physics = {name: physics_bars[name] for name in PHYSICS_BAR.names or ()}
    return Gradient(**bars._asdict(), **physics)


def _empty_bars(arrays: kernel_arrays.Arrays) -> kernel_arrays.Arrays:
    """Return empty arrays for the derivatives with respect to the arrays of a layout or a batch."""
    empty: list[Any] = [None if array is None else np.empty(array.shape) for array in arrays]
    return kernel_arrays.Arrays(*empty)


def setting_from(physics: Physics, rtol: float) -> tuple[float, ...]:
    """Return the members of `kernels.arrays.Setting`, which begin with those of `Physics`."""
    return *astuple(physics), float(rtol)


def checked_setting(physics: Physics, rtol: float) -> tuple[float, ...]:
    """Return the setting for the kernels; check the tolerance."""
    if not (type(rtol) is float and MIN_RTOL <= rtol <= MAX_RTOL):  # `require` takes 1 µs
        require("rtol", rtol, MIN_RTOL, MAX_RTOL)
    return setting_from(physics, rtol)


def _check_batch(
    spacing: ArrayLike,
    thickness: ArrayLike,
    height: ArrayLike,
    density: ArrayLike,
    rise: ArrayLike,
    tilt: ArrayLike,
) -> kernel_arrays.Arrays:
    """Return the arrays of a batch for the kernels; raise for dominoes that cannot stand."""
    meaning = "one layout per index b; for a single layout use simulate()"
    gaps = numbers("spacing", spacing, None, ("B", "N-1"), meaning)
    number, count = gaps.shape[0], gaps.shape[1] + 1

    def full(name: str, values: ArrayLike, size: int) -> Floats:
        """Return an array (1, size) or (B, size) from a scalar, (size,) or (B, size)."""
        array = np.atleast_2d(numbers(name, values, None))
        if len(array) in (1, number) and array.shape[1:] in ((1,), (size,)):
            return np.broadcast_to(array, (len(array), size))
        raise ValueError(
            f"{name} has shape {np.shape(values)}: give a number, ({size},) or ({number}, {size}), "
            f"as spacing has shape {gaps.shape}"
        )

    thicknesses = np.broadcast_to(full("thickness", thickness, count), (number, count))
    heights, densities = full("height", height, count), full("density", density, count)
    parts = [gaps, thicknesses, heights, densities]
    require_sizes(dict(zip(("spacing", "thickness", "height", "density"), parts, strict=True)))
    rise, tilt = numbers("rise", rise, None), numbers("tilt", tilt, None)
    if rise.any() or tilt.any():
        parts.append(np.broadcast_to(full("rise", rise, count - 1), gaps.shape))
        parts.append(np.broadcast_to(full("tilt", tilt, count), thicknesses.shape))
    if violation := footing.find_violation(gaps, thicknesses, heights, *parts[4:]):
        (layout, *_), sentence = violation
        raise ValueError(f"layout {layout}: {sentence}")
    return kernel_arrays.Arrays(*(read_only(np.array(part, order="C")) for part in parts))
