"""Chains looked at while they fall: motion, and forces and impulses between the dominoes."""

import math

import numpy as np

from domino_env.kernels.arrays import (
    CORNER,
    EVENT,
    LANES,
    OUT_OF_REACH,
    PROPAGATED,
    STATE,
    TINY,
    TIP,
    TOGETHER,
    record_type,
    rise_of,
)
from domino_env.kernels.chain import ring_length
from domino_env.kernels.contact import at_or_zero, contact_at, new_ring, past_flush, sin_versine
from domino_env.kernels.fall import (
    add_next_domino,
    begin_fall,
    close_fall,
    extend_tail,
    fall,
    fall_angle,
    hit_ratio,
    start_chain,
)
from domino_env.kernels.jit import always_inline, entry_point, internal, keep_alive

LAST_ANGLE = 1.55  # [rad] where the last leader is left, all but flat


@entry_point
def trace_motion(layout, mu, gravity, push, rtol, snapshots):
    """A chain looked at in equal steps of angle in every fall; returns how many falls there were.

    snapshots: (N, looks + 1) leader's angle, time since it was hit, and its angular velocity.  A
    leader that strikes nothing falls on to FLOOR; one that stalls is left where it stops.
    """
    count, pieces = len(layout.thickness), snapshots.shape[1] - 1
    own_state, ring = np.zeros(1, STATE), new_ring(layout, ring_length(count))
    lanes, state, mask = np.zeros(LANES), own_state[0], len(ring) - 1
    no_tape = np.empty(0, EVENT)
    start_chain(layout, push, ring, state)
    falls = 0
    for n in range(count):
        falls = n + 1
        strikes = n + 1 < count and layout.spacing[n] < layout.height[n]
        add_next_domino(layout, ring, mask, n, state)
        extend_tail(ring, mask, n)
        released = begin_fall(ring[n & mask], mu, gravity, state)
        b = fall_angle(ring[n & mask], True) if strikes else LAST_ANGLE
        snapshots[n, 0].speed = math.sqrt(state.u)
        outcome = PROPAGATED
        for j in range(1, pieces + 1):
            a = b * (j - 1) / pieces
            before, here = snapshots[n, j - 1], snapshots[n, j]
            outcome = fall(
                lanes, ring, mask, n, a, b * j / pieces, mu, gravity, rtol, state, True, no_tape
            )
            if outcome != PROPAGATED:  # it comes to rest as a stone does at the top of its flight
                rest = 2.0 * max(state.angle - a, 0.0) / max(before.speed, TINY)
                for i in range(j, pieces + 1):
                    snapshots[n, i].angle = max(state.angle, a)
                    snapshots[n, i].time = before.time + rest
                break
            here.angle, here.time, here.speed = b * j / pieces, state.fall_time, math.sqrt(state.u)
        if outcome != PROPAGATED or not strikes:
            break
        if close_fall(ring, mask, n, b, released, True, mu, state, outcome) != PROPAGATED:
            break
    keep_alive(own_state)
    keep_alive(ring)
    return falls


DEEPEST = 400  # dominoes behind the leader whose forces are followed
PIECES = 16  # looks at the stack in each fall

LOADS = record_type(  # of each domino
    contact_force=float,  # least contact force on the next [N/m of width]
    hit_impulse=float,  # least impulse on it at a hit, and at a flush [N s/m]
    flush_impulse=float,
    floor_friction=float,  # coefficient that keeps it from sliding on the floor, at most
    load=float,  # least load on its pivot over its weight
    flush_loss=float,  # largest part of speed lost in a flush while it led
    margin=float,  # stall margin of its fall
)
GEOMETRY = record_type(  # of each domino at one instant
    sin=float,
    cos=float,
    before=float,  # J with the contacts as they were, and as they are
    after=float,
    lever=float,  # of its weight about the pivot, over half its height
    drv=float,  # D
    w=float,
    arm=float,  # A and B of its contact with the next [m]
    arm_next=float,
)


@always_inline
def upright(layout, i, s, c):
    """sin and cos of the lean of domino i from the vertical."""
    sine, cosine = math.sin(at_or_zero(layout.tilt, i)), math.cos(at_or_zero(layout.tilt, i))
    return s * cosine + c * sine, c * cosine - s * sine


@always_inline
def to_ground(layout, i, x, z):
    """A force along the ground under domino i, and upright to it."""
    sine, cosine = math.sin(at_or_zero(layout.tilt, i)), math.cos(at_or_zero(layout.tilt, i))
    return x * cosine - z * sine, x * sine + z * cosine


@always_inline
def mass_of(layout, domino, i):
    """Mass of domino i, per unit of width."""
    s, c = upright(layout, i, 0.0, 1.0)
    return 2.0 * domino.half_weight / (layout.height[i] * c + layout.thickness[i] * s)


@always_inline
def tip_ratio(contact, s, v):
    """Ω of a tip whose faces are flush."""
    return 1.0 - contact.p_l * s - rise_of(contact) * (1.0 - v)


@always_inline
def arm_behind(contact, s, v, mu):
    """A over the height of the domino behind."""
    e = rise_of(contact)
    if contact.kind == TIP:
        lost = contact.p_l * v + e * s
        sd = contact.s_l - lost
        return math.sqrt(max((1.0 + sd) * (contact.rest + lost), TINY)) + mu * sd
    return math.sqrt(
        contact.s_l**2 + 2.0 * contact.p_l * contact.d_l * v + e * (e + 2.0 * contact.d_l * s)
    )


@internal
def stack_geometry(layout, ring, mask, n, low, angle, mu, geometry, flushing):
    """The geometry of dominoes low … n.

    flushing: links whose faces are flush have tip contact before and corner contact after.
    """
    s, v = sin_versine(angle)
    before, after, drv, w = 1.0, 1.0, 0.0, 1.0
    here = geometry[n]
    here.sin, here.cos = upright(layout, n, s, 1.0 - v)
    here.lever = s - ring[n & mask].slender * (1.0 - v)
    here.before, here.after = 1.0, 1.0
    here.drv, here.w, here.arm, here.arm_next = 0.0, 1.0, 0.0, 0.0
    for i in range(n - 1, low - 1, -1):
        contact = ring[i & mask]
        s_i, v_i, omega, psi, ratio = contact_at(contact, s, v, mu)
        old = omega
        if flushing and contact.kind == CORNER:
            over = past_flush(contact, v - contact.v_flush)
            if abs(over) <= 2.0 * TOGETHER:
                old, omega = tip_ratio(contact, s, v), 0.0
        drv = omega * drv + psi * after * after
        before, after, w = old * before, omega * after, w * ratio
        arm = layout.height[i] * arm_behind(contact, s, v, mu)
        s, v = s_i, v_i
        here = geometry[i]
        here.sin, here.cos = upright(layout, i, s, 1.0 - v)
        here.lever = s - contact.slender * (1.0 - v)
        here.before, here.after = before, after
        here.drv, here.w, here.arm, here.arm_next = drv, w, arm, arm * ratio


@internal
def contact_impulses(ring, mask, n, low, geometry, gain_before, gain_after, least):
    """Least impulse (N,) of each contact when the leader goes from one speed to another."""
    passed, arm_back = 0.0, 0.0
    for i in range(low, n):
        here = geometry[i]
        turn = ring[i & mask].inertia * (here.after * gain_after - here.before * gain_before)
        passed = (arm_back * passed - turn) / here.arm
        least[i] = min(least[i], passed)
        arm_back = here.arm_next


@internal
def contact_forces(layout, ring, mask, n, low, geometry, u, gravity, mu, loads):
    """Least contact forces and loads on the pivots, at one instant."""
    m, g, d = 0.0, 0.0, 0.0
    for i in range(low, n + 1):
        domino, here = ring[i & mask], geometry[i]
        weight = gravity * domino.half_weight * here.lever
        m += here.w * domino.inertia * here.after
        g += here.w * weight
        d += here.w * domino.inertia * here.drv
    lead = (g - u * d) / m
    force, push_x, push_z, arm_back = 0.0, 0.0, 0.0, 0.0
    for i in range(low, n + 1):
        domino, here, load = ring[i & mask], geometry[i], loads[i]
        s, c = here.sin, here.cos
        weight = gravity * domino.half_weight * here.lever
        alpha = here.after * lead + here.drv * u
        omega2 = here.after * here.after * u
        back_x, back_z = push_x, push_z
        push_x, push_z = 0.0, 0.0
        if i < n:
            force = (weight - domino.inertia * alpha + arm_back * force) / here.arm
            load.contact_force = min(load.contact_force, force)
            # normal and friction on i+1, along the face that is slid upon
            face = geometry[i + 1 if domino.kind == TIP else i]
            push_x = force * (face.cos - mu * face.sin)
            push_z = force * (-face.sin - mu * face.cos)
            arm_back = here.arm_next
        mass, height, thickness = mass_of(layout, domino, i), layout.height[i], layout.thickness[i]
        x = 0.5 * (height * s - thickness * c)
        z = 0.5 * (height * c + thickness * s)
        floor_x = mass * (alpha * z - omega2 * x) - back_x + push_x
        floor_z = mass * (gravity - alpha * x - omega2 * z) - back_z + push_z
        floor_x, floor_z = to_ground(layout, i, floor_x, floor_z)
        load.load = min(load.load, floor_z / (mass * gravity))
        least_start = abs(floor_x) / floor_z if floor_z > 0.0 else np.inf
        load.floor_friction = max(load.floor_friction, least_start)


@entry_point
def diagnose_chain(layout, mu, gravity, push, rtol, loads):
    """A chain with its forces looked at; returns how it ended.  loads: (N,)."""
    count, ring = len(layout.thickness), new_ring(layout, ring_length(len(layout.thickness)))
    own_state, geometry = np.zeros(1, STATE), np.zeros(count, GEOMETRY)
    lanes, state, mask = np.zeros(LANES), own_state[0], len(ring) - 1
    no_tape = np.empty(0, EVENT)
    start_chain(layout, push, ring, state)
    outcome = PROPAGATED
    for n in range(count):
        strikes = n + 1 < count and layout.spacing[n] < layout.height[n]
        add_next_domino(layout, ring, mask, n, state)
        extend_tail(ring, mask, n)
        released = begin_fall(ring[n & mask], mu, gravity, state)
        state.flush_loss = 0.0
        b = fall_angle(ring[n & mask], strikes)
        for piece in range(PIECES + 1):
            at = b * piece / PIECES
            if piece > 0:
                flushes, lost = state.flushes, state.flush_loss
                came_from = b * (piece - 1) / PIECES
                outcome = fall(
                    lanes, ring, mask, n, came_from, at, mu, gravity, rtol, state, True, no_tape
                )
                if outcome != PROPAGATED:
                    break
                if state.flushes > flushes:
                    low = max(state.back, n - DEEPEST)
                    stack_geometry(layout, ring, mask, n, low, state.switched, mu, geometry, True)
                    contact_impulses(
                        ring, mask, n, low, geometry, state.w_before, state.w_after,
                        loads["flush_impulse"],
                    )  # fmt: skip
                state.flush_loss = max(lost, state.flush_loss)
            low = max(state.back, n - DEEPEST)
            stack_geometry(layout, ring, mask, n, low, at, mu, geometry, False)
            contact_forces(layout, ring, mask, n, low, geometry, state.u, gravity, mu, loads)
        loads[n].flush_loss = state.flush_loss
        speed_before = math.sqrt(state.u)
        outcome = close_fall(ring, mask, n, b, released, strikes, mu, state, outcome)
        loads[n].margin = state.margin
        if outcome == PROPAGATED and not strikes and n + 1 < count:
            outcome = OUT_OF_REACH
        if outcome != PROPAGATED or not strikes:
            break
        speed_after = math.sqrt(state.u)
        low = max(state.back, n + 1 - DEEPEST)
        stack_geometry(layout, ring, mask, n + 1, low, 0.0, mu, geometry, False)
        speed_before /= hit_ratio(ring[n & mask])  # as its speed reads in the new stack
        contact_impulses(
            ring, mask, n + 1, low, geometry, speed_before, speed_after, loads["hit_impulse"]
        )
    keep_alive(own_state)
    keep_alive(ring)
    keep_alive(geometry)
    return outcome
