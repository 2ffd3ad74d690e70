"""Non-smooth mechanics of a chain: boxes, contacts that open, stick and slip, small time steps.

This is Moreau's time stepping. Velocities half a step ahead, v+, follow from those half a step
behind, v, by v+ = v + (h f + impulses of the contacts) / m, with the contacts that are closed half
a step ahead. At each of them

    0 <= normal impulse  ⟂  normal velocity after the step >= 0         (no restitution)
    |tangential impulse| <= friction * normal impulse, against sliding  (Coulomb)

Projected Gauss-Seidel sweeps, forward and backward along the chain, solve these conditions,
starting from the impulses of the last step. Then positions change by h v+. Impulses act in the
directions at the beginning of the step. As in the leapfrog method with constraints, smooth motion
has an error of second order. A step ends when a tip reaches the next domino, and the impact is a
step of length 0. No contact is assumed to be closed, and the analytic model is not used.

The reference point of a box is its centre if it is free-standing. If it turns about a fixed pivot,
it is this pivot, the front bottom edge. Leans and angular velocities are positive towards +x: a
point (rx, ry) from the reference point moves with (vx + omega ry, vy - omega rx).

J. J. Moreau (1988), Unilateral contact and dry friction in finite freedom dynamics, and M. Jean
(1999), The non-smooth contact dynamics method, Comput. Methods Appl. Mech. Engrg. 177, 235-257.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from domino_env.kernels.jit import compile_alone

# contacts of a domino: with the floor at its rear and front bottom edge and its front top edge,
# its tip with the rear face of the next, the next one's rear bottom edge with its front face
REAR, FRONT, LYING, TIP, CORNER = range(5)
KINDS = 5
FLOOR = -1  # second partner of a contact with the floor
# faces of a domino that a vertex of its neighbour meets: front or rear; top or bottom; the one that
# the vertex is farther outside of
LARGE_FACE, END_FACE, EITHER = 0, 1, -1
FIXED_PIVOTS = -1.0  # in place of the friction of a floor
MAX_SWEEPS = 4096  # of a step
STAGNATION = 0.98  # of the change after half as many sweeps: the sweeps end above it
MAX_TURN = 2.5e-3  # [rad] largest turn of the leader in a step of coarseness 1
MAX_STEP = 2.3e-3  # [√(L/g)] longest step of coarseness 1
FIRST_CHECK = 64  # sweeps before stagnation is tested; the number is doubled after each test
TOUCHING = 1e-6  # of the height: contacts with smaller gaps are closed
AT_REST = 1e-5  # [rad] the last domino has come to rest if its lean grows by less
RUNNING, ENDED, FAILED = range(3)  # states of a run; failed: a velocity is not a number

# Normal (n) and tangential (t) direction of a contact: x, y, turn of the first domino, and turn of
# the second
DIRECTIONS = np.dtype([(f"{d}{part}", np.float64) for d in "nt" for part in ("x", "y", "w", "w2")])
# Closed contact. velocity: coefficients of its velocities; impulse: directions of its impulses.
# normal, tangential: response of each velocity to its own unit impulse, and their inverses; cross:
# of the tangential velocity to a normal impulse. friction: coefficient.
RESPONSES = ("normal", "cross", "tangential", "friction", "per_normal", "per_tangential")
CONTACT = np.dtype(
    [("velocity", DIRECTIONS), ("impulse", DIRECTIONS)] + [(name, np.float64) for name in RESPONSES]
)


# Standing dominoes: lengths (N,) [m]; mass [kg/m] and inertia about the reference point [kg m] per
# width (N,); front bottom edges (N, 2) [m]; slope of the ground (N,) [rad], its sine and cosine
# (N, 2); the front bottom edge from the reference point of an upright domino (N, 2) [m]
Bodies = namedtuple("Bodies", "height thickness mass inertia pivots tilt slope edge")

# Settings of a run: friction between dominoes; friction of the floor, or FIXED_PIVOTS; gravity
# [m/s²]; coarseness, the steps over those of MAX_TURN and MAX_STEP; change of velocity at which
# sweeps end [m/s]; dominoes behind the leader that still move; time without progress after which
# the run ends [s]
Setting = namedtuple("Setting", "friction floor gravity coarseness tolerance window patience")

# Results: arrival times (N,) [s]; largest leans (N,) [rad]; largest slips (N,) [m]; largest opening
# of the contact with the next domino after it had closed (N-1,) [m], and its time (N-1,) [s]
Record = namedtuple("Record", "arrival_times lean slid opened opened_at")

# All that changes: place (N, 3), x and y of the reference point and lean; velocity (N, 3); inverse
# mass and inertia (N,), 0 for dominoes held at rest; impulse (N, KINDS, 2), normal and tangential;
# poses now and half a step ahead (N, 4), x, y, sine and cosine of the lean; gaps (N,) of the nearer
# contact with the next, inf where neither face is met; CONTACT of closed contacts; their partners,
# first domino, second or FLOOR, kind; velocities of moving dominoes before the step; (1,) of RUN
State = namedtuple(
    "State",
    "place velocity inverse_mass inverse_inertia impulse now mid gaps contact partners before run",
)

# First domino that still moves, leader, number of steps; time [s], time of the last progress [s],
# lean of the last domino then [rad], length of the last step [s], its kick (the time from velocity
# to velocity, half a step behind to half a step ahead) [s], share of a full step to take next (0:
# an impact), distance from the leader's tip to the next domino [m]
COUNTS = ("low", "leader", "steps")
NUMBERS = ("time", "progress", "last_lean", "last_step", "last_kick", "share", "tip_gap")
RUN = np.dtype([(name, np.int64) for name in COUNTS] + [(name, np.float64) for name in NUMBERS])


def start(bodies: Bodies, setting: Setting, push: float) -> State:
    """Return the state at the push.

    Parameters
    ----------
    bodies
        Standing dominoes.
    setting
        Settings of the run.
    push
        Angular velocity of the first domino about its front bottom edge [rad/s].

    Returns
    -------
    State
        The first domino moves; the others are held at rest until they are hit.
    """
    count, fixed = len(bodies.height), setting.floor == FIXED_PIVOTS
    sine, cosine = bodies.slope[:, 0], bodies.slope[:, 1]
    ex, ey = bodies.edge[:, 0], bodies.edge[:, 1]
    x = bodies.pivots[:, 0] - ex * cosine - ey * sine
    y = bodies.pivots[:, 1] + ex * sine - ey * cosine
    velocity, inverse_mass, inverse_inertia = np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    velocity[0, 2], inverse_inertia[0] = push, 1.0 / bodies.inertia[0]
    if not fixed:
        velocity[0, 0] = push * (y[0] - bodies.pivots[0, 1])
        velocity[0, 1] = push * (bodies.pivots[0, 0] - x[0])
        inverse_mass[0] = 1.0 / bodies.mass[0]
    capacity = KINDS * (setting.window + 3)
    place = np.stack((x, y, bodies.tilt), axis=-1)
    run = np.zeros(1, RUN)
    run["share"][0] = 1.0
    run["tip_gap"][0] = _tip_gap(0, place, velocity, 0.0, bodies) if count > 1 else 0.0
    return State(
        place, velocity, inverse_mass, inverse_inertia, np.zeros((count, KINDS, 2)),
        np.zeros((count, 4)), np.zeros((count, 4)), np.full(count, np.inf),
        np.zeros(capacity, CONTACT), np.zeros((capacity, 3), np.int64),
        np.zeros((setting.window + 3, 3)), run,
    )  # fmt: skip


@compile_alone
def advance(bodies, setting, state, record, most_steps):
    """Advance a run by some steps, unless it ends before.

    Parameters
    ----------
    bodies, setting
        As for `start`.
    state
        State, which is overwritten.
    record
        Results so far, which are updated; arrival times are inf where a domino is not yet hit.
    most_steps
        Largest number of steps.

    Returns
    -------
    int
        RUNNING, ENDED or FAILED.
    """
    run = state.run[0]
    place, velocity, impulse = state.place, state.velocity, state.impulse
    fixed, last = setting.floor == FIXED_PIVOTS, len(bodies.height) - 1
    scale = math.sqrt(bodies.height.max() / setting.gravity)
    for _ in range(most_steps):
        low, leader = run.low, run.leader
        # 1e-9 rad/s: a leader at rest or in reverse takes the longest step
        longest = min(MAX_STEP * scale, MAX_TURN / max(velocity[leader, 2], 1e-9))
        step = run.share * setting.coarseness * longest
        kick = 0.5 * (run.last_step + step)
        for i in range(max(low - 1, 0), leader + 1):
            _pose(state.now, i, place, velocity, 0.0)
            _pose(state.mid, i, place, velocity, 0.5 * step)
        for i in range(low, leader + 1):
            state.before[i - low] = velocity[i]
            if fixed:
                sine, cosine = state.now[i, 2], state.now[i, 3]
                arm = 0.5 * (bodies.height[i] * sine - bodies.thickness[i] * cosine)
                moment = kick * bodies.mass[i] * setting.gravity * arm
                velocity[i, 2] += moment * state.inverse_inertia[i]
            else:
                velocity[i, 1] -= kick * setting.gravity
        closed = _find_contacts(bodies, setting, state)
        ratio = kick / run.last_kick if run.last_kick > 0.0 else 0.0
        for c in range(closed):
            i, kind = state.partners[c, 0], state.partners[c, 2]
            impulse[i, kind] *= ratio
            _apply_impulse(state, c, impulse[i, kind, 0], impulse[i, kind, 1])
        _sweep(state, closed, setting.tolerance)
        run.steps, run.last_kick = run.steps + 1, kick
        if not math.isfinite(velocity[leader, 2]):
            return FAILED
        hit = False
        if leader < last:
            after = _tip_gap(leader, place, velocity, step, bodies)
            if after <= 0.0 < run.tip_gap and run.share == 1.0:
                # the step is repeated, so that it ends with the hit
                run.share = run.tip_gap / (run.tip_gap - after)
                for i in range(low, leader + 1):
                    velocity[i] = state.before[i - low]
                continue
            hit = after <= 0.0 or 0.0 < run.share < 1.0
            run.tip_gap = after
        for i in range(low, leader + 1):
            for k in range(3):
                place[i, k] += step * velocity[i, k]
            record.lean[i] = max(record.lean[i], place[i, 2])
            slip = abs(_distance_ahead(i, 0.0, i, place, velocity, 0.0, bodies))
            record.slid[i] = max(record.slid[i], slip)
            if i < leader and record.opened[i] < state.gaps[i] < np.inf:
                record.opened[i], record.opened_at[i] = state.gaps[i], run.time
        run.time, run.last_step, run.share = run.time + step, step, 1.0
        if hit:
            run.leader = leader = leader + 1
            record.arrival_times[leader] = run.progress = run.time
            run.share, run.last_lean = 0.0, place[leader, 2]
            state.inverse_inertia[leader] = 1.0 / bodies.inertia[leader]
            state.inverse_mass[leader] = 0.0 if fixed else 1.0 / bodies.mass[leader]
            if leader - low >= setting.window:
                state.inverse_mass[low] = state.inverse_inertia[low] = 0.0
                velocity[low] = 0.0
                run.low = low + 1
            if leader < last:
                run.tip_gap = _tip_gap(leader, place, velocity, 0.0, bodies)
        elif leader == last:
            if place[last, 2] > math.atan2(bodies.thickness[last], bodies.height[last]):
                return ENDED
            if place[last, 2] > run.last_lean + AT_REST:
                run.last_lean, run.progress = place[last, 2], run.time
        if run.time - run.progress > setting.patience:
            return ENDED
    return RUNNING


@compile_alone
def _pose(pose, i, place, velocity, later):
    """Write x, y, sine and cosine of the lean of i, at a time later [s]."""
    lean = place[i, 2] + later * velocity[i, 2]
    pose[i, 0] = place[i, 0] + later * velocity[i, 0]
    pose[i, 1] = place[i, 1] + later * velocity[i, 1]
    pose[i, 2], pose[i, 3] = math.sin(lean), math.cos(lean)


@compile_alone
def _distance_ahead(i, up, j, place, velocity, later, bodies):
    """Return the distance of a point ahead of the pivot of j along the ground, some time later [m].

    The point is on the front face of i, `up` [m] above its bottom edge.
    """
    lean = place[i, 2] + later * velocity[i, 2]
    sine, cosine = math.sin(lean), math.cos(lean)
    ex, ey = bodies.edge[i, 0], bodies.edge[i, 1] + up
    x, y = place[i, 0] + later * velocity[i, 0], place[i, 1] + later * velocity[i, 1]
    dx = x + ex * cosine + ey * sine - bodies.pivots[j, 0]
    dy = y - ex * sine + ey * cosine - bodies.pivots[j, 1]
    return dx * bodies.slope[j, 1] - dy * bodies.slope[j, 0]


@compile_alone
def _tip_gap(i, place, velocity, later, bodies):
    """Return the distance of the tip of i from the rear face of the next, some time later [m]."""
    ahead = _distance_ahead(i, bodies.height[i], i + 1, place, velocity, later, bodies)
    return -ahead - bodies.thickness[i + 1]


@compile_alone
def _find_contacts(bodies, setting, state):
    """Write the contacts that are closed half a step ahead; return their number."""
    closed, low, leader = 0, state.run[0].low, state.run[0].leader
    fixed, now, mid, gaps = setting.floor == FIXED_PIVOTS, state.now, state.mid, state.gaps
    for i in range(max(low - 1, 0), leader + 1):
        sine, cosine = bodies.slope[i, 0], bodies.slope[i, 1]
        for kind in range(REAR, TIP):
            if i < low or (fixed and kind == FRONT):
                continue
            px = bodies.edge[i, 0] - (bodies.thickness[i] if kind == REAR else 0.0)
            py = bodies.edge[i, 1] + (bodies.height[i] if kind == LYING else 0.0)
            rx, ry = px * mid[i, 3] + py * mid[i, 2], -px * mid[i, 2] + py * mid[i, 3]
            gap = (mid[i, 0] + rx - bodies.pivots[i, 0]) * sine
            gap += (mid[i, 1] + ry - bodies.pivots[i, 1]) * cosine
            if gap > TOUCHING * bodies.height[i]:
                state.impulse[i, kind] = 0.0
                continue
            contact = state.contact[closed]
            _write_directions(contact.velocity, sine, cosine, rx, ry, 0.0, 0.0)
            rx, ry = px * now[i, 3] + py * now[i, 2], -px * now[i, 2] + py * now[i, 3]
            _write_directions(contact.impulse, sine, cosine, rx, ry, 0.0, 0.0)
            _write_responses(state, closed, i, FLOOR, kind, 0.0 if fixed else setting.floor)
            closed += 1
        if i == leader:
            break
        gaps[i] = np.inf
        for kind in range(TIP, KINDS):
            contact = state.contact[closed]
            gap, met, face = _detect(contact.velocity, kind, i, EITHER, mid, bodies)
            if met:
                gaps[i] = min(gaps[i], gap)
            if gap > TOUCHING * bodies.height[i] or not met:
                state.impulse[i, kind] = 0.0
                continue
            _detect(contact.impulse, kind, i, face, now, bodies)
            _write_responses(state, closed, i, i + 1, kind, setting.friction)
            closed += 1
    return closed


@compile_alone
def _write_directions(directions, nx, ny, rx, ry, qx, qy):
    """Write the directions of a contact at r from the first domino and q from the second.

    n: unit vector of its normal.
    """
    directions.nx, directions.ny = nx, ny
    directions.nw, directions.nw2 = ry * nx - rx * ny, qy * nx - qx * ny
    directions.tx, directions.ty = ny, -nx
    directions.tw, directions.tw2 = ry * ny + rx * nx, qy * ny + qx * nx


@compile_alone
def _detect(directions, kind, i, face, pose, bodies):
    """Detect a contact of i with the next, and write its directions.

    The tip of i meets the rear face or the bottom of the next, or the rear bottom edge of the next
    meets the front face or the top of i. The normal points towards i.
    Returns (gap [m], True if the vertex is within the length of the face, face).
    """
    j = i + 1
    owner = j if kind == TIP else i  # of the faces
    sine, cosine = pose[owner, 2], pose[owner, 3]
    rear, bottom = bodies.edge[j, 0] - bodies.thickness[j], bodies.edge[j, 1]
    cx = rear * pose[j, 3] + bottom * pose[j, 2]
    cy = -rear * pose[j, 2] + bottom * pose[j, 3]
    dx, dy = pose[j, 0] - pose[i, 0], pose[j, 1] - pose[i, 1]
    ex, ey = bodies.edge[i, 0], bodies.edge[i, 1]
    if kind == TIP:
        py = ey + bodies.height[i]
        rx, ry = ex * pose[i, 3] + py * pose[i, 2], -ex * pose[i, 2] + py * pose[i, 3]
        qx, qy = rx - dx, ry - dy  # from j
        fx, fy = qx - cx, qy - cy
        ahead, past = -(fx * cosine - fy * sine), -(fx * sine + fy * cosine)
    else:
        qx, qy = cx, cy
        rx, ry = cx + dx, cy + dy
        fx = rx - ex * cosine - ey * sine
        fy = ry + ex * sine - ey * cosine
        ahead, past = fx * cosine - fy * sine, fx * sine + fy * cosine - bodies.height[i]
    if face == EITHER:
        face = LARGE_FACE if ahead >= past else END_FACE
    if face == LARGE_FACE:
        gap, met = ahead, -bodies.height[owner] <= past <= 0.0
        nx, ny = -cosine, sine
    else:
        gap, met = past, -bodies.thickness[owner] <= ahead <= 0.0
        nx, ny = -sine, -cosine
    _write_directions(directions, nx, ny, rx, ry, qx, qy)
    return gap, met, face


@compile_alone
def _write_responses(state, c, i, j, kind, friction):
    """Write partners and friction of a contact, and its responses to unit impulses."""
    contact = state.contact[c]
    state.partners[c, 0], state.partners[c, 1], state.partners[c, 2] = i, j, kind
    contact.friction = friction
    per_mass, per_inertia = state.inverse_mass[i], state.inverse_inertia[i]
    per_mass2 = per_inertia2 = 0.0
    if j != FLOOR:
        per_mass2, per_inertia2 = state.inverse_mass[j], state.inverse_inertia[j]
    per_mass, v, f = per_mass + per_mass2, contact.velocity, contact.impulse
    straight, turn, turn2 = v.nx * f.nx + v.ny * f.ny, per_inertia * v.nw, per_inertia2 * v.nw2
    contact.normal = per_mass * straight + turn * f.nw + turn2 * f.nw2
    straight, turn, turn2 = v.tx * f.nx + v.ty * f.ny, per_inertia * v.tw, per_inertia2 * v.tw2
    contact.cross = per_mass * straight + turn * f.nw + turn2 * f.nw2
    straight = v.tx * f.tx + v.ty * f.ty
    contact.tangential = per_mass * straight + turn * f.tw + turn2 * f.tw2
    contact.per_normal = 1.0 / contact.normal if contact.normal > 0.0 else 0.0
    contact.per_tangential = 1.0 / contact.tangential if contact.tangential > 0.0 else 0.0


@compile_alone
def _apply_impulse(state, c, normal, tangential):
    """Give the two dominoes of a contact an impulse and its reaction."""
    f, velocity = state.contact[c].impulse, state.velocity
    i, j = state.partners[c, 0], state.partners[c, 1]
    px, py = f.nx * normal + f.tx * tangential, f.ny * normal + f.ty * tangential
    turn = f.nw * normal + f.tw * tangential
    velocity[i, 0] += state.inverse_mass[i] * px
    velocity[i, 1] += state.inverse_mass[i] * py
    velocity[i, 2] += state.inverse_inertia[i] * turn
    if j != FLOOR:
        turn = f.nw2 * normal + f.tw2 * tangential
        velocity[j, 0] -= state.inverse_mass[j] * px
        velocity[j, 1] -= state.inverse_mass[j] * py
        velocity[j, 2] -= state.inverse_inertia[j] * turn


@compile_alone
def _sweep(state, closed, tolerance):
    """Sweep until no contact velocity changes by more than the tolerance, or sweeps stagnate."""
    contacts, partners, impulse, v = state.contact, state.partners, state.impulse, state.velocity
    per_mass, per_inertia = state.inverse_mass, state.inverse_inertia
    check, earlier = FIRST_CHECK, np.inf
    for sweep in range(1, MAX_SWEEPS + 1):
        change = 0.0
        for k in range(closed):
            c = k if sweep % 2 else closed - 1 - k
            i, j, kind, contact = partners[c, 0], partners[c, 1], partners[c, 2], contacts[c]
            by, f = contact.velocity, contact.impulse
            x, y, w = v[i, 0], v[i, 1], v[i, 2]
            speed = by.nx * x + by.ny * y + by.nw * w
            slip = by.tx * x + by.ty * y + by.tw * w
            x2 = y2 = w2 = 0.0
            if j != FLOOR:
                x2, y2, w2 = v[j, 0], v[j, 1], v[j, 2]
                speed -= by.nx * x2 + by.ny * y2 + by.nw2 * w2
                slip -= by.tx * x2 + by.ty * y2 + by.tw2 * w2
            normal = max(0.0, impulse[i, kind, 0] - speed * contact.per_normal)
            more_n = normal - impulse[i, kind, 0]
            slip += contact.cross * more_n
            limit = contact.friction * normal
            tangential = impulse[i, kind, 1] - slip * contact.per_tangential
            tangential = min(limit, max(-limit, tangential))
            more_t = tangential - impulse[i, kind, 1]
            impulse[i, kind, 0], impulse[i, kind, 1] = normal, tangential
            px = f.nx * more_n + f.tx * more_t
            py = f.ny * more_n + f.ty * more_t
            v[i, 0] = x + per_mass[i] * px
            v[i, 1] = y + per_mass[i] * py
            v[i, 2] = w + per_inertia[i] * (f.nw * more_n + f.tw * more_t)
            if j != FLOOR:
                v[j, 0] = x2 - per_mass[j] * px
                v[j, 1] = y2 - per_mass[j] * py
                v[j, 2] = w2 - per_inertia[j] * (f.nw2 * more_n + f.tw2 * more_t)
            change = max(change, contact.normal * abs(more_n))
            change = max(change, contact.tangential * abs(more_t))
        if change <= tolerance:
            return
        if sweep == check:
            # the impulses on a domino that is jammed between its neighbour and the floor may grow a
            # little in every sweep, without effect on the others
            if change > STAGNATION * earlier:
                return
            earlier, check = change, 2 * check
