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

from domino_env.kernels.adjoint.chain import pull, pull_rows
from domino_env.kernels.adjoint.contact import WHOLE
from domino_env.kernels.chain import compose_row, period_falls, solve_rows
from domino_env.kernels.ground import follow_rows, lay_rows
from domino_env.kernels.slots import (
    ARRIVAL,
    EVENT,
    FALL,
    JAMMED,
    LINK,
    NO_RIGID_ANSWER,
    OUT_OF_REACH,
    PROPAGATED,
    RING_ROWS,
    SNAPSHOT,
    STALLED,
    STATE,
    SUMMARY,
    UNEVEN_LINK,
    Curve,
    Row,
    Summary,
)
from domino_env.kernels.step.batch import EPISODE, RULES, RUNNING, Batch
from domino_env.kernels.step.environment import (
    aim_batch,
    bounds_ahead,
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
from domino_env.kernels.watch import LOADS, diagnose_chain, watch_chain

__all__ = [
    "ARRIVAL",
    "EPISODE",
    "EVENT",
    "FALL",
    "FRONT_LIMIT",
    "JAMMED",
    "LEAD_LIMIT",
    "LINK",
    "LOADS",
    "NO_RIGID_ANSWER",
    "OBSERVATION",
    "OUT_OF_REACH",
    "PROPAGATED",
    "RING_ROWS",
    "RISE_LIMIT",
    "RULES",
    "RUNNING",
    "SNAPSHOT",
    "SPEED_LIMIT",
    "STALLED",
    "STATE",
    "SUMMARY",
    "UNEVEN_LINK",
    "WHOLE",
    "Batch",
    "Curve",
    "Row",
    "Summary",
    "aim_batch",
    "bounds_ahead",
    "compose_row",
    "diagnose_chain",
    "follow_rows",
    "lay_rows",
    "period_falls",
    "place_back",
    "place_batch",
    "pull",
    "pull_rows",
    "reset_batch",
    "solve_rows",
    "step_batch",
    "watch_chain",
]
