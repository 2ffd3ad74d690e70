"""Motion of a chain, and forces and impulses between its dominoes."""

import math

import numpy as np

from domino_env.kernels import arrays, fall
from domino_env.kernels.chain import new_arrays, no_tape, ring_length
from domino_env.kernels.contact import at_or_zero, contact_at, past_flush, sin_versine, torque
from domino_env.kernels.jit import always_inline, borrow, entry_point, internal, keep_alive

LAST_ANGLE = 1.55  # [rad] at which the motion of the last leader ends, almost flat
DEEPEST = 400  # dominoes behind the leader whose forces are computed, at most
PIECES = 16  # parts of each fall, at whose ends forces are computed

LOADS = arrays.record_type(  # of each domino over all falls
    contact_force=float,  # least contact force on the next [N/m of width]
    hit_impulse=float,  # least impulse on the next in a hit, and in a face impact [N s/m of width]
    flush_impulse=float,
    floor_friction=float,  # largest coefficient needed to keep it from sliding on the floor
    load=float,  # least load on its pivot over its weight
    flush_loss=float,  # largest fraction of ω lost in a face impact while it led
    margin=float,  # stall margin of its fall
)
GEOMETRY = arrays.record_type(  # of each domino at one instant
    sin=float,  # of its lean from the vertical
    cos=float,
    jac_before=float,  # J with the contacts before an impact, and after it
    jac_after=float,
    torque=float,  # of gravity
    drv=float,  # D
    w=float,
    arm=float,  # A and B of its contact with the next [m]
    arm_next=float,
)


@entry_point
def trace_motion(layout, setting, snapshots):
    """Sample every fall of a chain in equal steps of angle; return the number of falls.

    snapshots: (N, samples + 1) SNAPSHOT to write: angle of the leader, time since it was hit, and
    its angular velocity. A leader that strikes nothing falls to LAST_ANGLE; one that stalls
    remains where it stops.
    """
    count, pieces = len(layout.thickness), snapshots.shape[1] - 1
    own = new_arrays(layout, ring_length(count), setting, True)
    states, lanes, ring = borrow(own)
    state, tape, falls = states[0], no_tape(), 0
    fall.start_chain(layout, ring, state)
    for n in range(count):
        falls = n + 1
        strikes = fall.strikes_next(layout, n)
        fall.add_next_domino(layout, ring, state, n)
        u_start = fall.begin_fall(ring, state, n)
        b = fall.fall_angle(ring[n & state.mask], True) if strikes else LAST_ANGLE
        snapshots[n, 0].speed = math.sqrt(state.u)
        outcome = arrays.PROPAGATED
        for j in range(1, pieces + 1):
            a = b * (j - 1) / pieces
            previous, here = snapshots[n, j - 1], snapshots[n, j]
            outcome = fall.fall(lanes, ring, n, state, a, b * j / pieces, tape)
            if outcome != arrays.PROPAGATED:  # as if uniformly decelerated until it stops
                duration = 2.0 * max(state.angle - a, 0.0) / max(previous.speed, arrays.TINY)
                for i in range(j, pieces + 1):
                    snapshots[n, i].angle = max(state.angle, a)
                    snapshots[n, i].time = previous.time + duration
                break
            here.angle, here.time, here.speed = b * j / pieces, state.fall_time, math.sqrt(state.u)
        if outcome != arrays.PROPAGATED or not strikes:
            break
        if fall.close_fall(ring, state, n, b, u_start, True, outcome) != arrays.PROPAGATED:
            break
    keep_alive(own)
    return falls


@always_inline
def from_vertical(layout, i, s, c):
    """Return sin and cos of the lean of domino i from the vertical; s, c: sin θ_i and cos θ_i."""
    sine, cosine = math.sin(at_or_zero(layout.tilt, i)), math.cos(at_or_zero(layout.tilt, i))
    return s * cosine + c * sine, c * cosine - s * sine


@always_inline
def to_ground(layout, i, x, z):
    """Return the components of a force (x, z) along the ground under domino i and normal to it."""
    sine, cosine = math.sin(at_or_zero(layout.tilt, i)), math.cos(at_or_zero(layout.tilt, i))
    return x * cosine - z * sine, x * sine + z * cosine


@always_inline
def mass_of(layout, domino, i):
    """Return the mass of domino i, per unit of width."""
    s, c = from_vertical(layout, i, 0.0, 1.0)
    return 2.0 * domino.half_weight / (layout.height[i] * c + layout.thickness[i] * s)


@always_inline
def tip_omega(contact, s, v):
    """Return Ω of a contact at the tip at the instant when the faces meet."""
    return 1.0 - contact.p_l * s - arrays.rise_of(contact) * (1.0 - v)


@always_inline
def arm_behind(contact, s, v, mu):
    """Return A of a contact over the height of the domino behind."""
    e = arrays.rise_of(contact)
    if contact.kind == arrays.TIP:
        lost = contact.p_l * v + e * s
        sd = contact.s_l - lost
        return math.sqrt(max((1.0 + sd) * (contact.rest + lost), arrays.TINY)) + mu * sd
    s_l, d_l = contact.s_l, contact.d_l
    return math.sqrt(s_l * s_l + 2.0 * contact.p_l * d_l * v + e * (e + 2.0 * d_l * s))


@internal
def stack_geometry(layout, ring, state, n, low, angle, geometry, flushing):
    """Write the geometry of dominoes low … n, at an angle of the leader.

    flushing: True in a face impact: its contacts are at the tip before it, at the corner after.
    """
    mask, mu, gravity = state.mask, state.friction, state.gravity
    s, v = sin_versine(angle)
    jac_before, jac_after, drv, w = 1.0, 1.0, 0.0, 1.0
    here = geometry[n]
    here.sin, here.cos = from_vertical(layout, n, s, 1.0 - v)
    here.torque = torque(ring[n & mask], s, v, gravity)
    here.jac_before, here.jac_after = 1.0, 1.0
    here.drv, here.w, here.arm, here.arm_next = 0.0, 1.0, 0.0, 0.0
    for i in range(n - 1, low - 1, -1):
        contact = ring[i & mask]
        s_i, v_i, omega, psi, ratio = contact_at(contact, s, v, mu)
        omega_before = omega
        if flushing and contact.kind == arrays.CORNER:
            past = past_flush(contact, v - contact.v_flush)
            if abs(past) <= 2.0 * arrays.IMPACT_TOLERANCE:  # the contact takes part in the impact
                omega_before, omega = tip_omega(contact, s, v), 0.0
        drv = omega * drv + psi * jac_after * jac_after
        jac_before, jac_after, w = omega_before * jac_before, omega * jac_after, w * ratio
        arm = layout.height[i] * arm_behind(contact, s, v, mu)
        s, v = s_i, v_i
        here = geometry[i]
        here.sin, here.cos = from_vertical(layout, i, s, 1.0 - v)
        here.torque = torque(contact, s, v, gravity)
        here.jac_before, here.jac_after = jac_before, jac_after
        here.drv, here.w, here.arm, here.arm_next = drv, w, arm, arm * ratio


@internal
def contact_impulses(ring, state, n, low, geometry, speed_before, speed_after, least):
    """Update the least impulses (N,) of contacts by those of a change of the leader's ω."""
    impulse, arm_back = 0.0, 0.0
    for i in range(low, n):
        here = geometry[i]
        change = here.jac_after * speed_after - here.jac_before * speed_before
        momentum = ring[i & state.mask].inertia * change
        impulse = (arm_back * impulse - momentum) / here.arm
        least[i] = min(least[i], impulse)
        arm_back = here.arm_next


@internal
def contact_forces(layout, ring, state, n, low, geometry, loads):
    """Update contact forces, loads on pivots and floor friction by those at one instant."""
    mask, mu, gravity, u = state.mask, state.friction, state.gravity, state.u
    sum_m, sum_g, sum_d = 0.0, 0.0, 0.0
    for i in range(low, n + 1):
        domino, here = ring[i & mask], geometry[i]
        sum_m += here.w * domino.inertia * here.jac_after
        sum_g += here.w * here.torque
        sum_d += here.w * domino.inertia * here.drv
    alpha_n = (sum_g - u * sum_d) / sum_m
    force, push_x, push_z, arm_back = 0.0, 0.0, 0.0, 0.0
    for i in range(low, n + 1):
        domino, here, load = ring[i & mask], geometry[i], loads[i]
        s, c = here.sin, here.cos
        alpha = here.jac_after * alpha_n + here.drv * u
        omega2 = here.jac_after * here.jac_after * u
        back_x, back_z, push_x, push_z = push_x, push_z, 0.0, 0.0
        if i < n:
            force = (here.torque - domino.inertia * alpha + arm_back * force) / here.arm
            load.contact_force = min(load.contact_force, force)
            # normal force and friction on i+1; the normal is that of the face of the contact
            face = geometry[i + 1 if domino.kind == arrays.TIP else i]
            push_x = force * (face.cos - mu * face.sin)
            push_z = force * (-face.sin - mu * face.cos)
            arm_back = here.arm_next
        mass, height, thickness = mass_of(layout, domino, i), layout.height[i], layout.thickness[i]
        x = 0.5 * (height * s - thickness * c)  # of the centre from the pivot
        z = 0.5 * (height * c + thickness * s)
        floor_x = mass * (alpha * z - omega2 * x) - back_x + push_x
        floor_z = mass * (gravity - alpha * x - omega2 * z) - back_z + push_z
        floor_x, floor_z = to_ground(layout, i, floor_x, floor_z)
        load.load = min(load.load, floor_z / (mass * gravity))
        needed = abs(floor_x) / floor_z if floor_z > 0.0 else np.inf
        load.floor_friction = max(load.floor_friction, needed)


@entry_point
def diagnose_chain(layout, setting, loads):
    """Simulate a chain and write loads (N,); return the outcome.

    Before, the least values must be inf, and the largest floor friction -inf.
    """
    count = len(layout.thickness)
    own, geometry = new_arrays(layout, ring_length(count), setting, True), np.zeros(count, GEOMETRY)
    layout, states, lanes, ring = borrow((layout, *own))
    state, tape, outcome = states[0], no_tape(), arrays.PROPAGATED
    fall.start_chain(layout, ring, state)
    for n in range(count):
        strikes = fall.strikes_next(layout, n)
        fall.add_next_domino(layout, ring, state, n)
        u_start = fall.begin_fall(ring, state, n)
        state.flush_loss = 0.0
        b = fall.fall_angle(ring[n & state.mask], strikes)
        for piece in range(PIECES + 1):
            at = b * piece / PIECES
            if piece > 0:
                flushes, lost = state.flushes, state.flush_loss
                outcome = fall.fall(lanes, ring, n, state, b * (piece - 1) / PIECES, at, tape)
                if outcome != arrays.PROPAGATED:
                    break
                if state.flushes > flushes:
                    low, least = max(state.back, n - DEEPEST), loads["flush_impulse"]
                    stack_geometry(layout, ring, state, n, low, state.switch_angle, geometry, True)
                    contact_impulses(
                        ring, state, n, low, geometry, state.speed_before, state.speed_after, least
                    )
                state.flush_loss = max(lost, state.flush_loss)
            low = max(state.back, n - DEEPEST)
            stack_geometry(layout, ring, state, n, low, at, geometry, False)
            contact_forces(layout, ring, state, n, low, geometry, loads)
        loads[n].flush_loss = state.flush_loss
        speed = math.sqrt(state.u)
        outcome = fall.close_fall(ring, state, n, b, u_start, strikes, outcome)
        loads[n].margin = state.margin
        if outcome == arrays.PROPAGATED and not strikes and n + 1 < count:
            outcome = arrays.OUT_OF_REACH
        if outcome != arrays.PROPAGATED or not strikes:
            break
        low = max(state.back, n + 1 - DEEPEST)
        stack_geometry(layout, ring, state, n + 1, low, 0.0, geometry, False)
        # before the hit ω_i is J_i of the new stack times ω_n / Ω_n
        speed /= fall.omega_at_hit(ring[n & state.mask])
        contact_impulses(
            ring, state, n + 1, low, geometry, speed, math.sqrt(state.u), loads["hit_impulse"]
        )
    keep_alive(own)
    keep_alive(geometry)
    return outcome
