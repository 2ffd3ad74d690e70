// Ground under a layout: pivots, line of the ground, distances along it, as domino_env/view/ground.py.

import { pivots } from "./kernels.js";

const known = new WeakMap(); // pivots by layout
const PIECES = 12; // straight pieces of the curve between two dominoes

/** True for a layout on level ground. */
export const isFlat = (layout) => !layout.rise?.some((v) => v !== 0) && !layout.tilt?.some((v) => v !== 0);

/** Front bottom edges of the dominoes, `{x, z}` [m], the first at 0. */
export function pivotsOf(layout) {
  if (!known.has(layout)) {
    const places = pivots(layout);
    known.set(layout, { x: Float64Array.from(places, ([x]) => x), z: Float64Array.from(places, ([, z]) => z) });
  }
  return known.get(layout);
}

/** Points [x, z] of the ground [m]: straight under each domino, a cubic between two of them. */
export function groundLine(layout) {
  const { x, z } = pivotsOf(layout), d = layout.thickness, last = d.length - 1, points = [];
  const tilt = (i) => layout.tilt?.[i] ?? 0;
  const rear = (i) => [x[i] - d[i] * Math.cos(tilt(i)), z[i] + d[i] * Math.sin(tilt(i))];
  if (isFlat(layout)) return [[-d[0], 0], [x[last], 0]];
  for (let i = 0; i <= last; i++) {
    points.push(rear(i), [x[i], z[i]]);
    if (i < last) points.push(...hermite([x[i], z[i]], rear(i + 1), tilt(i), tilt(i + 1)));
  }
  return points;
}

// inner points of the cubic from p to q with slopes that fall by angles a and b
function hermite(p, q, a, b) {
  const span = Math.hypot(q[0] - p[0], q[1] - p[1]), points = [];
  for (let k = 1; k < PIECES; k++) {
    const t = k / PIECES, u = 1 - t, [h0, h1, g0, g1] = [u * u * (1 + 2 * t), t * t * (3 - 2 * t), t * u * u, -t * t * u];
    points.push([0, 1].map((axis) => {
      const slope = (angle) => span * (axis ? -Math.sin(angle) : Math.cos(angle));
      return h0 * p[axis] + h1 * q[axis] + g0 * slope(a) + g1 * slope(b);
    }));
  }
  return points;
}

/** Positions of the pivots along the ground [m], the first at 0. */
export function positionsAlong(layout) {
  const { x, z } = pivotsOf(layout);
  if (isFlat(layout)) return x;
  const line = groundLine(layout), along = new Float64Array(x.length);
  for (let k = 1, i = 0, s = -layout.thickness[0]; k < line.length; k++) {
    s += Math.hypot(line[k][0] - line[k - 1][0], line[k][1] - line[k - 1][1]);
    if (line[k][0] === x[i] && line[k][1] === z[i]) along[i++] = s;
  }
  return along;
}
