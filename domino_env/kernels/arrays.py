"""Working arrays of the kernels: lanes, records of contacts, chains, tapes and results.

Symbols of all kernels (i is the domino behind, i+1 the one it leans on, n the leading domino;
p_l, s_l, d_l are p, s, d in units of L_i):

    L_i, d_i   height, thickness            s_i      gap in front of i; pitch p_i = s_i + d_{i+1}
    I_i, G_i   inertia, gravity torque      μ        friction between dominoes (mu)
    θ_i        lean                         φ_i      tipping angle: tan φ = d/L
    Δ_i        θ_i - θ_{i+1}                m        mass
    s, v, c    sin θ, 1 - cos θ, cos θ      ω, α     angular velocity, angular acceleration
    Ω, Ψ       dθ_i/dθ_{i+1}, d²θ_i/dθ_{i+1}² (omega, psi)
    J, D       ω_i = J_i ω_n, α_i = J_i α_n + D_i ω_n² (jac, drv)
    A, B       arms of the contact force on i, on i+1, friction included; ratio is B/A
    w          weights that eliminate every contact force: w_n = 1, w_i = w_{i+1} B_i/A_i
    M          Σ w I J                      P, Q     Σ w G / M, -Σ w I D / M
    u          ω_n² of the leader           E, U     of one interval: u → E (u + U)
    x_bar      derivative of the differentiated number by x, in reverse mode

A switch is a change of contact. It is a flush (the faces meet, and the contact moves from the tip
to the corner) or a separation.

1 - cos θ replaces cos θ throughout: no difference of nearly equal numbers is left where gaps are
tiny or nearly out of reach.

On uneven ground θ is measured from each domino's pose at rest, and the geometry of a contact is
expressed in the frame of the ground under i+1:

    e_i        height of pivot i+1 over pivot i, normal to the ground under i+1
    β_i        slope of the ground under i less that under i+1: the lean of i in it is θ_i + β_i
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from domino_env.kernels.jit import always_inline, has_field, optional_field


def record_type(
    base: np.dtype[np.record] | None = None, **fields: DTypeLike
) -> np.dtype[np.record]:
    """Return a structured dtype whose elements have their fields as attributes.

    The fields of `base` come last: Numba would convert a type that begins with them to the base.
    """
    inherited = [(name, base[name]) for name in base.names or ()] if base is not None else []
    description: Any = (np.record, np.dtype([*fields.items(), *inherited], align=True))
    record: np.dtype[np.record] = np.dtype(description)
    return record


# --- Lanes ----------------------------------------------------------------------------------------
# A lane is one angle of a quadrature rule: the start of the interval, its nodes, its end. All lanes
# advance along the stack together. One plain array holds all quantities, each from a constant
# offset on: so the compiler vectorises.
STRIDE = 32  # room for each quantity: the largest number of lanes
# Offsets of sin θ, 1 - cos θ, w, J, D; Σ w I J, Σ w G / g, Σ w I D; E, U, u, 1/√u, Legendre
# coefficients; 2 Q h and 2 P h / E of an interval of length h
SIN, VER, WGT, JAC, DRV = 0 * STRIDE, 1 * STRIDE, 2 * STRIDE, 3 * STRIDE, 4 * STRIDE
SUM_M, SUM_G, SUM_D = 5 * STRIDE, 6 * STRIDE, 7 * STRIDE
MAP_E, MAP_U, SPEED2, SLOWNESS, COEF = 8 * STRIDE, 9 * STRIDE, 10 * STRIDE, 11 * STRIDE, 12 * STRIDE
EXPO, RATE = 13 * STRIDE, 14 * STRIDE
LANES = 15 * STRIDE

# --- The ring -------------------------------------------------------------------------------------
# Dominoes and their contacts with the next, domino i at ring[i & mask]. A ring shorter than the
# chain holds the last dominoes. The others belong to the tail: the dominoes behind a cut of the
# stack, which are neglected because a bound on their effect is below the tolerance.
TIP, CORNER, SEPARATED = 0, 1, 2  # kinds of contact
RING_SIZE = 65536  # dominoes remembered behind the leader, at most
ONE_FOR_ALL = 0  # mask of a uniform layout: one entry stands for all dominoes
ALL_KEPT = -1  # mask of a ring that holds all dominoes of a chain
CONTACT = record_type(  # contact of domino i with i+1, and domino i itself
    p_l=float,  # p, s, 1 - s and d, in units of L_i
    s_l=float,
    rest=float,
    d_l=float,
    v_flush=float,  # 1 - cos θ_{i+1} at which the faces meet, and at which the contact separates
    v_separation=float,
    v_switch=float,  # 1 - cos θ_{i+1} of the next change of contact
    inertia=float,  # about the pivot, and ½ m L: both per unit of width
    half_weight=float,
    tan_phi=float,
    tail=float,  # bound on Σ_{k ≤ i} I_k w_k / w_i
    end_weight=float,  # w_i at the end of the last interval
    kind=int,  # TIP, CORNER or SEPARATED
    on_tape=int,  # 1 if the tape has the change from tip to corner
)
UNEVEN_CONTACT = record_type(  # half_weight and tan_phi are those of `place_domino` on a slope
    CONTACT,
    rise_l=float,  # e, in units of L_i
    flush_rate=float,  # -dΔ/d(1 - cos θ_{i+1}) where the faces meet, less p
    turn=float,  # β [rad], its sine and 1 - cosine
    turn_s=float,
    turn_v=float,
)


rise_of, flush_rate_of = optional_field("rise_l"), optional_field("flush_rate")
turn_of, turn_s_of, turn_v_of = (optional_field(name) for name in ("turn", "turn_s", "turn_v"))
is_uneven = has_field("rise_l")


class Shape(NamedTuple):
    """Geometry of a contact: fields of its record, and True for an UNEVEN_CONTACT."""

    p_l: float
    s_l: float
    rest: float
    d_l: float
    rise_l: float
    turn_s: float
    turn_v: float
    uneven: bool


@always_inline
def set_zero(values):
    """Set the numbers of an array to 0."""
    for i in range(len(values)):
        values[i] = 0.0


# --- The state of a chain between two falls -------------------------------------------------------
class Setting(NamedTuple):
    """Physics and tolerance of a simulation, which all kernels pass on together.

    Between falls they are fields of the state. Python passes a plain tuple, as a named one takes
    3 µs longer.
    """

    friction: float  # μ between dominoes
    gravity: float  # [m/s²]
    push: float  # angular velocity of the first domino at the start [rad/s]
    rtol: float  # relative error allowed in the arrival times


@always_inline
def configure(state, ring, setting, exact_minimum):
    """Store the setting of a simulation in its state.

    exact_minimum: locate the minimum of u in every interval, for exact margins.
    """
    state.mask, state.exact_minimum = len(ring) - 1, exact_minimum
    state.friction, state.gravity, state.push, state.rtol = setting


@always_inline
def setting_of(record):
    """Return the setting in a state, or in the rules of a scene."""
    return Setting(record.friction, record.gravity, record.push, record.rtol)


@always_inline
def conserves_energy(setting):
    """Return True if energy is lost in impacts only: then M u is twice the kinetic energy."""
    return setting.friction == 0.0


STATE = record_type(
    mask=int,  # of the ring
    **Setting.__annotations__,
    exact_minimum=np.bool_,  # find the minimum of u in every interval, not only near a stall
    # the wave
    u=float,  # [rad²/s²], bound on its error, and the share of rounding in it
    u_error=float,
    u_round=float,
    time=float,  # of the last hit [s]
    time_low=float,  # rounding error of the sum of all falls
    time_error=float,  # bound on the error of the time, and the share of rounding in it
    time_round=float,
    worst=float,  # largest relative error of an arrival time, and that of rounding alone
    worst_round=float,
    # the fall
    angle=float,  # of the leader at the end [rad]
    fraction=float,  # of its angle that was passed, 1 if it was completed
    fall_time=float,  # [s]
    margin=float,  # lowest u; at the end of the fall divided by u at its start
    lowest_margin=float,  # of all falls
    u_impact=float,  # just before the last hit
    switch_angle=float,  # of the last change of contact, and the leader's ω before and after it
    speed_before=float,
    speed_after=float,
    flush_loss=float,  # largest fraction of ω lost in a face impact
    slowest_at=float,  # position in [0, 1] of the lowest u if panels gave the time, else -1
    # the stack
    m_end=float,  # M at the end of the last interval
    tail_bound=float,  # bound on the error of u by the neglected tail, over u
    kappa=float,  # largest gravity torque of a domino over its inertia and g [1/m]
    noise=float,  # rounding error of u in an interval
    log_rho=float,  # decay of the Legendre coefficients of the last interval, and its length [rad]
    last_h=float,
    # the composed map of all falls so far: u = gain u_0 + offset, u_0 > least_start
    gain=float,
    offset=float,
    least_start=float,
    composing=np.bool_,  # the map is composed, and u is not propagated
    back=int,  # lowest domino still in the stack
    depth=int,  # dominoes behind the leader in the last interval
    last_due=int,  # lowest contact that changes at the very end of an interval, n if none does
    flushes=int,  # number of face impacts, and of separations
    releases=int,
    event_count=int,  # events on the tape, and those that it has no room for
)

# --- The tape -------------------------------------------------------------------------------------
# Events of a chain, for gradients. A FLIP is one contact that moved from the tip to the corner.
INTERVAL, SWITCH, FLIP, HIT = 0, 1, 2, 3
EVENT = record_type(
    kind=int,
    leader=int,  # FLIP: the contact
    low=int,  # lowest domino of the stack
    contact=int,  # SWITCH: the contact whose angle was found
    flips=int,  # SWITCH: number of FLIP events that follow
    rule=int,  # INTERVAL: quadrature rule
    is_flush=np.bool_,  # SWITCH: a face impact
    angle=float,  # of the leader [rad]; INTERVAL: at its start
    length=float,  # INTERVAL: in angle [rad]
    u=float,  # before the event
    m=float,  # HIT: M of the stack
    slowest_at=float,  # INTERVAL: as in the state
)

# --- Results --------------------------------------------------------------------------------------
PROPAGATED, STALLED, OUT_OF_REACH, JAMMED, NO_RIGID_ANSWER = 0, 1, 2, 3, 4  # outcomes
# ARRIVAL of each domino: time [s]; ω just after it is hit and just before it hits the next [rad/s];
# stall margin of its fall. FALL of each domino of a repeated pattern: duration [s] and the same ω.
ARRIVAL = record_type(time=float, release=float, impact=float, margin=float)
FALL = record_type(time=float, release=float, impact=float)
SNAPSHOT = record_type(angle=float, time=float, speed=float)  # of a leader [rad, s, rad/s]


class Summary(NamedTuple):
    """Result of a whole chain."""

    outcome: int
    hit: int  # number of dominoes hit, and toppled
    toppled: int
    reach: float  # falls completed, with the fraction of the last one, over N; 1 if PROPAGATED
    total_time: float  # arrival time of the last domino [s]; inf unless PROPAGATED
    estimate: float  # of the largest relative error of an arrival time
    flushes: int  # number of face impacts, and of separations
    releases: int
    flush_loss: float  # largest fraction of ω lost in a face impact
    lowest_margin: float  # of the stall margins
    event_count: int  # length of a tape that has room for all events


SUMMARY = record_type(**Summary.__annotations__)

# --- Numbers --------------------------------------------------------------------------------------
EPS = 2.220446049250313e-16  # spacing of float64 numbers at 1
TINY = 1e-290  # smallest divisor
INTERVAL_SHARE = 0.3  # of the tolerance of arrival times, for the error of one interval
TAIL_SHARE = 0.3  # of that, for the neglected tail of the stack
IMPACT_TOLERANCE = 1e-9  # [rad] contacts whose faces meet within this Δ change in one impact


class Arrays(NamedTuple):
    """Arrays of a layout of N dominoes; a batch has one more axis in front.

    On flat ground rise and tilt are None.
    """

    spacing: NDArray[np.float64]  # (N-1,) [m]
    thickness: NDArray[np.float64]  # (N,) [m]
    height: NDArray[np.float64]  # (N,) [m]
    density: NDArray[np.float64]  # (N,) [kg/m³]
    rise: NDArray[np.float64] | None = None  # (N-1,) of the next pivot over this one [m]
    tilt: NDArray[np.float64] | None = None  # (N,) slope under each domino, positive downhill [rad]


class Curve(NamedTuple):
    """Ground as a piecewise cubic y(x): piece k ends at knot k, the last piece nowhere.

    Piece k is Σ_j pieces[k, j] (x - starts[k])^(3-j); the first and the last are straight.
    """

    knots: NDArray[np.float64]  # (K,) [m]
    starts: NDArray[np.float64]  # (K+1,) [m]
    pieces: NDArray[np.float64]  # (K+1, 4)
