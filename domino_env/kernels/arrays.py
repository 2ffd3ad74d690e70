"""Working arrays of the kernels: lanes, records of contacts, chains, tapes and results.

Symbols of all kernels (i is the domino behind, i+1 the one it leans on, n the leading domino;
p, s, d are in units of L_i, as the names p_l, s_l, d_l recall):

    L_i, d_i   height, thickness            s_i      free gap in front of i; p_i = s_i + d_{i+1}
    θ, v       lean, 1 - cos θ              Δ_i      θ_i - θ_{i+1}
    Ω, Ψ       dθ_i/dθ_{i+1}, d²θ_i/dθ_{i+1}²        J, D     the same to the leader: ω_i, α_i
    A, B       arms of the contact force on i, on i+1 (friction included)
    w          weights that eliminate every contact force: w_i = w_{i+1} B_i/A_i
    M          Σ w I J                      P, Q     Σ w G / M, -Σ w I D / M
    u          ω_n² of the leader           E, U     of one interval: u → E (u + U)
    x_bar      derivative of the differentiated number by x, in reverse mode

1 - cos θ replaces cos θ throughout: no difference of nearly equal numbers is left where gaps are
tiny or nearly out of reach.

On uneven ground θ is measured from each domino's pose at rest, and the geometry of a contact is
expressed in the frame of the ground under i+1:

    e_i        height of pivot i+1 over pivot i, normal to the ground under i+1
    β_i        slope of the ground under i less that under i+1: θ_i is measured from β_i there
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from domino_env.kernels.jit import has_field, optional_field


def record_type(
    base: np.dtype[np.record] | None = None, **fields: DTypeLike
) -> np.dtype[np.record]:
    """Return a structured dtype whose elements have their fields as attributes.

    The fields of `base` come last: Numba would convert a type that begins with them to the base.
    """
    inherited = [(name, base[name]) for name in base.names or ()] if base is not None else []
    described: Any = (np.record, np.dtype([*fields.items(), *inherited], align=True))
    record: np.dtype[np.record] = np.dtype(described)
    return record


# --- Lanes ----------------------------------------------------------------------------------------
# A lane is one angle of a quadrature rule: the start of the interval, its nodes, its end. All lanes
# advance along the stack together. One plain array with a constant pitch shows the compiler that
# the quantities never overlap, so that it vectorises.
STRIDE = 32
SIN, VER, WGT, JAC, DRV = 0 * STRIDE, 1 * STRIDE, 2 * STRIDE, 3 * STRIDE, 4 * STRIDE
SUM_M, SUM_G, SUM_D = 5 * STRIDE, 6 * STRIDE, 7 * STRIDE
MAP_E, MAP_U, SPEED2, SLOWNESS, COEF = 8 * STRIDE, 9 * STRIDE, 10 * STRIDE, 11 * STRIDE, 12 * STRIDE
EXPO, RATE = 13 * STRIDE, 14 * STRIDE
LANES = 15 * STRIDE

# --- The ring -------------------------------------------------------------------------------------
# Dominoes and their contacts with the next, domino i at ring[i & mask]. A ring shorter than the
# chain holds the last dominoes; the bound on the tail covers those further back.
TIP, CORNER, SEPARATED = 0, 1, 2  # kinds of contact
RING_SIZE = 65536  # dominoes remembered behind the leader, at most
ONE_FOR_ALL = 0  # mask of a uniform layout: one entry stands for all dominoes
ALL_KEPT = -1  # mask of a ring that holds all dominoes of a chain
CONTACT = record_type(
    p_l=float,  # p, s, 1 - s and d
    s_l=float,
    rest=float,
    d_l=float,
    v_flush=float,  # 1 - cos θ_{i+1} at which the faces meet, and at which the contact separates
    v_separation=float,
    v_switch=float,  # 1 - cos θ_{i+1} of the next change of contact
    inertia=float,  # of the domino about its pivot, and half its weight times height over gravity
    half_weight=float,
    slenderness=float,  # thickness over height
    tail=float,  # bound on Σ_{k ≤ i} I_k w_k / w_i
    end_weight=float,  # w_i at the end of the last interval
    kind=int,
    on_tape=int,  # 1 if the tape has the change from tip to corner
)
UNEVEN_CONTACT = record_type(  # half_weight and slenderness are relative to the slope
    CONTACT,
    rise_l=float,  # e
    flush_rate=float,  # dΔ/d(1 - cos θ_{i+1}) where the faces meet, less p
    turn=float,  # β, its sine and 1 - cosine
    turn_s=float,
    turn_v=float,
)


rise_of, flush_rate_of = optional_field("rise_l"), optional_field("flush_rate")
turn_of, turn_s_of, turn_v_of = (optional_field(name) for name in ("turn", "turn_s", "turn_v"))
is_uneven = has_field("rise_l")


class Shape(NamedTuple):
    """Geometry of a contact, in units of L_i."""

    p_l: float
    s_l: float
    rest: float
    d_l: float
    rise_l: float
    turn_s: float
    turn_v: float
    uneven: bool


# --- The state of a chain between two falls -------------------------------------------------------
STATE = record_type(
    # settings, which the kernels pass on with the state
    mask=int,  # of the ring
    mu=float,
    gravity=float,  # [m/s²]
    rtol=float,  # of arrival times
    exact_minimum=np.bool_,  # find the minimum of u in every interval, not only near a stall
    # the wave
    u=float,
    u_error=float,
    u_round=float,
    time=float,
    time_low=float,  # rounding error of the sum of all falls
    time_error=float,
    time_round=float,
    worst=float,  # largest relative error of an arrival time, and its share from rounding
    worst_round=float,
    # the fall
    angle=float,
    fraction=float,  # of the fall that was done, 1 if it ended in a hit
    fall_time=float,
    margin=float,  # lowest u of the fall over u at its start
    lowest_margin=float,
    u_impact=float,
    switch_angle=float,  # of the last change of contact, and the leader's speeds around it
    speed_before=float,
    speed_after=float,
    flush_loss=float,
    slowest_at=float,  # position of the lowest u if time was integrated in panels, else -1
    # the stack
    m_end=float,  # M at the end of the last interval
    tail_bound=float,  # bound on the error of u by the neglected tail, over u
    kappa=float,  # largest gravity torque over inertia and g
    noise=float,  # rounding error of u in an interval
    log_rho=float,  # decay of the Legendre coefficients of the last interval, and its length
    last_h=float,
    # the composed map of all falls so far: u = gain u_0 + offset, u_0 > least_start
    gain=float,
    offset=float,
    least_start=float,
    composing=np.bool_,
    back=int,  # lowest domino still in the stack
    depth=int,  # dominoes behind the leader in the last interval
    last_due=int,  # lowest contact that changes at the very end of an interval
    flushes=int,
    releases=int,
    event_count=int,  # events on the tape, and those that it has no room for
)

# --- The tape -------------------------------------------------------------------------------------
# Events of a chain, for gradients.
INTERVAL, SWITCH, FLIP, HIT = 0, 1, 2, 3
EVENT = record_type(
    kind=np.int32,
    leader=np.int32,  # of a FLIP: the contact that went from tip to corner since the last interval
    low=np.int32,  # lowest domino of the stack
    contact=np.int32,  # SWITCH: the contact whose angle was found
    flips=np.int32,  # SWITCH: number of FLIP events that follow
    rule=np.int32,  # INTERVAL: quadrature rule
    is_flush=np.bool_,  # SWITCH: a face impact
    angle=float,  # INTERVAL: its start; SWITCH: where it happens
    length=float,  # INTERVAL: in angle
    u=float,  # before the event
    m=float,  # HIT: M of the stack
    slowest_at=float,  # INTERVAL: as in the state
)

# --- Results --------------------------------------------------------------------------------------
PROPAGATED, STALLED, OUT_OF_REACH, JAMMED, NO_RIGID_ANSWER = 0, 1, 2, 3, 4
ARRIVAL = record_type(time=float, release=float, impact=float, margin=float)  # of each domino
FALL = record_type(time=float, release=float, impact=float)  # of a pattern that repeats
SNAPSHOT = record_type(angle=float, time=float, speed=float)  # of a leader


class Summary(NamedTuple):
    """Result of a whole chain."""

    outcome: int
    hit: int
    toppled: int
    reach: float
    total_time: float
    estimate: float
    flushes: int
    releases: int
    flush_loss: float
    lowest_margin: float
    event_count: int


SUMMARY = record_type(**Summary.__annotations__)

# --- Numbers --------------------------------------------------------------------------------------
EPS = 2.220446049250313e-16
TINY = 1e-290
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
    """Piecewise cubic, straight beyond its ends: piece k ends at knot k.

    Piece k is Σ_j c_kj (x - start_k)^(3-j).
    """

    knots: NDArray[np.float64]  # (K,)
    starts: NDArray[np.float64]  # (K+1,)
    pieces: NDArray[np.float64]  # (K+1, 4)
