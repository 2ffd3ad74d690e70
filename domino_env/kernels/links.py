"""Dominoes and links in the ring: how they are written down, and how a link changes its contact."""

import numpy as np

from domino_env.kernels.jit import always_inline, internal, overloaded
from domino_env.kernels.slots import CORNER, LINK, RELEASED, TIP


@overloaded
@internal
def new_ring(row, size):
    """An empty ring for the dominoes of a row."""
    return np.zeros(size, LINK)


@overloaded
@always_inline
def stand(ring, mask, i, row, j):
    """Write domino j of a row into the ring as domino i.

    Per unit of width; its link forward comes with the next.
    """
    domino, height, thickness, density = (
        ring[i & mask],
        row.height[j],
        row.thickness[j],
        row.density[j],
    )
    mass = density * height * thickness
    domino.inertia = mass * (height * height + thickness * thickness) / 3.0
    domino.half_weight = 0.5 * mass * height  # times gravity where it is used
    domino.slender = thickness / height
    domino.contact = TIP
    domino.noted = 0
    domino.tail = domino.inertia
    domino.end_weight = 0.0


@overloaded
@always_inline
def join(ring, mask, i, row, j, ahead):
    """Write the link from i to i+1, which are dominoes j and `ahead` of the row."""
    link, height, gap, thickness_next = (
        ring[i & mask],
        row.height[j],
        row.spacing[j],
        row.thickness[ahead],
    )
    pitch = gap + thickness_next
    link.p_l = pitch / height
    link.s_l = gap / height
    link.rest = (height - gap) / height
    link.d_l = thickness_next / height
    link.v_flush = gap / pitch  # cos θ = d/p
    # cos θ = (p² + d² - L²) / 2pd, for the tip and for the corner
    link.v_release = (height - gap) * (height + gap) / (2.0 * pitch * thickness_next)
    link.due = min(link.v_flush, link.v_release)


@overloaded
@always_inline
def far(link):
    """p² + e² - d², between the pivots."""
    return link.s_l * (link.p_l + link.d_l)


@overloaded
@always_inline
def most_passed_on(link):
    """Bound on Ω and |B/A| of a link at its tip."""
    return 1.0


@overloaded
@always_inline
def past_flush(link, over):
    """By what Δ [rad] the faces are past flush where 1 - cos θ_{i+1} is past its due by `over`."""
    return over * link.p_l


@always_inline
def can_flush(link):
    """Whether the link is to go from tip to corner, rather than be released."""
    return link.contact == TIP and link.v_flush < link.v_release


@always_inline
def flush(link, state):
    """From tip to corner."""
    link.contact = CORNER
    link.due = link.v_release
    state.flushes += 1


@internal
def release(link, i, state):
    """Domino i loses i+1: it and all behind it leave the stack."""
    link.contact = RELEASED
    state.back = i + 1
    state.releases += 1


@always_inline
def catch_up(link, i, v, state):
    """Make up for switches beyond an earlier cut: they had no weight then, and need no impact."""
    if can_flush(link):
        flush(link, state)
    if v > link.v_release * (1.0 + 1e-9):
        release(link, i, state)
