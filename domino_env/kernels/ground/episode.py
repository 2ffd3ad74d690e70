"""The environments' step, over hills."""

import math

from domino_env.kernels.ground.placing import at as ground_at
from domino_env.kernels.ground.placing import next_place, piece_at
from domino_env.kernels.jit import always_inline, borrowed, internal, overload
from domino_env.kernels.links import step_of
from domino_env.kernels.slots import Curve, Row
from domino_env.kernels.step import batch as batches
from domino_env.kernels.step import environment, observation
from domino_env.kernels.step.batch import HillBatch, rules_of


@overload(environment.lend)
@always_inline
def lend(batch):
    """The same batch without reference counts."""
    curve = batch.curve
    return HillBatch(
        borrowed(batch.rules),
        borrowed(batch.parts),
        borrowed(batch.features),
        borrowed(batch.closeness),
        borrowed(batch.gap_values),
        borrowed(batch.kinds),
        borrowed(batch.stock),
        borrowed(batch.left),
        borrowed(batch.errors),
        borrowed(batch.rings),
        borrowed(batch.states),
        borrowed(batch.episodes),
        borrowed(batch.spacing),
        borrowed(batch.thickness),
        borrowed(batch.height),
        borrowed(batch.density),
        borrowed(batch.rise),
        borrowed(batch.tilt),
        borrowed(batch.places),
        Curve(borrowed(curve.knots), borrowed(curve.starts), borrowed(curve.pieces)),
    )


@overload(batches.row_built)
@always_inline
def row_built(batch, b):
    """Row b, as long as its scene has it."""
    count = rules_of(batch, b).count
    height, density = b if len(batch.height) > 1 else 0, b if len(batch.density) > 1 else 0
    return Row(
        batch.spacing[b, : count - 1],
        batch.thickness[b, :count],
        batch.height[height, :count],
        batch.density[density, :count],
        batch.rise[b, : count - 1],
        batch.tilt[b, :count],
    )


@overload(environment.pitch_of)
@always_inline
def pitch_of(row, n):
    """From pivot n to the next [m]."""
    return math.hypot(row.spacing[n] + row.thickness[n + 1], step_of(row, n, n + 1))


@overload(environment.stand_next)
@internal
def stand_next(batch, b, row, n):
    """Stand domino n+1 behind gap n on the ground: its tilt, its rise, its place."""
    x = batch.places[b, n]
    gap, d = row.spacing[n], row.thickness[n + 1]
    if len(batch.curve.knots) == 1:  # an even slope, whose rows stay as even as they are
        tilt = row.tilt[n]
        row.rise[n], row.tilt[n + 1] = -math.sin(tilt) * (gap + d), tilt
        batch.places[b, n + 1] = x + (gap + d) * math.cos(tilt)
        return
    tilt, up = next_place(batch.curve, x, piece_at(batch.curve, x, 0), gap, d, row.tilt[n])
    s, c = math.sin(tilt), math.cos(tilt)
    row.rise[n], row.tilt[n + 1] = up * c - (gap + d) * s, tilt
    batch.places[b, n + 1] = x + (gap + d) * c + up * s


@overload(observation.observe_ground)
@internal
def observe_ground(batch, b, observed):
    """Slope and rise of the next places, a mean pitch apart each: `window` of both.

    Slopes count downhill, in slopes that tip the thinnest domino; rises over the last pivot, in
    heights.
    """
    rules, curve, part = rules_of(batch, b), batch.curve, batch.parts[0]
    unit = rules.unit if rules.in_heights else 1.0
    pitch = 0.5 * unit * (rules.gap_low + rules.gap_high + rules.thick_low + rules.thick_high)
    steepest = unit * rules.thick_low / rules.unit
    x = batch.places[b, batch.episodes[b].placed]
    k = piece_at(curve, x, 0)
    here, _ = ground_at(curve, x, k)
    for j in range(part.window):
        x += pitch
        k = piece_at(curve, x, k)
        height, slope = ground_at(curve, x, k)
        rise = (height - here) / rules.unit
        observed[part.slopes + j] = min(max(-slope / steepest, -1.0), 1.0)
        observed[part.rises + j] = min(max(rise, -observation.RISE_LIMIT), observation.RISE_LIMIT)
