"""Dominoes and links in the ring: how they are written down, and how a link changes its contact."""

from domino_env.kernels.jit import inlined, part
from domino_env.kernels.slots import CORNER, RELEASED, TIP


@inlined
def stand(ring, mask, i, height, thickness, density):
    """Write domino i into the ring (per unit of width; its link forward comes with the next)."""
    domino = ring[i & mask]
    mass = density * height * thickness
    domino.inertia = mass * (height * height + thickness * thickness) / 3.0
    domino.half_weight = 0.5 * mass * height  # times gravity where it is used
    domino.slender = thickness / height
    domino.contact = TIP
    domino.noted = 0
    domino.tail = domino.inertia
    domino.end_weight = 0.0


@inlined
def join(ring, mask, i, height, gap, thickness_next):
    """Write the link from i to i+1."""
    link = ring[i & mask]
    pitch = gap + thickness_next
    link.p_l = pitch / height
    link.s_l = gap / height
    link.rest = (height - gap) / height
    link.d_l = thickness_next / height
    link.v_flush = gap / pitch  # cos θ = d/p
    # cos θ = (p² + d² - L²) / 2pd, for the tip and for the corner
    link.v_release = (height - gap) * (height + gap) / (2.0 * pitch * thickness_next)
    link.due = min(link.v_flush, link.v_release)


@inlined
def can_flush(link):
    """Whether the link is to go from tip to corner, rather than be released."""
    return link.contact == TIP and link.v_flush < link.v_release


@inlined
def flush(link, state):
    """From tip to corner."""
    link.contact = CORNER
    link.due = link.v_release
    state.flushes += 1


@part
def release(link, i, state):
    """Domino i loses i+1: it and all behind it leave the stack."""
    link.contact = RELEASED
    state.back = i + 1
    state.releases += 1


@inlined
def catch_up(link, i, v, state):
    """Make up for switches beyond an earlier cut: they had no weight then, and need no impact."""
    if can_flush(link):
        flush(link, state)
    if v > link.v_release * (1.0 + 1e-9):
        release(link, i, state)
