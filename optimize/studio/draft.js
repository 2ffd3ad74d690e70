// Drafts: a scene and one of its layouts, from which other drafts are made within its rules.

import { positions } from "./kernels.js";

/** Name of a scene that was changed or made from a layout. */
export const OWN = { name: "own", title: "your own scene" };
const USUAL_GAPS = [0.002, 0.04]; // [m] bounds for a layout without a scene, widened to its gaps
const SAME_GAIN = 5e-5; // smaller relative differences count as equal
const SAME_SIZE = 1e-9; // [m]
const SCORE_RTOL = 1e-10; // relative tolerance of arrival times
const EQUAL = 1e-6; // relative range of values that count as equal

const clip = (value, [low, high]) => Math.min(Math.max(value, low), high);
const range = (count, value) => Float64Array.from({ length: count }, (_, i) => value(i));
const sum = (values) => values.reduce((a, b) => a + b, 0);

/** Curves of a layout: gaps, thicknesses and growths of dominoes 1 … N-1 in the units of its scene. */
export function curvesOf(scene, layout) {
  const { spacing, thickness, height } = layout, { inHeights } = scene, pairs = spacing.length;
  const unit = (i) => (inHeights ? height[i + 1] : 1);
  return {
    spacing: range(pairs, (i) => spacing[i] / (inHeights ? Math.min(height[i], height[i + 1]) : 1)),
    thickness: range(pairs, (i) => thickness[i + 1] / unit(i)),
    growth: range(pairs, (i) => height[i + 1] / height[i]),
  };
}

/** Bounds of these curves. */
export function boundsOf({ spacing, thickness, growth, inHeights, height }) {
  const scaled = (bounds) => bounds.map((v) => (inHeights ? v / height : v));
  return { spacing: scaled(spacing), thickness: scaled(thickness), growth: growth ?? [1, 1] };
}

/** Feasible layout nearest to some curves: within the bounds, of the length, with the pieces of the stock. */
export function nearest(scene, curves) {
  const { inHeights, stock, growth } = scene, bounds = boundsOf(scene);
  const parts = Object.fromEntries(Object.entries(bounds).map(([name, b]) => [name, curves[name].map((v) => clip(v, b))]));
  if (stock) parts.thickness = fromStock(scene, parts.thickness);
  if (scene.length !== null) meetLength(scene, parts, bounds);
  const pairs = parts.spacing.length, height = range(pairs + 1, () => scene.height);
  for (let i = 1; i <= pairs; i++) height[i] = height[i - 1] * parts.growth[i - 1];
  const gaps = range(pairs, (i) => parts.spacing[i] * (inHeights ? Math.min(height[i], height[i + 1]) : 1));
  const sizes = range(pairs, (i) => parts.thickness[i] * (inHeights ? height[i + 1] : 1));
  return scene.layout(gaps, scene.freeThickness ? sizes : undefined, growth ? height.slice(1) : undefined);
}

// shifts free gaps and thicknesses by one value, within their bounds, so that the length is met
function meetLength({ length, stock }, parts, bounds) {
  const free = [parts.spacing, ...(stock ? [] : [parts.thickness])], limits = [bounds.spacing, bounds.thickness];
  const total = (shift) => sum(free.map((p, k) => sum(p.map((v) => clip(v + shift, limits[k]))))) + (stock ? sum(parts.thickness) : 0);
  let [low, high] = [-length, length];
  for (let k = 0; k < 200 && low < high; k++) {
    const middle = 0.5 * (low + high);
    if (middle === low || middle === high) break;
    if (total(middle) < length) low = middle; else high = middle;
  }
  free.forEach((p, k) => p.forEach((v, i) => { p[i] = clip(v + high, limits[k]); }));
}

// pieces of the stock in the order of the wanted thicknesses, chosen with the least sum of squares
function fromStock({ stock, firstThickness }, wanted) {
  const pieces = stock.thickness.flatMap((d, k) => Array(stock.count[k]).fill(d)).sort((a, b) => a - b);
  pieces.splice(pieces.findIndex((d) => Math.abs(d - firstThickness) < SAME_SIZE), 1);
  const order = [...wanted.keys()].sort((a, b) => wanted[a] - wanted[b]), n = order.length, spare = pieces.length - n;
  const cost = Array.from({ length: n + 1 }, () => new Float64Array(spare + 1)); // of the first i with j pieces left out
  for (let i = 1; i <= n; i++) for (let j = 0; j <= spare; j++) {
    const take = cost[i - 1][j] + (wanted[order[i - 1]] - pieces[i - 1 + j]) ** 2;
    cost[i][j] = j ? Math.min(take, cost[i][j - 1]) : take;
  }
  const chosen = new Float64Array(n);
  for (let i = n, j = spare; i > 0; i--) {
    while (j && cost[i][j] === cost[i][j - 1]) j--;
    chosen[order[i - 1]] = pieces[i - 1 + j];
  }
  return chosen;
}

/** Scene that a layout without one belongs to: the given one if it keeps its rules, else one made from it. */
export function sceneFor(layout, given, makeScene) {
  const count = layout.thickness.length, gaps = layout.spacing, sizes = [...layout.thickness.slice(1)];
  if (count < 2) throw new RangeError("one domino has no gap: give a layout of two or more");
  if (given && given.count === count && !given.violations(layout).length) return given;
  const [thin, thick] = [Math.min(...sizes), Math.max(...sizes)];
  return makeScene({
    ...OWN, objective: "mean_speed",
    row: { count, height: layout.height[0], width: layout.width, density: layout.density[0] ?? layout.density, first_thickness: layout.thickness[0] },
    spacing: { min: Math.min(USUAL_GAPS[0], ...gaps), max: Math.max(USUAL_GAPS[1], ...gaps) },
    thickness: thin === thick ? { fixed: thin } : { min: thin, max: thick },
    physics: given?.tables.physics ?? {},
  });
}

/** A scene and a layout that keeps its rules; `score`, if it is known, is that on the floor. */
export class Draft {
  constructor(scene, layout, score) {
    Object.assign(this, { scene, layout, known: score });
  }

  /** Wave of the whole row on fixed pivots. */
  get wave() {
    if (this.simulated) return this.simulated;
    const { scene, layout } = this;
    this.simulated = scene.kernels.simulate(scene.row(layout), scene.physics, { rtol: SCORE_RTOL });
    if (!this.isSlow) this.known ??= scene.scoreOf(this.simulated);
    return this.simulated;
  }

  /** Score; undefined on a floor until it is computed. */
  get score() {
    return this.known ?? (this.isSlow ? undefined : this.wave && this.known);
  }
  set score(value) { this.known = value; }

  /** True if a score takes long. */
  get isSlow() { return this.scene.floorFriction !== null; }

  /** Index of the leading domino with which the wave stops; -1 if it completes. */
  get stop() { return this.wave.outcome === "PROPAGATED" ? -1 : Math.max(this.wave.hit - 1, 0); }

  /** True if all gaps, and all free thicknesses, are equal. */
  get isUniform() {
    return Object.values(curvesOf(this.scene, this.layout)).every((c) => Math.max(...c) - Math.min(...c) <= EQUAL * Math.max(...c));
  }

  with(curves) { return new Draft(this.scene, nearest(this.scene, curves)); }

  /**
   * Draft with another gap or thickness, as far as the rules allow.
   * @param {"spacing"|"thickness"} quantity
   * @param {number} index of the gap, or of the gap behind the domino
   * @param {number} value wanted size [m]
   * @param {number[]} [others] gaps that compensate; without them, and with a fixed length, the nearest ones
   */
  withSize(quantity, index, value, others) {
    const { scene, layout } = this, curves = curvesOf(scene, layout), pairs = layout.spacing.length;
    const size = quantity === "spacing" ? layout.spacing[index] : layout.thickness[index + 1];
    const unit = size / curves[quantity][index], bounds = boundsOf(scene);
    const wanted = clip(value / unit, bounds[quantity]);
    let rest = (curves[quantity][index] - wanted) * unit;
    curves[quantity][index] = wanted;
    if (!others && scene.length !== null) {
      others = [...Array(pairs).keys()].sort((a, b) => Math.abs(a - index) - Math.abs(b - index) || a - b);
      if (quantity === "spacing") others = others.filter((k) => k !== index);
    }
    for (const k of others ?? []) {
      const scale = layout.spacing[k] / curvesOf(scene, layout).spacing[k];
      const next = clip(curves.spacing[k] + rest / scale, bounds.spacing);
      rest -= (next - curves.spacing[k]) * scale;
      curves.spacing[k] = next;
    }
    if (others) curves[quantity][index] += rest / unit; // for which the others have no room
    return this.with(curves);
  }

  /** Draft with domino 1 … N-1 moved [m]; with `following`, those ahead move along. */
  withShift(index, shift, following = false) {
    const alone = following || index === this.layout.spacing.length;
    return this.withSize("spacing", index - 1, this.layout.spacing[index - 1] + shift, alone ? undefined : [index]);
  }

  /** Draft with one more domino, in the middle of a gap. */
  withDomino(gap) {
    const curves = curvesOf(this.scene, this.layout), { spacing, thickness } = this.layout;
    const wider = (c) => Float64Array.of(...c.slice(0, gap), c[gap], ...c.slice(gap));
    const made = { spacing: wider(curves.spacing), thickness: wider(curves.thickness), growth: wider(curves.growth) };
    const scale = curves.spacing[gap] / spacing[gap];
    if (this.scene.freeSpacing) made.spacing[gap] = made.spacing[gap + 1] = 0.5 * (spacing[gap] - thickness[gap + 1]) * scale;
    return this.resized(1, made);
  }

  /** Draft without one of the dominoes 1 … N-1. */
  withoutDomino(index) {
    const curves = curvesOf(this.scene, this.layout), { spacing, thickness } = this.layout, pairs = spacing.length;
    if (this.scene.freeSpacing && index < pairs) {
      curves.spacing[index] *= (spacing[index] + spacing[index - 1] + thickness[index]) / spacing[index];
    }
    const without = (c) => c.filter((_, i) => i !== index - 1);
    return this.resized(-1, { spacing: without(curves.spacing), thickness: without(curves.thickness), growth: without(curves.growth) });
  }

  resized(by, curves) {
    const scene = this.scene.replaced({ ...OWN, row: { count: this.scene.count + by } });
    return new Draft(scene, nearest(scene, curves));
  }

  /** Draft of another scene with the same free quantities: curves are interpolated along the row. */
  withScene(scene) {
    const pairs = scene.count - 1, curves = curvesOf(this.scene, this.layout);
    const stretched = (c) => range(pairs, (i) => {
      const at = pairs > 1 ? (i * (c.length - 1)) / (pairs - 1) : 0, k = Math.min(Math.floor(at), c.length - 1);
      return c[k] + (at - k) * ((c[k + 1] ?? c[k]) - c[k]);
    });
    return new Draft(scene, nearest(scene, { spacing: stretched(curves.spacing), thickness: stretched(curves.thickness), growth: stretched(curves.growth) }));
  }

  /** Result, and its comparison with the best equal gaps (`{score, text}`) once these are known. */
  headline(uniform) {
    const { scene, wave } = this;
    if (this.stop >= 0) return [`stops at domino ${this.stop}`, `${wave.hit} of ${wave.arrivalTimes.length} are hit`];
    if (this.score === undefined) return [`${wave.meanSpeed.toFixed(3)} m/s`, "with fixed pivots; computing it on the floor …"];
    const number = rounded(scene.text(this.score, wave));
    if (!uniform) return [number, "computing the best equal gaps …"];
    const gain = this.score / uniform.score - 1;
    if (!scene.isMeanSpeed || !(Math.min(this.score, uniform.score) > 0)) return [number, `best equal gaps: ${rounded(scene.text(uniform.score, uniform.wave))}`];
    if (Math.abs(gain) < SAME_GAIN) return [number, "as fast as the best equal gaps"];
    return [number, `${(100 * Math.abs(gain)).toFixed(2)}% ${gain > 0 ? "faster" : "slower"} than the best equal gaps`];
  }

  /** Time, length, normalised score and outcome in one line. */
  details(uniform, best) {
    const { wave } = this, count = wave.arrivalTimes.length, length = positions(wave.layout)[count - 1];
    let words = `${count} dominoes over ${(1000 * length).toFixed(0)} mm; `;
    if (this.stop >= 0) return words + wave.explanation.split(" (smallest_push")[0];
    const last = wave.arrivalTimes[count - 1];
    words += `${this.isSlow ? "with fixed pivots, " : ""}last hit after ${last.toFixed(4)} s (computed to ${(wave.errorEstimate * last).toExponential(0)} s)`;
    if (best && uniform && this.score !== undefined && this.scene.isMeanSpeed) {
      const share = (this.score - uniform.score) / (best.score - uniform.score);
      if (share > 0.005) words += `; ${(100 * share).toFixed(0)}% of the gain of the best known row`;
    }
    return words;
  }
}

// decimal numbers of a text rounded to three digits, or to whole numbers
const rounded = (text) => text.replace(/\d+\.\d{3,}/g, (m) => (Number(m) < 100 ? Number(m).toPrecision(3) : Number(m).toFixed(0)));
