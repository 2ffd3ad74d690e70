"""The wave that runs through a row: `simulate`, `simulate_batch`, and why a wave ended."""

from __future__ import annotations

import enum
import time
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env import kernels
from domino_env.core.checks import require
from domino_env.core.results import draw
from domino_env.core.threads import share_pieces
from domino_env.physics import footing
from domino_env.physics.gradient import (
    Gradient,
    Tape,
    adjoint_arrays,
    batch_arrays_of,
    gradient_of,
    pullback,
    with_length_gradient,
)
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics, require_arguments

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LOOSEST, TIGHTEST = 1e-3, 1e-13
_UNTAPED = np.empty(0, kernels.EVENT)


class Outcome(enum.IntEnum):
    """Why a wave ended."""

    PROPAGATED = kernels.PROPAGATED
    STALLED = kernels.STALLED
    OUT_OF_REACH = kernels.OUT_OF_REACH
    JAMMED = kernels.JAMMED
    NO_RIGID_ANSWER = kernels.NO_RIGID_ANSWER

    def __str__(self) -> str:
        return self.name

    @property
    def explanation(self) -> str:
        """What it means and what to do next, in a sentence."""
        return _EXPLANATIONS[self]


_EXPLANATIONS = {
    Outcome.PROPAGATED: "the wave ran through: the last domino passed its tipping angle",
    Outcome.STALLED: "the wave stalled: the leading domino stopped before it reached the next; "
    "push harder, or use wider gaps or thinner dominoes near where it stopped",
    Outcome.OUT_OF_REACH: "a gap is out of reach: it is not smaller than the height of the domino "
    "before it; bring the next domino closer",
    Outcome.JAMMED: "the row jammed: friction is too high for the stack to pass the push on; use "
    "less friction, thinner dominoes or narrower gaps there",
    Outcome.NO_RIGID_ANSWER: "rigid bodies have no answer here (Painlevé's paradox: the effective "
    "inertia is not positive); use less friction or thinner dominoes there",
}


@dataclass(frozen=True, eq=False)
class Wave:
    """A toppling wave, event by event.

    Attributes
    ----------
    layout
        What stood.
    physics
        What made it fall.
    outcome
        Why the wave ended; `explanation` says it in a sentence, with the place.
    hit
        Dominoes struck; the first counts, so does one struck in vain.
    toppled
        Dominoes that passed their tipping angle; all of them if the wave propagated.
    arrival_times
        (N,) when each domino is first moved [s]: 0 for the first, inf where the wave did not come.
    release_velocity
        (N,) angular velocity just after being hit [rad/s], the push for domino 0; nan where not
        reached.
    impact_velocity
        (N-1,) angular velocity just before hitting the next [rad/s]; nan where it did not.
    stall_margin
        (N,) for each fall the lowest u = ω² of the leader over its value at release: 0 where the
        wave stalled, nan where it did not come.
    reach
        How far the wave came, falls done and the part of the last one over N; 1 if it propagated.
    error_estimate
        Largest |error|/t_k over the arrival times t_k, as estimated by the run itself.
    converged
        False where the conditioning of the row keeps `rtol` out of reach; the estimate stays
        honest.
    flushes
        Links that turned from tip to corner contact.
    releases
        Links that lost contact.
    largest_flush_loss
        Largest part of the leader's speed lost in one flush.
    rtol
        The tolerance asked for.
    run_time
        Spent computing [s].
    tape
        What `pullback` walks back along, kept where a gradient was asked for.
    """

    layout: Layout
    physics: Physics
    outcome: Outcome
    hit: int
    toppled: int
    arrival_times: Floats
    release_velocity: Floats
    impact_velocity: Floats
    stall_margin: Floats
    reach: float
    error_estimate: float
    converged: bool
    flushes: int
    releases: int
    largest_flush_loss: float
    rtol: float
    run_time: float
    tape: NDArray[np.record] | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        count, ended = self.layout.count, _ended(self.outcome)
        if self.mean_speed > 0.0:
            how = f"{count} dominoes in {self.arrival_times[-1]:.6g} s, {self.mean_speed:.6g} m/s"
        else:
            how = f"{self.hit} of {count} dominoes were struck, {self.toppled} toppled"
        return f"Wave({ended}: {how})"

    def _repr_html_(self) -> str:
        html: str = draw("wave.html", self)
        return html

    def plot(self, ax: Any = None) -> Any:
        """Draw the layout to scale, and gaps and speed along it.

        Parameters
        ----------
        ax
            Matplotlib axes that get the local speed and nothing else; None for a new figure.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, which notebooks show, and `pyplot.show` where pyplot is imported.
        """
        return draw("wave", self, ax)

    def pullback(self, arrival_bar: ArrayLike) -> Gradient:
        """Return Σ_k arrival_bar[k] ∂t_k with respect to the layout and the physics.

        Reverse mode: one walk back through the chain, whatever N. Exact up to the tolerance of the
        run, near a stall too.

        Parameters
        ----------
        arrival_bar
            (N,) derivative of some number with respect to the arrival times; the result is the
            gradient of that number.

        Raises
        ------
        ValueError
            For a wave simulated without `gradient=True`, for a wrong shape, and where arrival_bar
            is not 0 for a domino that the wave did not reach.
        """
        if self.tape is None:
            raise ValueError(
                "this wave kept nothing to differentiate: ask for it with "
                "simulate(layout, physics, gradient=True)"
            )
        reached = int(np.isfinite(self.arrival_times).sum())
        return pullback(self.layout, self.physics, self.tape, arrival_bar, reached)

    def gradient(self, of: str = "time") -> Gradient:
        """Return the gradient of what the wave does at the last domino.

        Parameters
        ----------
        of
            "time" for the arrival time at the last domino [s], "speed" for the mean speed [m/s].

        Raises
        ------
        ValueError
            Where the wave does not reach the last domino (for the speed: did not propagate), and as
            of `pullback`.
        """
        if of not in ("time", "speed"):
            raise ValueError(f"of = {of!r}: a wave has the gradient of its 'time' or its 'speed'")
        count = self.layout.count
        total = float(self.arrival_times[-1])
        if count < 2 or not np.isfinite(total):
            raise ValueError(
                f"there is no {of} to differentiate: "
                + ("a single domino has none" if count < 2 else self.explanation)
            )
        bar = np.zeros(count)
        if of == "time":
            bar[-1] = 1.0
            return self.pullback(bar)
        if self.outcome != Outcome.PROPAGATED:
            raise ValueError(f"there is no speed to differentiate: {self.explanation}")
        bar[-1] = -self.mean_speed / total
        found = self.pullback(bar)
        return with_length_gradient(found, self.layout, 1.0 / total)

    @property
    def mean_speed(self) -> float:
        """First pivot to last, over the last arrival time [m/s]; 0 unless propagated."""
        if self.outcome != Outcome.PROPAGATED or len(self.arrival_times) < 2:
            return 0.0
        return float(self.layout.length / self.arrival_times[-1])

    @property
    def local_speed(self) -> Floats:
        """(N-1,) pitch over the time between hits [m/s]; nan where the wave did not come."""
        times = np.where(np.isfinite(self.arrival_times), self.arrival_times, np.nan)
        return np.asarray(self.layout.pitch / np.diff(times))

    @property
    def explanation(self) -> str:
        """Why the wave ended, where, and what to do next."""
        if self.outcome == Outcome.PROPAGATED:
            return f"{self.outcome.explanation}."
        leader = int(np.isfinite(self.stall_margin).sum()) - 1
        return (
            f"{self.outcome.explanation} (domino {leader} led; {self.hit} of "
            f"{len(self.arrival_times)} were struck, {self.toppled} toppled)."
        )


def _summary(name: str) -> Any:
    return property(lambda self: self.summaries[name])


def _arrival(name: str) -> Any:
    return property(lambda self: self.arrivals[name])


@dataclass(frozen=True, eq=False)
class WaveBatch:
    """The waves of B layouts of N dominoes each; `batch[b]` is a `Wave`, fields have a leading B.

    The fields of each domino, such as `arrival_times`, are empty, (B, 0), where `record=False` left
    them out. Besides the fields of `Wave`:

    Attributes
    ----------
    rows
        The layouts as the kernels take them.
    outcome
        (B,) values of `Outcome`.
    total_time
        (B,) arrival at the last domino [s]; inf where the wave did not come.
    lowest_stall_margin
        (B,) smallest stall margin of all falls; without a record it is taken over the nodes of the
        quadrature only.
    gradient
        Of the total time, every field with a leading B, zero for a wave that did not propagate;
        None unless asked for.
    """

    rows: kernels.Arrays
    physics: Physics
    rtol: float
    summaries: NDArray[np.record]
    arrivals: NDArray[np.record]
    run_time: float
    gradient: Gradient | None = None

    outcome = _summary("outcome")
    hit = _summary("hit")
    toppled = _summary("toppled")
    reach = _summary("reach")
    total_time = _summary("total_time")
    error_estimate = _summary("estimate")
    flushes = _summary("flushes")
    releases = _summary("releases")
    largest_flush_loss = _summary("flush_loss")
    lowest_stall_margin = _summary("lowest_margin")
    arrival_times = _arrival("time")
    release_velocity = _arrival("release")
    impact_velocity = property(lambda self: self.arrivals["impact"][:, :-1])
    stall_margin = _arrival("margin")
    converged = property(lambda self: self.error_estimate <= self.rtol)

    @cached_property
    def mean_speed(self) -> Floats:
        """(B,) as `Wave.mean_speed` [m/s]."""
        rows, total = self.rows, self.total_time
        # summed as Layout.length sums it, so that speeds agree to the last bit
        if rows.rise is None or rows.tilt is None:
            pitches = rows.spacing + rows.thickness[:, 1:]
        else:
            pitches = footing.pitches(rows.spacing, rows.thickness, rows.rise, rows.tilt)
        way = np.cumsum(pitches, axis=1)[:, -1] if pitches.shape[1] else np.zeros(len(self))
        return np.where(np.isfinite(total) & (total > 0.0), way / np.maximum(total, 1e-300), 0.0)

    def wave(self, b: int, layout: Layout | None = None) -> Wave:
        """Return wave b as `simulate` gives it.

        Parameters
        ----------
        b
            Which.
        layout
            The layout that was simulated, if it is at hand.

        Raises
        ------
        ValueError
            Where `record=False` left out what is kept of each domino.
        """
        if not self.arrivals.shape[1]:
            raise ValueError("this batch kept nothing of each domino: simulate it with record=True")
        if layout is None:
            parts = self.rows._asdict().items()
            layout = Layout(**{name: a[b % len(a)] for name, a in parts if a is not None})
        share = self.run_time / len(self)
        summary = kernels.Summary._make(self.summaries.item(b))
        return _wave(layout, self.physics, self.rtol, summary, self.arrivals[b].copy(), share)

    def __getitem__(self, b: int) -> Wave:
        return self.wave(b)

    def __len__(self) -> int:
        return len(self.summaries)

    def __repr__(self) -> str:
        ends = [(int(np.sum(self.outcome == kind)), _ended(kind)) for kind in Outcome]
        said = ", ".join(f"{number} {ended}" for number, ended in ends if number)
        through = self.mean_speed[self.mean_speed > 0.0]
        if len(through):
            said += f"; {through.min():.6g} to {through.max():.6g} m/s"
        return f"WaveBatch({len(self)} waves: {said or 'none'})"


def simulate(
    layout: Layout, physics: Physics, *, rtol: float = 1e-8, gradient: bool = False
) -> Wave:
    """Topple a row and return its wave.

    Parameters
    ----------
    layout
        What stands.
    physics
        What makes it fall.
    rtol
        Relative error allowed in the arrival times, 1e-3 to 1e-13.
    gradient
        Keep what `Wave.pullback` and `Wave.gradient` need, some 100 bytes a fall.

    Returns
    -------
    Wave
        Also of a row that stops falling: a wave that dies is a result, see `Wave.outcome`.

    Raises
    ------
    ValueError
        For a tolerance out of its range.
    TypeError
        For what is no Layout or no Physics.

    Notes
    -----
    The dynamics are exact up to the tolerance for chains in which every domino may differ: tip,
    corner and released contacts, flushes as inelastic impacts, sliding friction.

    References
    ----------
    J. M. J. van Leeuwen, The domino effect (2004), arXiv physics/0401018;
    Chapman, The physics of toppling dominoes, eqs. 1-9.

    Examples
    --------
    >>> import domino_env as de
    >>> layout = de.Layout.uniform(100, pitch=0.024, thickness=0.0075)
    >>> wave = de.simulate(layout, de.Physics(friction=0.25, push=15.7))
    >>> wave.outcome.name, round(wave.mean_speed, 3)
    ('PROPAGATED', 0.875)
    """
    began = time.perf_counter()
    require_arguments(layout, physics)
    rows, setting, count = batch_arrays_of(layout), _setting(physics, rtol), layout.count
    summaries, arrivals = np.empty(1, kernels.SUMMARY), np.empty((1, count), kernels.ARRIVAL)
    tape = np.empty(4 * count + 16, kernels.EVENT) if gradient else _UNTAPED
    while True:
        kernels.solve_batch(0, 1, rows, *setting, True, summaries, arrivals, tape)
        summary = kernels.Summary._make(summaries.item())
        if summary.taped <= len(tape) or not gradient:
            break
        tape = np.empty(summary.taped, kernels.EVENT)  # the same run writes as many again
    kept = tape[: summary.taped].copy() if gradient else None
    run_time = time.perf_counter() - began
    return _wave(layout, physics, rtol, summary, arrivals[0], run_time, kept)


def simulate_batch(
    spacing: ArrayLike,
    thickness: ArrayLike,
    physics: Physics,
    *,
    height: ArrayLike = 0.048,
    density: ArrayLike = 1040.0,
    rise: ArrayLike = 0.0,
    tilt: ArrayLike = 0.0,
    rtol: float = 1e-6,
    record: bool = True,
    gradient: bool = False,
) -> WaveBatch:
    """Topple B rows of N dominoes over all cores; bit for bit what `simulate` gives one by one.

    Parameters
    ----------
    spacing
        (B, N-1) [m]
    thickness
        (N,) or (B, N) [m]
    physics
        What makes all of them fall.
    height
        Scalar, (N,) or (B, N) [m].
    density
        Scalar, (N,) or (B, N) [kg/m³].
    rise
        Scalar, (N-1,) or (B, N-1), as of `Layout` [m].
    tilt
        Scalar, (N,) or (B, N), as of `Layout` [rad].
    rtol
        As of `simulate`.
    record
        False leaves out what is kept of each domino.
    gradient
        Give that of the total time too, as `WaveBatch.gradient`; nothing is then kept of each
        domino.

    Raises
    ------
    ValueError
        For what cannot stand, naming the layout and the element; for a tolerance out of its range.

    Notes
    -----
    The number of threads is Numba's (`numba.set_num_threads`).

    Examples
    --------
    >>> import domino_env as de
    >>> de.simulate_batch([[0.01] * 9, [0.02] * 9], 0.0075, de.Physics()).mean_speed.round(3)
    array([0.496, 0.635])
    """
    began = time.perf_counter()
    rows = _checked_batch(spacing, thickness, height, density, rise, tilt)
    (number, count), setting = rows.thickness.shape, _setting(physics, rtol)
    record = record and not gradient
    summaries = np.empty(number, kernels.SUMMARY)
    arrivals = np.empty((number, count if record else 0), kernels.ARRIVAL)
    slopes = None
    if gradient:
        bars, wholes = adjoint_arrays(rows), np.empty(number, kernels.PHYSICS_BAR)
        share_pieces(kernels.vjp_batch, number, count, rows, *setting, summaries, bars, wholes)
        slopes = gradient_of(bars, wholes["friction"], wholes["gravity"], wholes["push"])
    else:
        share_pieces(
            kernels.solve_batch,
            number,
            count,
            rows,
            *setting,
            record,
            summaries,
            arrivals,
            _UNTAPED,
        )
    return WaveBatch(rows, physics, rtol, summaries, arrivals, time.perf_counter() - began, slopes)


def _wave(
    layout: Layout,
    physics: Physics,
    rtol: float,
    told: kernels.Summary,
    arrival: NDArray[np.record],
    run_time: float,
    tape: Tape | None = None,
) -> Wave:
    """Make a wave of what the kernels have written."""
    return Wave(
        layout=layout,
        physics=physics,
        outcome=Outcome(told.outcome),
        hit=told.hit,
        toppled=told.toppled,
        arrival_times=arrival["time"],
        release_velocity=arrival["release"],
        impact_velocity=arrival["impact"][:-1],
        stall_margin=arrival["margin"],
        reach=told.reach,
        error_estimate=told.estimate,
        converged=told.estimate <= rtol,
        flushes=told.flushes,
        releases=told.releases,
        largest_flush_loss=told.flush_loss,
        rtol=rtol,
        run_time=run_time,
        tape=tape,
    )


def _ended(outcome: Outcome) -> str:
    return outcome.name.lower().replace("_", " ")


def _setting(physics: Physics, rtol: float) -> tuple[float, float, float, float]:
    """What the kernels take besides rows."""
    if not (type(rtol) is float and TIGHTEST <= rtol <= LOOSEST):  # a call of `require` is 1 µs
        require("rtol", rtol, TIGHTEST, LOOSEST)
    return physics.friction, physics.gravity, physics.push, float(rtol)


def _checked_batch(
    spacing: ArrayLike,
    thickness: ArrayLike,
    height: ArrayLike,
    density: ArrayLike,
    rise: ArrayLike,
    tilt: ArrayLike,
) -> kernels.Arrays:
    """The arrays of a batch as the kernels take them; all that cannot stand is refused."""
    s = np.asarray(spacing, dtype=np.float64)
    if s.ndim != 2:
        raise ValueError(
            f"spacing has shape {s.shape}: give one row a layout, (B, N-1); for one layout use "
            "simulate()"
        )
    rows, count = s.shape[0], s.shape[1] + 1
    d = np.broadcast_to(_rows("thickness", thickness, rows, count), (rows, count))
    length, rho = _rows("height", height, rows, count), _rows("density", density, rows, count)
    for name, values in (("spacing", s), ("thickness", d), ("height", length), ("density", rho)):
        require(name, values, above=0.0, unit="kg/m³" if name == "density" else "m")
    arrays = [s, d, length, rho]
    if np.any(rise) or np.any(tilt):
        arrays.append(np.broadcast_to(_rows("rise", rise, rows, count - 1), s.shape))
        arrays.append(np.broadcast_to(_rows("tilt", tilt, rows, count), d.shape))
    if found := footing.find_violation(s, d, length, *arrays[4:]):
        raise ValueError(f"layout {found[0][0]}: {found[1]}")
    return kernels.Arrays(*(_read_only(array) for array in arrays))


def _read_only(array: Floats) -> Floats:
    """A copy like the arrays of a Layout, for which the kernel is compiled."""
    copy = np.array(array, order="C")
    copy.flags.writeable = False
    return copy


def _rows(name: str, values: ArrayLike, rows: int, count: int) -> Floats:
    """(1, N) or (B, N) from a scalar, (N,) or (B, N)."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 or array.shape in ((1,), (1, 1)):
        return np.full((1, count), float(array.reshape(())))
    if array.shape == (count,):
        return np.ascontiguousarray(array[None])
    if array.shape in ((rows, count), (1, count)):
        return np.ascontiguousarray(array)
    raise ValueError(
        f"{name} has shape {array.shape}: expected a number, ({count},) or ({rows}, {count}), as "
        f"spacing has shape ({rows}, {count - 1})"
    )
