"""Non-smooth mechanics of a row: boxes, contacts that open, rub and slip, small steps of time.

Moreau's time stepping.  Contacts are looked for half a step ahead, and the velocities v there
follow from those half a step behind by v+ = v + (h f + impulses of the contacts) / m, where at
every contact

    0 <= normal impulse  _|_  normal velocity after the step >= 0       (no restitution)
    |tangential impulse| <= friction * normal impulse, against sliding  (Coulomb)

found by projected Gauss-Seidel sweeps, forth and back along the row, from the last step's impulses.
Places move on by h v+.  Impulses act in the directions of the step's beginning and velocities are
judged half a step ahead, as in the leapfrog with constraints: smooth motion is then of second
order.  A step ends where a tip reaches the next domino, and the impact is a step of no length.
Nothing is assumed about which contacts are closed, and nothing here knows the analytic model.

A box is followed by one point of it: where it stands free by its centre, where it is hinged by its
front bottom edge, which then does not move.  Leans and angular velocities are positive towards +x:
a point (rx, ry) from the point followed moves with (vx + omega ry, vy - omega rx).

J. J. Moreau (1988), Unilateral contact and dry friction in finite freedom dynamics, and M. Jean
(1999), The non-smooth contact dynamics method, Comput. Methods Appl. Mech. Engrg. 177, 235-257.
"""

from __future__ import annotations

import math

import numpy as np

from domino_env.kernels.jit import compile_alone

# contacts of a domino: with the floor at its rear and front bottom edge and its front top edge,
# its tip with the rear face of the next, the next one's rear bottom edge with its front face
REAR, FRONT, LYING, TIP, CORNER = range(5)
KINDS = 5
SWEEPS = 4096  # of a step at most
STUCK = 0.98  # of what moved half as many sweeps ago: sweeps lead no further
TURN = 2.5e-3  # [rad] what the leader turns in a step of fineness 1 at most
FALL = 2.3e-3  # of sqrt(L/g), such a step at most
TOUCHING = 1e-6  # of the height: closer contacts are closed
STIR = 1e-5  # [rad] a lean that grows by less has come to rest

# a closed contact's numbers: how its normal and tangential velocity (at 0, 4) are made of those of
# the two dominoes, and in which directions its impulses act (at 8, 12): x, y, turn of the first,
# turn of the second; then what unit impulses change in them, the friction, one over such changes
MOVES, ACTS = 0, 8
NORMAL, CROSS, ACROSS, FRICTION = 16, 17, 18, 19
FIRM, FIRM_ACROSS = 20, 21
NUMBERS = 22


@compile_alone
def follow(
    height, thickness, mass, pivots, tilt, friction, floor, gravity, push,
    fineness, calm, window, patience, times,
    arrivals, lean, slid, opened, opened_at, poses,
):  # fmt: skip
    """Follow a row until its last domino has toppled or nothing more happens.

    Parameters
    ----------
    height, thickness, mass, pivots, tilt
        (N,) of the dominoes; pivots (N, 2) are the places of their front bottom edges, tilt is how
        far the ground under each slopes forward [rad].  Its floor is the plane that it stands on.
    friction, floor
        Between dominoes, and of the floor; a floor below 0 means hinges.
    gravity, push
        As of the physics.
    fineness
        Length of the steps, 1 for the coarsest that make sense.
    calm
        Sweeps end when no velocity moves by more [m/s].
    window
        Dominoes behind the leader that still move.
    patience
        Time without progress after which nothing more is expected [s].
    times
        (F,) at which the row's pose is wanted [s], growing.
    arrivals, lean, slid, opened, opened_at, poses
        Filled: when each is hit; its largest lean; how far its front bottom edge was moved at most;
        how wide the contact with the next opened after it had closed, and when; (F, N, 3) places of
        the front bottom edges and leans at `times`.

    Returns
    -------
    int, int, int
        Steps, sweeps, steps whose sweeps did not come to rest; steps are -1 where a velocity is
        not a number.
    """
    count, hinged = len(height), floor < 0.0
    tallest = height.max()
    x, y, a = np.zeros(count), np.zeros(count), np.zeros(count)
    v = np.zeros((count, 3))
    light, easy = np.zeros(count), np.zeros(count)  # 1/mass, 1/inertia; 0: it does not move
    ex, ey = np.zeros(count), np.zeros(count)  # front bottom edge from the point followed, upright
    slope = np.zeros((count, 2))  # sine and cosine of the tilts
    inertia = np.zeros(count)
    for i in range(count):
        square = height[i] ** 2 + thickness[i] ** 2
        if hinged:
            inertia[i] = mass[i] * square / 3.0
        else:
            ex[i], ey[i] = 0.5 * thickness[i], -0.5 * height[i]
            inertia[i] = mass[i] * square / 12.0
        sine, cosine = math.sin(tilt[i]), math.cos(tilt[i])
        slope[i, 0], slope[i, 1], a[i] = sine, cosine, tilt[i]
        x[i] = pivots[i, 0] - ex[i] * cosine - ey[i] * sine
        y[i] = pivots[i, 1] + ex[i] * sine - ey[i] * cosine
    v[0, 2], easy[0] = push, 1.0 / inertia[0]
    if not hinged:
        v[0, 0], v[0, 1] = push * (y[0] - pivots[0, 1]), push * (pivots[0, 0] - x[0])
        light[0] = 1.0 / mass[0]
    impulse = np.zeros((count, KINDS, 2))
    now_pose, mid_pose = np.zeros((count, 4)), np.zeros((count, 4))  # x, y, sine, cosine of lean
    gaps = np.full(count, np.inf)
    contact = np.zeros((KINDS * (window + 3), NUMBERS))
    who = np.zeros((KINDS * (window + 3), 3), np.int64)
    kept = np.zeros((window + 3, 3))
    low, leader, frame = 0, 0, 0
    now = progress = furthest = 0.0
    last_step = impulses_of = 0.0  # the length of the last step, the kick that impulses belong to
    share = 1.0  # of a full step; 0: an impact
    steps = swept = unsettled = 0
    room = (
        _room(0, x[0], y[0], a[0], ex, ey, height, thickness, pivots, slope) if count > 1 else 0.0
    )
    while True:
        longest = min(FALL * math.sqrt(tallest / gravity), TURN / max(v[leader, 2], 1e-9))
        step = share * fineness * longest
        kick = 0.5 * (last_step + step)
        for i in range(max(low - 1, 0), leader + 1):
            half = 0.5 * step
            _pose(now_pose, i, x[i], y[i], a[i])
            _pose(mid_pose, i, x[i] + half * v[i, 0], y[i] + half * v[i, 1], a[i] + half * v[i, 2])
        for i in range(low, leader + 1):
            kept[i - low] = v[i]
            if hinged:
                arm = 0.5 * (height[i] * now_pose[i, 2] - thickness[i] * now_pose[i, 3])
                v[i, 2] += kick * mass[i] * gravity * arm * easy[i]
            else:
                v[i, 1] -= kick * gravity
        found = _find_contacts(
            low, leader, hinged, friction, floor, now_pose, mid_pose, ex, ey, height, thickness,
            light, easy, pivots, slope, contact, who, impulse, gaps,
        )  # fmt: skip
        grown = kick / impulses_of if impulses_of > 0.0 else 0.0
        for c in range(found):
            i, kind = who[c, 0], who[c, 2]
            impulse[i, kind] *= grown
            _act(contact, who, c, impulse[i, kind, 0], impulse[i, kind, 1], v, light, easy)
        sweeps, rested = _sweep(contact, who, found, impulse, v, light, easy, calm)
        swept, steps, impulses_of = swept + sweeps, steps + 1, kick
        unsettled += not rested
        if not math.isfinite(v[leader, 2]):
            return -1, swept, unsettled
        hit = False
        if leader < count - 1:
            after = _room(
                leader, x[leader] + step * v[leader, 0], y[leader] + step * v[leader, 1],
                a[leader] + step * v[leader, 2], ex, ey, height, thickness, pivots, slope,
            )  # fmt: skip
            if after <= 0.0 < room and share == 1.0:
                share = room / (room - after)  # once more, so that the step ends with the hit
                for i in range(low, leader + 1):
                    v[i] = kept[i - low]
                continue
            hit = after <= 0.0 or 0.0 < share < 1.0
            room = after
        for i in range(low, leader + 1):
            x[i] += step * v[i, 0]
            y[i] += step * v[i, 1]
            a[i] += step * v[i, 2]
            lean[i] = max(lean[i], a[i])
            slid[i] = max(slid[i], abs(_slip(i, x, y, a, ex, ey, pivots, slope)))
            if i < leader and opened[i] < gaps[i] < np.inf:
                opened[i], opened_at[i] = gaps[i], now
        now, last_step, share = now + step, step, 1.0
        while frame < len(times) and times[frame] <= now:
            _photograph(poses[frame], now - times[frame], x, y, a, v, ex, ey)
            frame += 1
        if hit:
            leader += 1
            arrivals[leader] = progress = now
            share, furthest = 0.0, a[leader]
            easy[leader] = 1.0 / inertia[leader]
            light[leader] = 0.0 if hinged else 1.0 / mass[leader]
            if leader - low >= window:
                light[low], easy[low], v[low] = 0.0, 0.0, 0.0
                low += 1
            if leader < count - 1:
                room = _room(
                    leader, x[leader], y[leader], a[leader], ex, ey, height, thickness, pivots,
                    slope,
                )  # fmt: skip
        elif leader == count - 1:
            if a[leader] > math.atan2(thickness[leader], height[leader]) and frame == len(times):
                break
            if a[leader] > furthest + STIR:
                furthest, progress = a[leader], now
        if now - progress > patience and frame == len(times):
            break
    return steps, swept, unsettled


@compile_alone
def _pose(pose, i, x, y, lean):
    pose[i, 0], pose[i, 1], pose[i, 2], pose[i, 3] = x, y, math.sin(lean), math.cos(lean)


@compile_alone
def _room(i, x, y, lean, ex, ey, height, thickness, pivots, slope):
    """From the tip of i, whose point followed and lean are given, to the rear face of the next [m].

    That one still stands.
    """
    sine, cosine = math.sin(lean), math.cos(lean)
    rise = ey[i] + height[i]
    dx = x + ex[i] * cosine + rise * sine - pivots[i + 1, 0]
    dy = y - ex[i] * sine + rise * cosine - pivots[i + 1, 1]
    return dy * slope[i + 1, 0] - dx * slope[i + 1, 1] - thickness[i + 1]


@compile_alone
def _slip(i, x, y, a, ex, ey, pivots, slope):
    """How far the front bottom edge of i is from its place, along the ground [m]."""
    sine, cosine = math.sin(a[i]), math.cos(a[i])
    dx = x[i] + ex[i] * cosine + ey[i] * sine - pivots[i, 0]
    dy = y[i] - ex[i] * sine + ey[i] * cosine - pivots[i, 1]
    return dx * slope[i, 1] - dy * slope[i, 0]


@compile_alone
def _photograph(pose, late, x, y, a, v, ex, ey):
    """Where every front bottom edge was, and how every domino leaned, `late` seconds ago."""
    for i in range(len(x)):
        lean = a[i] - late * v[i, 2]
        sine, cosine = math.sin(lean), math.cos(lean)
        pose[i, 0] = x[i] - late * v[i, 0] + ex[i] * cosine + ey[i] * sine
        pose[i, 1] = y[i] - late * v[i, 1] - ex[i] * sine + ey[i] * cosine
        pose[i, 2] = lean


@compile_alone
def _find_contacts(
    low, leader, hinged, friction, floor, now, mid, ex, ey, height, thickness, light, easy,
    pivots, slope, contact, who, impulse, gaps,
):  # fmt: skip
    """Write down every contact that is closed half a step ahead; returns how many there are.

    `gaps` tells how far the nearer contact of each link is from closing; inf where neither face is
    met.
    """
    found = 0
    for i in range(max(low - 1, 0), leader + 1):
        for kind in range(REAR, TIP):
            if i < low or (hinged and kind == FRONT):
                continue
            px = ex[i] - (thickness[i] if kind == REAR else 0.0)
            py = ey[i] + (height[i] if kind == LYING else 0.0)
            rx, ry = px * mid[i, 3] + py * mid[i, 2], -px * mid[i, 2] + py * mid[i, 3]
            gap = (mid[i, 0] + rx - pivots[i, 0]) * slope[i, 0]
            gap += (mid[i, 1] + ry - pivots[i, 1]) * slope[i, 1]
            if gap > TOUCHING * height[i]:
                impulse[i, kind] = 0.0
                continue
            _on_floor(contact, found, MOVES, rx, ry, slope[i, 0], slope[i, 1])
            rx, ry = px * now[i, 3] + py * now[i, 2], -px * now[i, 2] + py * now[i, 3]
            _on_floor(contact, found, ACTS, rx, ry, slope[i, 0], slope[i, 1])
            who[found, 0], who[found, 1], who[found, 2] = i, -1, kind
            _couple(contact, found, light[i], 0.0, easy[i], 0.0)
            contact[found, FRICTION] = 0.0 if hinged else floor
            found += 1
        if i == leader:
            break
        gaps[i] = np.inf
        for kind in range(TIP, KINDS):
            gap, along = _between(contact, found, MOVES, kind, i, mid, ex, ey, height, thickness)
            on_face = 0.0 <= along <= height[i + 1 if kind == TIP else i]
            if on_face:
                gaps[i] = min(gaps[i], gap)
            if gap > TOUCHING * height[i] or not on_face:
                impulse[i, kind] = 0.0
                continue
            _between(contact, found, ACTS, kind, i, now, ex, ey, height, thickness)
            who[found, 0], who[found, 1], who[found, 2] = i, i + 1, kind
            _couple(contact, found, light[i], light[i + 1], easy[i], easy[i + 1])
            contact[found, FRICTION] = friction
            found += 1
    return found


@compile_alone
def _on_floor(contact, c, at, rx, ry, sine, cosine):
    """Directions of a contact with the floor: out of it, and along it."""
    contact[c, at], contact[c, at + 1] = sine, cosine
    contact[c, at + 2], contact[c, at + 3] = ry * sine - rx * cosine, 0.0
    at += 4
    contact[c, at], contact[c, at + 1] = cosine, -sine
    contact[c, at + 2], contact[c, at + 3] = ry * cosine + rx * sine, 0.0


@compile_alone
def _between(contact, c, at, kind, i, pose, ex, ey, height, thickness):
    """Directions of a contact between i and the next; returns its gap and its place on the face.

    The normal points out of the face that i meets, or against that of i that is met.
    """
    j = i + 1
    sine, cosine = (pose[j, 2], pose[j, 3]) if kind == TIP else (pose[i, 2], pose[i, 3])
    nx, ny = -cosine, sine
    rear = ex[j] - thickness[j]
    cx, cy = rear * pose[j, 3] + ey[j] * pose[j, 2], -rear * pose[j, 2] + ey[j] * pose[j, 3]
    dx, dy = pose[j, 0] - pose[i, 0], pose[j, 1] - pose[i, 1]
    if kind == TIP:
        px, py = ex[i], ey[i] + height[i]
        rx, ry = px * pose[i, 3] + py * pose[i, 2], -px * pose[i, 2] + py * pose[i, 3]
        qx, qy = rx - dx, ry - dy  # from j
        fx, fy = qx - cx, qy - cy
        gap = fx * nx + fy * ny
    else:
        qx, qy = cx, cy
        rx, ry = cx + dx, cy + dy
        fx = rx - ex[i] * cosine - ey[i] * sine
        fy = ry + ex[i] * sine - ey[i] * cosine
        gap = -(fx * nx + fy * ny)
    along = fx * sine + fy * cosine
    sx, sy = ny, -nx
    contact[c, at], contact[c, at + 1] = nx, ny
    contact[c, at + 2], contact[c, at + 3] = ry * nx - rx * ny, qy * nx - qx * ny
    at += 4
    contact[c, at], contact[c, at + 1] = sx, sy
    contact[c, at + 2], contact[c, at + 3] = ry * sx - rx * sy, qy * sx - qx * sy
    return gap, along


@compile_alone
def _couple(contact, c, light, light2, easy, easy2):
    """What unit impulses of a contact change in its own velocities."""
    for place, move, act in (
        (NORMAL, MOVES, ACTS), (CROSS, MOVES + 4, ACTS), (ACROSS, MOVES + 4, ACTS + 4),
    ):  # fmt: skip
        straight = contact[c, move] * contact[c, act] + contact[c, move + 1] * contact[c, act + 1]
        contact[c, place] = (
            (light + light2) * straight
            + easy * contact[c, move + 2] * contact[c, act + 2]
            + easy2 * contact[c, move + 3] * contact[c, act + 3]
        )
    gives, across = contact[c, NORMAL], contact[c, ACROSS]
    contact[c, FIRM] = 1.0 / gives if gives > 0.0 else 0.0
    contact[c, FIRM_ACROSS] = 1.0 / across if across > 0.0 else 0.0


@compile_alone
def _act(contact, who, c, normal, rub, v, light, easy):
    """Give the two dominoes of a contact an impulse and its reaction."""
    i, j = who[c, 0], who[c, 1]
    px = contact[c, ACTS] * normal + contact[c, ACTS + 4] * rub
    py = contact[c, ACTS + 1] * normal + contact[c, ACTS + 5] * rub
    v[i, 0] += light[i] * px
    v[i, 1] += light[i] * py
    v[i, 2] += easy[i] * (contact[c, ACTS + 2] * normal + contact[c, ACTS + 6] * rub)
    if j >= 0:
        v[j, 0] -= light[j] * px
        v[j, 1] -= light[j] * py
        v[j, 2] -= easy[j] * (contact[c, ACTS + 3] * normal + contact[c, ACTS + 7] * rub)


@compile_alone
def _sweep(contact, who, found, impulse, v, light, easy, calm):
    """Sweep forth and back until no velocity of a contact moves by more than `calm`.

    Returns how many sweeps it took, and whether they came to rest.
    """
    check, before = 64, np.inf
    for sweep in range(1, SWEEPS + 1):
        moved = 0.0
        for turn in range(found):
            c = turn if sweep % 2 else found - 1 - turn
            i, j, kind = who[c, 0], who[c, 1], who[c, 2]
            x, y, w = v[i, 0], v[i, 1], v[i, 2]
            speed = contact[c, 0] * x + contact[c, 1] * y + contact[c, 2] * w
            slip = contact[c, 4] * x + contact[c, 5] * y + contact[c, 6] * w
            x2 = y2 = w2 = 0.0
            if j >= 0:
                x2, y2, w2 = v[j, 0], v[j, 1], v[j, 2]
                speed -= contact[c, 0] * x2 + contact[c, 1] * y2 + contact[c, 3] * w2
                slip -= contact[c, 4] * x2 + contact[c, 5] * y2 + contact[c, 7] * w2
            old, old_rub = impulse[i, kind, 0], impulse[i, kind, 1]
            normal = max(0.0, old - speed * contact[c, FIRM])
            slip += contact[c, CROSS] * (normal - old)
            limit = contact[c, FRICTION] * normal
            rub = min(limit, max(-limit, old_rub - slip * contact[c, FIRM_ACROSS]))
            impulse[i, kind, 0], impulse[i, kind, 1] = normal, rub
            more, more_rub = normal - old, rub - old_rub
            px = contact[c, 8] * more + contact[c, 12] * more_rub
            py = contact[c, 9] * more + contact[c, 13] * more_rub
            v[i, 0] = x + light[i] * px
            v[i, 1] = y + light[i] * py
            v[i, 2] = w + easy[i] * (contact[c, 10] * more + contact[c, 14] * more_rub)
            if j >= 0:
                v[j, 0] = x2 - light[j] * px
                v[j, 1] = y2 - light[j] * py
                v[j, 2] = w2 - easy[j] * (contact[c, 11] * more + contact[c, 15] * more_rub)
            moved = max(moved, contact[c, NORMAL] * abs(more), contact[c, ACROSS] * abs(more_rub))
        if moved <= calm:
            return sweep, True
        if sweep == check:
            # a domino wedged between its neighbour and the floor takes any impulse, a little more
            # in every sweep; nothing else is moved by that
            if moved > STUCK * before:
                return sweep, False
            before, check = moved, 2 * check
    return SWEEPS, False
