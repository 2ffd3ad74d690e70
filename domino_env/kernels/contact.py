"""Dominoes and contacts in the ring: lean and rate of the domino behind, and its contact force.

A contact starts at the tip, may move to the corner, and may separate. For the symbols see
`arrays`. On flat ground the rise e and the turn β are zero.

The numbers of equations are those of Chapman, "The physics of toppling dominoes"
(zmatt.net/domino-physics), restated for unequal dominoes; see also van Leeuwen 2004 (arXiv
physics/0401018).
"""

import math
from functools import partial
from typing import NamedTuple

import numba
import numpy as np
from numba.core import types

from domino_env.kernels import arrays
from domino_env.kernels.arrays import Shape, flush_rate_of, is_uneven, rise_of, turn_s_of, turn_v_of
from domino_env.kernels.jit import always_inline, internal, leaf
from domino_env.kernels.jit.interpreted import with_counterpart

NEVER = 3.0  # in place of a value of 1 - cos θ, which is at most 2
_FLAT, _UNEVEN = map(numba.from_dtype, (arrays.CONTACT, arrays.UNEVEN_CONTACT))


def _contact_dtype(tilt):
    return arrays.CONTACT if tilt is None else arrays.UNEVEN_CONTACT


@partial(with_counterpart, counterpart=_contact_dtype)
@numba.extending.intrinsic
def _contact_type(_, tilt):
    """Return the record type of the contacts of a layout, by the type of its tilt."""
    kind = types.DType(_FLAT if isinstance(tilt, types.NoneType) else _UNEVEN)
    return kind(tilt), lambda context, *_: context.get_dummy_value()


@internal
def new_ring(layout, size):
    """Return an empty ring for the dominoes of a layout."""
    return np.zeros(size, _contact_type(layout.tilt))


@always_inline
def at_or_zero(values, i):
    """Return values[i]; 0.0 if there are no values, as on flat ground."""
    if values is None:
        return 0.0
    return values[i]


@always_inline
def place_domino(ring, mask, i, layout, j):
    """Write domino j of a layout into the ring as domino i, per unit of width.

    On a slope α its gravity torque, ½ m g (L sin(θ + α) - d cos(θ + α)), is that of a domino of
    another weight and tan_phi on flat ground.
    """
    domino, height, thickness = ring[i & mask], layout.height[j], layout.thickness[j]
    mass = layout.density[j] * height * thickness
    domino.inertia = mass * (height * height + thickness * thickness) / 3.0
    tilt, tan_phi = at_or_zero(layout.tilt, j), thickness / height
    s, c = math.sin(tilt), math.cos(tilt)
    factor = c + tan_phi * s
    domino.half_weight = 0.5 * mass * height * factor  # times gravity where it is used
    domino.tan_phi = (tan_phi * c - s) / factor
    domino.kind = arrays.TIP
    domino.on_tape = 0
    domino.tail = domino.inertia
    domino.end_weight = 0.0


class Body(NamedTuple):
    """A domino without its contact: fields of its record, which can be passed in its place."""

    inertia: float
    half_weight: float
    tan_phi: float


@always_inline
def body_of(domino):
    """Return a domino without its contact."""
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
def place_contact(ring, mask, i, layout, j, ahead):
    """Write the contact of i with i+1, which are dominoes j and `ahead` of the layout."""
    contact, height = ring[i & mask], layout.height[j]
    gap, thickness_next = layout.spacing[j], layout.thickness[ahead]
    pitch = gap + thickness_next
    contact.p_l = pitch / height
    contact.s_l = gap / height
    contact.rest = (height - gap) / height
    contact.d_l = thickness_next / height
    contact.v_flush = gap / pitch  # cos θ = d/p
    # cos θ = (p² + d² - L²) / 2pd, for the tip and for the corner
    contact.v_separation = (height - gap) * (height + gap) / (2.0 * pitch * thickness_next)
    _place_contact_on_ground(contact, layout, layout.tilt, j, ahead)
    contact.v_switch = min(contact.v_flush, contact.v_separation)


@internal
def _place_contact_on_ground(contact, layout, tilt, j, ahead):
    """Write the terms that uneven ground adds to a contact."""
    if tilt is None:
        return
    e, p, d = contact_rise(layout, j, ahead) / layout.height[j], contact.p_l, contact.d_l
    contact.rise_l = e
    contact.turn = tilt[j] - tilt[ahead]
    contact.turn_s = math.sin(contact.turn)
    half = math.sin(0.5 * contact.turn)
    contact.turn_v = 2.0 * half * half
    contact.flush_rate = 0.0
    if e != 0.0:
        contact.v_flush = first_lean(p, e, contact.s_l)
        v = contact.v_flush
        if 0.0 < v < 2.0:
            contact.flush_rate = e * (1.0 - v) / math.sqrt(v * (2.0 - v))
        # p cos θ - e sin θ = (p² + e² + d² - L²) / 2d, for the tip and for the corner
        drop = (contact.rest * (1.0 + contact.s_l) - e * e) / (2.0 * d)
        contact.v_separation = first_lean(p, e, drop)


@internal
def contact_rise(layout, j, ahead):
    """Return e of the contact of dominoes j and `ahead` [m]; 0 where it is only rounding."""
    tilt = at_or_zero(layout.tilt, ahead)
    along = (layout.spacing[j] + layout.thickness[ahead]) * math.tan(tilt)
    up = at_or_zero(layout.rise, j) / math.cos(tilt)
    step = along + up
    return 0.0 if abs(step) <= 8.0 * arrays.EPS * (abs(along) + abs(up)) else step


@internal
def first_lean(p, e, drop):
    """Return 1 - cos θ at which p cos θ - e sin θ has fallen from p by `drop`; NEVER if it cannot.

    e is not 0.
    """
    r = p - drop
    w2 = drop * (p + r) + e * e
    if w2 < 0.0:
        return NEVER
    w, square = math.sqrt(w2), p * p + e * e
    if e > 0.0:  # no difference of nearly equal numbers
        return drop * (p * w - e * r) / ((e + w) * square)
    return (p * drop + e * (e - w)) / square


@always_inline
def span2(contact):
    """Return p² + e² - d² of a contact."""
    return contact.s_l * (contact.p_l + contact.d_l) + rise_of(contact) * rise_of(contact)


@always_inline
def ratio_bound(contact):
    """Return a bound on Ω and |B/A| of a tip contact: both only fall from their values at a hit."""
    if not is_uneven(contact):
        return 1.0
    return max(1.0, 1.0 - rise_of(contact) / math.sqrt(contact.rest * (1.0 + contact.s_l)))


@always_inline
def past_flush(contact, dv):
    """Return the angle -Δ [rad] past face contact, if 1 - cos θ_{i+1} is past it by a small dv."""
    return dv * (contact.p_l + flush_rate_of(contact))


@always_inline
def can_flush(contact):
    """Return True if the next change of a contact is from tip to corner, False if it separates."""
    return contact.kind == arrays.TIP and contact.v_flush < contact.v_separation


@always_inline
def flush(contact, state):
    """Move a contact from tip to corner: face contact."""
    contact.kind = arrays.CORNER
    contact.v_switch = contact.v_separation
    state.flushes += 1


@always_inline
def lean_scale(contact):
    """Return the change of the lean of i+1 [rad] over which Ω of a corner varies after a flush."""
    return math.sqrt(span2(contact) / (contact.p_l * contact.d_l))


@internal
def separate(contact, i, state):
    """Separate domino i from i+1, so that it and all behind it leave the stack."""
    contact.kind = arrays.SEPARATED
    state.back = i + 1
    state.releases += 1


@always_inline
def catch_up(contact, i, v, state):
    """Apply changes of contact i that an earlier cut of the stack left out.

    They need no impact, as its effect was below the tolerance.
    """
    if can_flush(contact):
        flush(contact, state)
    if v > contact.v_separation * (1.0 + 1e-9):  # a margin for rounding
        separate(contact, i, state)


@internal
def sin_versine(angle):
    """Return sin and 1 - cos of an angle [rad]."""
    half = 0.5 * angle
    s, c = math.sin(half), math.cos(half)
    return 2.0 * s * c, 2.0 * s * s


@always_inline
def shape_of(contact):
    """Return the geometry of a contact."""
    e, turn_s, turn_v = rise_of(contact), turn_s_of(contact), turn_v_of(contact)
    return Shape(
        contact.p_l, contact.s_l, contact.rest, contact.d_l, e, turn_s, turn_v, is_uneven(contact)
    )


@leaf
def tip(s, v, shape, mu):
    """Return sin θ_i, 1 - cos θ_i, Ω, Ψ, B/A where the top edge of i slides down i+1.

    s, v: sin θ and 1 - cos θ of i+1.
    """
    p_l, s_l, rest, d_l, e, turn_s, turn_v, uneven = shape
    lost = p_l * v + e * s
    sd = s_l - lost  # sin Δ, eq. 1; on uneven ground Δ is the lean in the frame of i+1
    cd2 = (1.0 + sd) * (rest + lost)
    cd = math.sqrt(cd2 if cd2 > arrays.TINY else arrays.TINY)
    arm = cd + mu * sd
    vd = sd * sd / (1.0 + cd)  # 1 - cos Δ, accurate for a small Δ, as near face contact
    r = 1.0 / (cd * arm)
    inv_cd = r * arm
    c = 1.0 - v
    across = p_l * s + e * c
    omega = 1.0 - across * inv_cd  # eq. 2
    ratio = (cd - across - mu * d_l) * (r * cd)  # eq. 7
    s_0 = s * cd + c * sd
    v_0 = v + vd - v * vd + s * sd
    if uneven:  # eq. 3, corrected: the form for flat ground takes 3 % longer on uneven ground
        psi = (sd * (1.0 - omega) * (1.0 - omega) - (p_l * c - e * s)) * inv_cd
    else:
        psi = -p_l * ((1.0 - v_0) + s * sd * omega) * (inv_cd * inv_cd)
    s_i = s_0 - (s_0 * turn_v + (1.0 - v_0) * turn_s)
    v_i = v_0 + turn_v - v_0 * turn_v - s_0 * turn_s
    return s_i, v_i, omega, psi, ratio


@leaf
def corner(s, v, shape, mu):
    """Return what `tip` does where the front face of i rests on the rear bottom edge of i+1."""
    p_l, s_l, _, d_l, e, turn_s, turn_v, uneven = shape
    # squared distance from pivot i to that edge
    r2 = s_l * s_l + 2.0 * p_l * d_l * v + e * (e + 2.0 * d_l * s)
    r1 = math.sqrt(r2)
    up = r1 + d_l * s + e  # the distance plus the height of the edge over the pivot
    q = 1.0 / (r2 * up)  # the only division, as divisions are slow
    inv_r2 = q * up
    lift, c = p_l * v + e * s - s_l, 1.0 - v  # d - p cos θ + e sin θ
    omega = d_l * lift * inv_r2
    ratio = d_l * (lift - mu * p_l * s - mu * e * c) * inv_r2
    x = s_l + d_l * v
    s_0 = x * r1 * inv_r2
    v_0 = x * x * q * r1
    if uneven:
        bend = d_l * (p_l * s + e * c) * (s_l * (p_l + d_l) + e * e)
    else:
        bend = p_l * d_l * s * s_l * (p_l + d_l)
    psi = bend * (inv_r2 * inv_r2)
    s_i = s_0 - (s_0 * turn_v + (1.0 - v_0) * turn_s)
    v_i = v_0 + turn_v - v_0 * turn_v - s_0 * turn_s
    return s_i, v_i, omega, psi, ratio


@internal
def contact_at(contact, s, v, mu):
    """Return the results of `tip` or `corner` for a contact, at a single angle."""
    if contact.kind == arrays.TIP:
        return tip(s, v, shape_of(contact), mu)
    return corner(s, v, shape_of(contact), mu)
