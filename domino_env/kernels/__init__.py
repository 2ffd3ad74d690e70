"""Compiled physics: arithmetic only, numbers and arrays in and out.

While domino n leads, its lean θ_n is the only free coordinate and u = ω_n² obeys a linear equation
in that angle, so falls, face impacts and hits are affine maps of u, and no ODE solver is needed.

    arrays      layout of the working arrays, and the symbols of all kernels
    quadrature  Gauss-Legendre rules and the polynomial through their nodes
    contact     one contact: tip and corner
    stack       all dominoes that lean on the leader, and their changes of contact
    interval    between two changes: the affine map of u, and the time
    fall        from one hit to the next
    records     arrival times, summary, event tape
    chain       whole chains: any, batches, equal dominoes, endless patterns
    diagnosis   motion, forces and impulses
    stepping    the same physics by steps in time, for comparison
    ground      dominoes placed along curved ground
    step        one step of the environments
    adjoint     the same in reverse mode
    jit         compilation and its cache

This module exports the functions that Python may call, and their records.

Sources: van Leeuwen 2004 (arXiv physics/0401018); Chapman, "The physics of toppling dominoes",
eqs. 1-3, 7-9, restated for unequal dominoes.
"""

from domino_env.kernels.adjoint.chain import vjp as vjp
from domino_env.kernels.adjoint.chain import vjp_batch as vjp_batch
from domino_env.kernels.adjoint.contact import PHYSICS_BAR as PHYSICS_BAR
from domino_env.kernels.arrays import ARRIVAL as ARRIVAL
from domino_env.kernels.arrays import CONTACT as CONTACT
from domino_env.kernels.arrays import EVENT as EVENT
from domino_env.kernels.arrays import FALL as FALL
from domino_env.kernels.arrays import JAMMED as JAMMED
from domino_env.kernels.arrays import NO_RIGID_ANSWER as NO_RIGID_ANSWER
from domino_env.kernels.arrays import OUT_OF_REACH as OUT_OF_REACH
from domino_env.kernels.arrays import PROPAGATED as PROPAGATED
from domino_env.kernels.arrays import RING_SIZE as RING_SIZE
from domino_env.kernels.arrays import SNAPSHOT as SNAPSHOT
from domino_env.kernels.arrays import STALLED as STALLED
from domino_env.kernels.arrays import STATE as STATE
from domino_env.kernels.arrays import SUMMARY as SUMMARY
from domino_env.kernels.arrays import UNEVEN_CONTACT as UNEVEN_CONTACT
from domino_env.kernels.arrays import Arrays as Arrays
from domino_env.kernels.arrays import Curve as Curve
from domino_env.kernels.arrays import Summary as Summary
from domino_env.kernels.chain import compose_falls as compose_falls
from domino_env.kernels.chain import period_falls as period_falls
from domino_env.kernels.chain import solve_batch as solve_batch
from domino_env.kernels.diagnosis import LOADS as LOADS
from domino_env.kernels.diagnosis import diagnose_chain as diagnose_chain
from domino_env.kernels.diagnosis import trace_motion as trace_motion
from domino_env.kernels.ground import place_on_ground as place_on_ground
from domino_env.kernels.ground import place_on_ground_vjp as place_on_ground_vjp
from domino_env.kernels.step.batch import EPISODE as EPISODE
from domino_env.kernels.step.batch import RULES as RULES
from domino_env.kernels.step.batch import RUNNING as RUNNING
from domino_env.kernels.step.batch import Batch as Batch
from domino_env.kernels.step.environment import encode_batch as encode_batch
from domino_env.kernels.step.environment import next_bounds as next_bounds
from domino_env.kernels.step.environment import place_back as place_back
from domino_env.kernels.step.environment import place_batch as place_batch
from domino_env.kernels.step.environment import reset_batch as reset_batch
from domino_env.kernels.step.environment import step_batch as step_batch
from domino_env.kernels.step.observation import FRONT_LIMIT as FRONT_LIMIT
from domino_env.kernels.step.observation import LEAD_LIMIT as LEAD_LIMIT
from domino_env.kernels.step.observation import OBSERVATION as OBSERVATION
from domino_env.kernels.step.observation import RISE_LIMIT as RISE_LIMIT
from domino_env.kernels.step.observation import SPEED_LIMIT as SPEED_LIMIT
