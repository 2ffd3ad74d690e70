"""What is kept of a chain: of each domino, and of the whole."""

import math

import numpy as np

from domino_env.kernels.jit import internal
from domino_env.kernels.slots import JAMMED, PROPAGATED


@internal
def blank(arrivals, push):
    """No domino has been reached but the first."""
    for i in range(len(arrivals)):
        arrival = arrivals[i]
        arrival.time = np.inf
        arrival.release = arrival.impact = arrival.margin = np.nan
    if len(arrivals) > 0:
        arrivals[0].time = 0.0
        arrivals[0].release = push


@internal
def record(arrivals, n, outcome, state):
    """Write what fall n has shown: margin, and where it struck, both speeds and the arrival."""
    if len(arrivals) == 0:
        return
    arrivals[n].margin = state.margin
    if n + 1 < len(arrivals) and state.part == 1.0 and outcome in (PROPAGATED, JAMMED):
        arrivals[n].impact = math.sqrt(state.u_impact)
        arrivals[n + 1].time = state.time
        if outcome == PROPAGATED:
            arrivals[n + 1].release = math.sqrt(state.u)


@internal
def summarise(summary, count, outcome, leader, struck, toppled, state):
    """Write what became of a chain of `count` dominoes."""
    summary.outcome, summary.hit, summary.toppled = outcome, struck, toppled
    summary.reach = 1.0 if outcome == PROPAGATED else (leader + state.part) / count
    summary.total_time = state.time if outcome == PROPAGATED else np.inf
    summary.estimate = state.worst
    summary.flushes, summary.releases = state.flushes, state.releases
    summary.flush_loss, summary.lowest_margin = state.flush_loss, state.lowest_margin
    summary.taped = state.taped
