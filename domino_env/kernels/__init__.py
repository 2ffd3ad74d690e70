"""Everything compiled, told as physics: arithmetic only, numbers and arrays in and out.

While domino n leads, its lean θ_n is the only free coordinate and u = ω_n² obeys a linear equation
in that angle, so a fall, a flush and a hit are affine maps of u, and nothing is stepped in time.

    slots       how the working arrays are laid out, and the symbols of all kernels
    quadrature  Gauss-Legendre rules
    contact     one link: tip and corner
    links       dominoes and links in the ring, and their changes of contact
    stack       all dominoes that lean on the leader
    switch      flushes and releases: when, and what they do
    polynomial  the polynomial through the nodes of a rule
    crawl       the time of an interval in which u nearly vanishes
    interval    between two switches: the affine map of u, and the time
    fall        from one hit to the next
    front       how a chain begins, and what hits do to u and the time
    uniform     rows of equal dominoes
    chain       whole chains, and batches of them
    endless     rows that repeat a pattern for ever
    motion      a chain that is watched
    forces      what happens between the dominoes
    step        one step of the environments
    records, tape    what is kept of a chain
    adjoint     the same, backwards
    ground      dominoes placed along curved ground
    jit         how all of it is compiled and cached

This face offers what Python calls, and only that.

Sources: van Leeuwen 2004 (arXiv physics/0401018); Chapman, "The physics of toppling dominoes",
eqs. 1-3, 7-9, restated for unequal dominoes.
"""

from domino_env.kernels.adjoint.chain import pull, pull_rows
from domino_env.kernels.adjoint.slots import WHOLE
from domino_env.kernels.chain import compose_row, solve_rows
from domino_env.kernels.endless import period_falls
from domino_env.kernels.forces import LOADS, diagnose_chain
from domino_env.kernels.ground import follow_rows, lay_rows
from domino_env.kernels.motion import watch_chain
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
