"""Torque of gravity on a domino: its part in the sums over the stack, its bound, its energy."""

import math
from typing import NamedTuple

from domino_env.kernels.arrays import SIN, SUM_G, VER
from domino_env.kernels.jit import always_inline, leaf


class Body(NamedTuple):
    """A domino without its contact: fields of its record."""

    inertia: float
    half_weight: float
    tan_phi: float


@always_inline
def body_of(domino):
    """Return the body of a domino."""
    return Body(domino.inertia, domino.half_weight, domino.tan_phi)


@leaf
def torque(body, s, v, factor):
    """Return the gravity torque of a domino over g, times a factor."""
    return factor * body.half_weight * (s - body.tan_phi * (1.0 - v))


@leaf
def stack_terms(body, s, v, w, jac, drv):
    """Return the terms of a domino in Σ w I J, Σ w G / g and Σ w I D."""
    return w * body.inertia * jac, torque(body, s, v, w), w * body.inertia * drv


@always_inline
def conserves_energy(setting):
    """Return True if energy is lost in impacts only: then M u is twice the kinetic energy."""
    return setting.friction == 0.0


@always_inline
def add_energy(lanes, count, body):
    """Add to SUM_G the energy over g that a domino has released in the interval so far."""
    # terms of a domino are subtracted before those of others are added: small changes stay exact
    half, tan_phi = body.half_weight, body.tan_phi
    at_start = tan_phi * lanes[SIN] - lanes[VER]
    for j in range(count):
        lanes[SUM_G + j] += half * ((tan_phi * lanes[SIN + j] - lanes[VER + j]) - at_start)


@always_inline
def torque_bound(height, thickness):
    """Return the largest gravity torque of a domino over its inertia and g [1/m]."""
    return 1.5 / math.sqrt(height * height + thickness * thickness)


@always_inline
def torque_share(state, h):
    """Return a bound on 2 h G / (I u) of all dominoes, for an interval of length h."""
    return 2.0 * h * state.gravity * state.kappa / state.u
