"""Everything compiled, told as physics: arithmetic only, numbers and arrays in and out.

While domino n leads, its lean θ_n is the only free coordinate and u = ω_n² obeys a linear equation
in that angle, so a fall, a flush and a hit are affine maps of u, and nothing is stepped in time.

    slots       how the working arrays are laid out, and the symbols of all kernels
    quadrature  Gauss-Legendre rules and the polynomial through their nodes
    contact     one link: tip and corner, as it stands in the ring
    stack       all dominoes that lean on the leader, and their changes of contact
    interval    between two switches: the affine map of u, and the time
    fall        from one hit to the next
    records     what is kept of a chain
    chain       whole chains: any, batches, equal dominoes, endless patterns
    watch       motion, forces and impulses
    ground      dominoes placed along curved ground
    step        the environments' step
    adjoint     the same, backwards
    jit         how all of it is compiled and cached

This face offers what Python calls, and only that.

Sources: van Leeuwen 2004 (arXiv physics/0401018); Chapman, "The physics of toppling dominoes",
eqs. 1-3, 7-9, restated for unequal dominoes.
"""

from domino_env.kernels.adjoint.chain import vjp, vjp_batch
from domino_env.kernels.adjoint.contact import PHYSICS_BAR
from domino_env.kernels.arrays import (
    ARRIVAL,
    CONTACT,
    EVENT,
    FALL,
    JAMMED,
    NO_RIGID_ANSWER,
    OUT_OF_REACH,
    PROPAGATED,
    RING_SIZE,
    SNAPSHOT,
    STALLED,
    STATE,
    SUMMARY,
    UNEVEN_CONTACT,
    Arrays,
    Curve,
    Summary,
)
from domino_env.kernels.chain import compose_falls, period_falls, solve_batch
from domino_env.kernels.diagnosis import LOADS, diagnose_chain, trace_motion
from domino_env.kernels.ground import place_on_ground, place_on_ground_vjp
from domino_env.kernels.step.batch import EPISODE, RULES, RUNNING, Batch
from domino_env.kernels.step.environment import (
    encode_batch,
    next_bounds,
    place_back,
    place_batch,
    reset_batch,
    step_batch,
)
from domino_env.kernels.step.observation import (
    FRONT_LIMIT,
    LEAD_LIMIT,
    OBSERVATION,
    RISE_LIMIT,
    SPEED_LIMIT,
)

__all__ = [
    "ARRIVAL",
    "CONTACT",
    "EPISODE",
    "EVENT",
    "FALL",
    "FRONT_LIMIT",
    "JAMMED",
    "LEAD_LIMIT",
    "LOADS",
    "NO_RIGID_ANSWER",
    "OBSERVATION",
    "OUT_OF_REACH",
    "PHYSICS_BAR",
    "PROPAGATED",
    "RING_SIZE",
    "RISE_LIMIT",
    "RULES",
    "RUNNING",
    "SNAPSHOT",
    "SPEED_LIMIT",
    "STALLED",
    "STATE",
    "SUMMARY",
    "UNEVEN_CONTACT",
    "Arrays",
    "Batch",
    "Curve",
    "Summary",
    "compose_falls",
    "diagnose_chain",
    "encode_batch",
    "next_bounds",
    "period_falls",
    "place_back",
    "place_batch",
    "place_on_ground",
    "place_on_ground_vjp",
    "reset_batch",
    "solve_batch",
    "step_batch",
    "trace_motion",
    "vjp",
    "vjp_batch",
]
