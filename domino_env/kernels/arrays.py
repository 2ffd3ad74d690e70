"""How the working arrays are laid out: lanes, and the records of links, chains, tapes and episodes.

Symbols, here and in all kernels (i is the domino behind, i+1 the one it leans on; p, s, d are taken
in units of L_i, which the names p_l, s_l, d_l recall):

    L_i, d_i   height, thickness            s_i      free gap in front of i; p_i = s_i + d_{i+1}
    θ, v       lean, 1 - cos θ              Δ_i      θ_i - θ_{i+1}
    Ω, Ψ       dθ_i/dθ_{i+1}, d²θ_i/dθ_{i+1}²        J, D     the same to the leader: ω_i, α_i
    A, B       arms of the contact force on i, on i+1 (friction included)
    w          weights that eliminate every contact force: w_i = w_{i+1} B_i/A_i
    M          Σ w I J                      P, Q     Σ w G / M, -Σ w I D / M
    u          ω_n² of the leader n         E, U     of one interval: u → E (u + U)

1 - cos θ stands in for cos θ throughout: with it no difference of nearly equal numbers is left
when gaps are tiny or nearly out of reach.

On uneven ground θ counts from each domino's own stand, and what a link is made of is seen upright
from the stand of i+1:

    e_i        how much higher pivot i+1 is than pivot i, upright to the ground under i+1
    β_i        slope of the ground under i less that under i+1: θ_i counts from β_i in that view
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from domino_env.kernels.jit import has_field, optional_field


def record_type(
    base: np.dtype[np.record] | None = None, **fields: DTypeLike
) -> np.dtype[np.record]:
    """A structured dtype whose elements have their fields as attributes.

    Those of `base` come last: a type that began with them, Numba would take for the base.
    """
    inherited = [(name, base[name]) for name in base.names or ()] if base is not None else []
    described: Any = (np.record, np.dtype([*fields.items(), *inherited], align=True))
    record: np.dtype[np.record] = np.dtype(described)
    return record


# --- Lanes ----------------------------------------------------------------------------------------
# A lane is one angle of a quadrature rule: the start of the interval, its nodes, its end. All lanes
# move down the stack together. One plain array with a constant pitch lets the compiler see that the
# rows never overlap, and vectorise.
PITCH = 32
SIN, VER, WGT, JAC, DRV = 0 * PITCH, 1 * PITCH, 2 * PITCH, 3 * PITCH, 4 * PITCH
SUM_M, SUM_G, SUM_D = 5 * PITCH, 6 * PITCH, 7 * PITCH
MAP_E, MAP_U, SPEED2, SLOWNESS, COEF = 8 * PITCH, 9 * PITCH, 10 * PITCH, 11 * PITCH, 12 * PITCH
EXPO, RATE = 13 * PITCH, 14 * PITCH
LANES = 15 * PITCH

# --- The ring -------------------------------------------------------------------------------------
# Dominoes and their links to the next. The ring keeps the last ones only: what lies further back is
# covered by the bound on the tail.
TIP, CORNER, SEPARATED = 0, 1, 2  # the contact of a link
RING_SIZE = 65536  # dominoes remembered behind the leader, at most
CONTACT = record_type(
    p_l=float,  # p, s, 1 - s and d of the link
    s_l=float,
    rest=float,
    d_l=float,
    v_flush=float,  # 1 - cos θ_{i+1} at which a tip turns corner, and at which contact is lost
    v_separation=float,
    v_switch=float,  # 1 - cos θ_{i+1} at which the link next switches
    inertia=float,  # of the domino about its pivot, and half its weight times height over gravity
    half_weight=float,
    slender=float,  # thickness over height
    tail=float,  # bound on Σ_{k ≤ i} I_k w_k / w_i
    end_weight=float,  # w_i at the end of the last interval
    kind=int,
    on_tape=int,  # 1 if the tape knows that the link turned corner
)
UNEVEN_CONTACT = (
    record_type(  # on uneven ground; half_weight and slender are then those to the slope
        CONTACT,
        rise_l=float,  # e of the link, seen upright from the stand of i+1
        pace=float,  # dΔ/d(1 - cos θ_{i+1}) where it goes flush, beyond p
        turn=float,  # β, its sine and 1 - cosine
        turn_s=float,
        turn_v=float,
    )
)


rise_of, pace_of, turn_of = (optional_field(name) for name in ("rise_l", "pace", "turn"))
turn_s_of, turn_v_of = (optional_field(name) for name in ("turn_s", "turn_v"))
is_uneven = has_field("rise_l")


class Shape(NamedTuple):
    """What a contact needs of its link."""

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
    u=float,
    u_error=float,
    u_round=float,
    time=float,
    time_low=float,  # what a sum of many falls would lose to rounding
    time_error=float,
    time_round=float,
    worst=float,  # largest error of an arrival time over it, and the part of it that is rounding
    worst_round=float,
    # the fall
    angle=float,
    fraction=float,  # of the fall that was done, 1 if it ended in a hit
    fall_time=float,
    margin=float,  # lowest u of the fall over u at release
    lowest_margin=float,
    u_impact=float,
    switched=float,  # angle of the last switch, and the leader's speeds around it
    w_before=float,
    w_after=float,
    flush_loss=float,
    slowest_at=float,  # where u was lowest if its time was taken in panels, else -1
    # the stack
    m_end=float,  # M at the end of the last interval
    cut=float,  # bound on what was cut off, over u
    kappa=float,  # largest gravity torque over inertia and g
    noise=float,  # what rounding does to u in an interval
    log_rho=float,  # decay of the Legendre coefficients of the last interval, and its length
    last_h=float,
    # the map of all falls so far, where it is composed: u = gain u_0 + offset, u_0 > need
    gain=float,
    offset=float,
    least_start=float,
    composing=np.bool_,
    back=int,  # lowest domino still in the stack
    depth=int,  # dominoes behind the leader in the last interval
    last_due=int,  # lowest link that switches at the very end of an interval
    flushes=int,
    releases=int,
    taped=int,  # rows of tape written, or wanted
)

# --- The tape -------------------------------------------------------------------------------------
# What a chain did, for those who ask for gradients: one row an event.
INTERVAL, SWITCH, FLIP, HIT = 0, 1, 2, 3
EVENT = record_type(
    kind=np.int32,
    leader=np.int32,  # of a FLIP: the link that went from tip to corner since the last ride
    low=np.int32,  # lowest domino of the stack
    contact=np.int32,  # SWITCH: the link that was due
    flips=np.int32,  # SWITCH: rows of FLIP that follow
    rule=np.int32,  # RIDE: which quadrature
    flushed=np.bool_,  # SWITCH: whether it flushed
    angle=float,  # RIDE: the first; SWITCH: the one it happens at
    length=float,  # RIDE: of the interval of angle
    u=float,  # before the event
    m=float,  # HIT: M of the stack
    slowest_at=float,  # RIDE: as in the state
)

# --- What is told of chains -----------------------------------------------------------------------
PROPAGATED, STALLED, OUT_OF_REACH, JAMMED, NO_RIGID_ANSWER = 0, 1, 2, 3, 4
ARRIVAL = record_type(time=float, release=float, impact=float, margin=float)  # of each domino
FALL = record_type(time=float, release=float, impact=float)  # of a pattern that repeats
SNAPSHOT = record_type(angle=float, time=float, speed=float)  # of a leader


class Summary(NamedTuple):
    """What is told of a whole chain."""

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
    taped: int


SUMMARY = record_type(**Summary.__annotations__)

# --- Numbers --------------------------------------------------------------------------------------
EPS = 2.220446049250313e-16
TINY = 1e-290
TOGETHER = 1e-9  # links flush within this Δ [rad] switch in one impact


class Arrays(NamedTuple):
    """What a chain of N dominoes is made of; many chains have one more axis in front.

    On flat ground rise and tilt are None.
    """

    spacing: NDArray[np.float64]  # (N-1,) [m]
    thickness: NDArray[np.float64]  # (N,) [m]
    height: NDArray[np.float64]  # (N,) [m]
    density: NDArray[np.float64]  # (N,) [kg/m³]
    rise: NDArray[np.float64] | None = None  # (N-1,) of the next pivot over this one [m]
    tilt: NDArray[np.float64] | None = None  # (N,) slope under each domino, positive downhill [rad]


class Curve(NamedTuple):
    """A piecewise cubic that goes on straight beyond its ends: piece k ends at knot k.

    Piece k is Σ_j c_kj (x - start_k)^(3-j).
    """

    knots: NDArray[np.float64]  # (K,)
    starts: NDArray[np.float64]  # (K+1,)
    pieces: NDArray[np.float64]  # (K+1, 4)
