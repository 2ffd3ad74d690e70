/**
 * Measurement of a chain of known gaps from its sound: as `domino_env/validation/measurement.py`.
 *
 * The steps, their order and the constants are the same; differences are said where they are. Times
 * are in s, velocities in rad/s. `sounds` are {rises, times, heights}; a fit has the attributes of
 * Python's `_Fit`, its Jacobian by columns.
 */

import { positions, releasedPush, require } from "./kernels.js";

const linspace = (first, last, count) => Float64Array.from({ length: count }, (_, i) => first + ((last - first) * i) / (count - 1));
const geomspace = (first, last, count) => linspace(Math.log(first), Math.log(last), count).map(Math.exp);

/** Constants with the names and the order of Python's. */
export const CONSTANTS = {
  HOP: 0.00025, LEAST_RATE: 8000, HIGH_PASS: 1500, QUIET: 0.02, FRICTIONS: linspace(0, 0.6, 121), PUSHES: geomspace(2, 30, 25), COARSE: 4,
  FIRST_HITS: 48, STARTS: 10, WIDTHS: [0.0025, 0.002, 0.0007], REACHES: [0.006, 0.004, 0.003, 0.003, 0.003, 0.003, 0.003, 0.003],
  LEAST_SCALE: 0.0002, TUKEY: 4.685, EFFICIENCY: 0.95, ECHO: 0.013, FAINT: 0.6, UNLIKELY: 0.05, STRAY: 0.03, PUSH_PRIOR: 0.3,
  RELEASED_PRIOR: 1e-5, STRETCHES: [2, 3, 4], REJECTED: 0.001, LEAST_MISFIT: 0.0005, CLOCK: 1e-4, LEAST_HITS: 8, LEAST_HEARD: 0.5, SILENT: 6,
  SECOND_HEIGHT: 0.7, CHANCE: 8, SECOND_CHANCE: 4.5,
};
const { HOP, LEAST_RATE, HIGH_PASS, QUIET, FRICTIONS, PUSHES, COARSE, FIRST_HITS, STARTS, WIDTHS, REACHES, LEAST_SCALE, TUKEY, EFFICIENCY, ECHO, FAINT, UNLIKELY } = CONSTANTS;
const { STRAY, PUSH_PRIOR, RELEASED_PRIOR, STRETCHES, REJECTED, LEAST_MISFIT, CLOCK, LEAST_HITS, LEAST_HEARD, SILENT, SECOND_HEIGHT, CHANCE, SECOND_CHANCE } = CONSTANTS;
const OTHERS = 100; // times with which those of the hits are compared

const NO_PATTERN = "the sound is not that of this layout: no pattern of hits stands out; check the layout, and cut the recording to the toppling";
const LEGENDRE = [, , (x) => (3 * x * x - 1) / 2, (x) => (5 * x ** 3 - 3 * x) / 2, (x) => (35 * x ** 4 - 30 * x * x + 3) / 8];

const fail = (message) => { throw new RangeError(message); };
const clip = (x, low, high) => Math.min(Math.max(x, low), high);
const sum = (values) => values.reduce((a, b) => a + b, 0);
const mean = (values) => sum(values) / values.length;
const deviation = (values) => { const m = mean(values); return Math.sqrt(mean(values.map((v) => (v - m) ** 2))); };
const finite = (values) => values.filter(Number.isFinite);

function quantile(values, part) {
  const sorted = Float64Array.from(values).sort(), place = part * (sorted.length - 1), k = Math.floor(place);
  return sorted[k] + (place - k) * ((sorted[k + 1] ?? sorted[k]) - sorted[k]);
}

// index of the first of some rising values that is at least x
function searchSorted(values, x) {
  let low = 0, high = values.length;
  while (low < high) { const middle = (low + high) >> 1; if (values[middle] < x) low = middle + 1; else high = middle; }
  return low;
}

function findPeaks(values, least = -Infinity) {
  const peaks = [];
  for (let i = 1; i < values.length - 1; i++) {
    let j = i;
    while (values[j + 1] === values[i]) j += 1;
    if (values[i] > values[i - 1] && values[i] > values[j + 1] && values[i] >= least) peaks.push((i + j) >> 1);
    i = j;
  }
  return peaks;
}

// values, one per hop, smoothed by a Gaussian function of a width
function widen(values, width, hop) {
  const radius = Math.trunc((4 * width) / hop + 0.5), n = values.length, wide = new Float64Array(n);
  const bell = Float64Array.from({ length: 2 * radius + 1 }, (_, j) => Math.exp(-0.5 * (((j - radius) * hop) / width) ** 2)), total = sum(bell);
  for (let i = 0; i < n; i++) {
    if (values[i] !== 0) for (let k = Math.max(i - radius, 0); k <= Math.min(i + radius, n - 1); k++) wide[k] += values[i] * bell[k - i + radius];
  }
  return wide.map((v) => v / total);
}

function findSounds(samples, rate) {
  const turn = Math.tan((Math.PI * Math.min(HIGH_PASS, 0.2 * rate)) / rate), norm = 1 / (1 + Math.SQRT2 * turn + turn * turn); // Butterworth
  const [a1, a2] = [2 * (turn * turn - 1) * norm, (1 - Math.SQRT2 * turn + turn * turn) * norm], n = samples.length;
  const edges = [];
  for (let k = 0; k < Math.ceil(n / rate / HOP); k++) {
    const edge = Math.floor(k * HOP * rate);
    if (edge < n && edge !== edges.at(-1)) edges.push(edge);
  }
  const level = new Float64Array(edges.length), count = level.length;
  for (let i = 0, k = 0, s1 = 0, s2 = 0; i < n; i++) {
    const y = norm * samples[i] + s1;
    s1 = -2 * norm * samples[i] - a1 * y + s2;
    s2 = norm * samples[i] - a2 * y;
    if (i >= edges[k + 1]) k += 1;
    level[k] += y * y;
  }
  const root = level.map((v, k) => Math.sqrt(v / ((edges[k + 1] ?? n) - edges[k])));
  const reflected = (k) => root[k < 0 ? -1 - k : k < count ? k : 2 * count - 1 - k];
  level.forEach((_, k) => { level[k] = (reflected(k - 2) + reflected(k - 1) + root[k] + reflected(k + 1)) / 4; });
  const quiet = Math.max(3 * quantile(level, 0.5), QUIET * quantile(level, 0.999));
  const loudness = level.map((v) => Math.log1p(v / Math.max(quiet, 1e-300)));
  const rises = loudness.map((v, k) => (k + 4 < count ? Math.max(loudness[k + 4] - v, 0) : 0));
  const values = widen(rises, 1.25 * HOP, HOP);
  const peaks = findPeaks(values, Math.max(0.15 * quantile(values, 0.999), 1e-6));
  const vertex = (a, b, c) => (0.5 * (a - c)) / Math.min(a - 2 * b + c, -1e-300); // 0 in the middle of a plateau
  return { rises, times: Float64Array.from(peaks, (k) => (k + vertex(values[k - 1], values[k], values[k + 1])) * HOP), heights: Float64Array.from(peaks, (k) => values[k]) };
}

// the sound within reach that is most likely the hit at each time; nan if none
function match(sounds, times, reach) {
  return times.map((t) => {
    let best = -1, found = NaN;
    for (let k = searchSorted(sounds.times, t - reach), last = searchSorted(sounds.times, t + reach); k < last; k++) {
      const likely = sounds.heights[k] * Math.exp(-2 * ((sounds.times[k] - t) / reach) ** 2);
      if (likely > best) [best, found] = [likely, sounds.times[k]];
    }
    return found;
  });
}

// median of the heights of sounds; nan without any
const usualHeight = ({ times, heights }, found) => quantile(found.map((t) => heights[searchSorted(times, t)]), 0.5);

// how likely sounds are hits, 0 to 1: not faint, nor echoes; `times` are those of the hits, with one before the first
function credence(sounds, found, times) {
  const { times: known, heights } = sounds, usual = FAINT * usualHeight(sounds, finite(found));
  return found.map((t, k) => {
    if (!Number.isFinite(t)) return 0;
    const j = searchSorted(known, t), before = searchSorted(known, t - Math.min(ECHO, 0.5 * (times[k + 1] - times[k])));
    return Math.min(heights[j] / usual, 1) ** 2 * (heights.subarray(before, j).some((h) => h > 0.5 * heights[j]) ? 0.1 : 1);
  });
}

// sounds without some of them and their echoes
function without({ rises, times, heights }, found) {
  const rest = rises.slice(), isLeft = (t) => found.every((f) => t < f - 0.002 || t > f + ECHO);
  for (const t of found) rest.fill(0, Math.max(Math.trunc((t - 0.002) / HOP), 0), Math.trunc((t + ECHO) / HOP));
  return { rises: rest, times: times.filter(isLeft), heights: heights.filter((_, k) => isLeft(times[k])) };
}

// times of the hits by friction and push, and their derivatives
class Model {
  constructor(kernels, layout, physics) {
    const isReleased = Math.abs(physics.push / releasedPush(layout, physics.gravity) - 1) < 2e-3; // it may be rounded
    Object.assign(this, { kernels, layout, physics, count: layout.thickness.length, isReleased, prior: isReleased ? RELEASED_PRIOR : PUSH_PRIOR });
  }

  // model of the first hits, which do not depend on later dominoes
  head(hits) {
    if (hits + 1 >= this.count) return this;
    const part = (name, values) => (typeof values === "object" ? values.slice(0, ["spacing", "rise"].includes(name) ? hits : hits + 1) : values);
    return new Model(this.kernels, Object.fromEntries(Object.entries(this.layout).map(([name, values]) => [name, part(name, values)])), this.physics);
  }

  times(friction, push, rtol = 1e-8) {
    return this.kernels.simulate(this.layout, { ...this.physics, friction: Math.max(friction, 0), push }, { rtol, exactMargins: false }).arrivalTimes;
  }

  // columns by start, friction, push and stretches
  jacobian([, friction, push, ...stretches]) {
    const times = this.times(friction, push), n = this.count;
    const change = (a, b) => this.times(friction + a, push + b).map((t, k) => (t - times[k]) / (a + b));
    const stretch = stretches.map((_, k) => Float64Array.from({ length: n }, (__, i) => LEGENDRE[STRETCHES[k]]((2 * i) / (n - 1) - 1)));
    return [new Float64Array(n).fill(1), change(1e-4, 0), change(0, 1e-3 * push), ...stretch];
  }
}

// largest sum of the values at the hits, and the place from which the hits then count
function bestPlace(values, hits) {
  const count = hits.length, end = values.length - hits[count - 1];
  let most = 0, place = 0;
  for (let s = 0; s < end; s++) {
    let agreement = 0;
    for (let k = 0; k < count; k++) agreement += values[s + hits[k]];
    if (agreement > most) { most = agreement; place = s; }
  }
  return [most, place];
}

// best start and friction for each push (of a released domino, for parts of the frictions), the one with most agreement
// first; hits are few, so a sum over them takes the
// place of Python's Fourier transforms
function searchGrid(rises, model, frictions) {
  const hop = COARSE * HOP, length = Math.floor(rises.length / COARSE), { layout, physics, count } = model;
  const maxima = Float64Array.from({ length }, (_, i) => rises.subarray(COARSE * i, COARSE * i + COARSE).reduce((a, b) => Math.max(a, b)));
  const fast = widen(maxima, WIDTHS[0], hop), slow = widen(fast, 0.05, hop), coarse = fast.map((v, i) => v - slow[i]);
  const scale = Math.sqrt(((physics.gravity / 9.81) * 0.048) / mean(layout.height)), starts = [];
  const parts = Array.from({ length: STARTS }, (_, k) => [k, k + 1].map((end) => Math.ceil((end * frictions.length) / STARTS)));
  const tries = model.isReleased ? parts.map(([a, b]) => [frictions.slice(a, b), physics.push]) : Array.from(PUSHES, (push) => [frictions, push * scale]);
  for (const [part, push] of tries) {
    let most = 0, values = null;
    for (const friction of part) {
      const times = model.times(friction, push, 1e-4), last = Math.round(times[count - 1] / hop);
      if (!(last < Infinity)) continue;
      const hits = Int32Array.from(times.subarray(1), (t) => Math.round(t / hop)), padded = new Float64Array(length + 2 * last);
      padded.set(coarse, last);
      const [agreement, place] = bestPlace(padded, hits);
      if (agreement > most) [most, values] = [agreement, [(place - last) * hop, friction, push]];
    }
    if (values) starts.push({ most, values });
  }
  return starts.sort((a, b) => b.most - a.most).map((start) => start.values);
}

// simplex search of Nelder and Mead, as SciPy's
function minimize(value, simplex, { iterations = 120, xatol = 1e-5, fatol = 1e-4 } = {}) {
  const point = (x) => ({ x, f: value(x) }), blend = (a, b, t) => a.map((v, i) => v + t * (b[i] - v));
  let points = simplex.map(point);
  for (let k = 1; ; k++) {
    points.sort((a, b) => a.f - b.f);
    const [best, ...others] = points, worst = points.at(-1);
    const isSmall = others.every(({ x, f }) => Math.abs(f - best.f) <= fatol && x.every((v, i) => Math.abs(v - best.x[i]) <= xatol));
    if (k >= iterations || isSmall) return best.x;
    const centre = best.x.map((_, i) => mean(points.slice(0, -1).map(({ x }) => x[i])));
    const next = point(blend(centre, worst.x, -1));
    let chosen = next;
    if (next.f < best.f) {
      const further = point(blend(centre, worst.x, -2));
      if (further.f < next.f) chosen = further;
    } else if (next.f >= points.at(-2).f) {
      const isOutside = next.f < worst.f, nearer = point(blend(centre, worst.x, isOutside ? -0.5 : 0.5));
      chosen = (isOutside ? nearer.f <= next.f : nearer.f < worst.f) ? nearer : null;
    }
    points = chosen ? [...points.slice(0, -1), chosen] : [best, ...others.map(({ x }) => point(blend(best.x, x, 0.5)))];
  }
}

// start, friction and push near which the widened sounds agree most with the hits
function refine(wides, model, values) {
  WIDTHS.slice(1).forEach((width, w) => {
    const wide = wides[w], last = wide.length - 1;
    const disagreement = (x) => {
      const push = model.isReleased ? model.physics.push : x[2];
      if (!(x[1] >= 0 && x[1] <= 1 && push > 0.5 && push < 1000)) return 0;
      let total = 0;
      for (const t of model.times(x[1], push, 1e-6).subarray(1)) {
        const place = (x[0] + t) / HOP, k = Math.floor(place);
        if (place >= 0 && place <= last) total -= wide[k] + (place - k) * ((wide[k + 1] ?? 0) - wide[k]);
      }
      return total;
    };
    const steps = [width, 0.003, 0.1 * values[2]];
    values = minimize(disagreement, [values, ...steps.map((step, k) => values.map((v, i) => (i === k ? v + step : v)))]);
  });
  return model.isReleased ? [values[0], values[1], model.physics.push] : values;
}

// inverse of a positive definite matrix
function inverse(matrix) {
  const n = matrix.length, rows = matrix.map((row, i) => [...row, ...row.map((_, j) => (i === j ? 1 : 0))]);
  for (let i = 0; i < n; i++) {
    const pivot = rows[i][i];
    rows[i] = rows[i].map((v) => v / pivot);
    for (let k = 0; k < n; k++) if (k !== i) { const factor = rows[k][i]; rows[k] = rows[k].map((v, j) => v - factor * rows[i][j]); }
  }
  return rows.map((row) => row.slice(n));
}

// least squares with Tukey's weights; the sounds are matched anew each time
function fitHits(sounds, model, first, stretches = 0) {
  const guess = model.physics.push, size = 3 + stretches;
  let values = [...first, ...Array(size - first.length).fill(0)], step = values.map(() => 0), covariance = null, times, jacobian, residual, weight, scale;
  for (const reach of REACHES) {
    step[2] = clip(step[2], -0.3 * values[2], 0.3 * values[2]);
    values = values.map((v, k) => v + step[k]);
    values[1] = Math.max(values[1], 0);
    jacobian = model.jacobian(values);
    times = model.times(values[1], values[2]).map((t, i) => values[0] + t + sum(jacobian.slice(3).map((c, k) => c[i] * values[3 + k])));
    const hits = times.subarray(1);
    residual = match(sounds, hits, reach).map((t, k) => t - hits[k]);
    const heard = finite(residual);
    if (heard.length < LEAST_HITS || !jacobian.every((column) => column.every(Number.isFinite))) return { values, times, scale: Infinity };
    scale = Math.max(1.4826 * quantile(heard.map(Math.abs), 0.5), LEAST_SCALE);
    weight = residual.map((r) => (Number.isFinite(r) ? Math.max(1 - (r / scale / TUKEY) ** 2, 0) ** 2 : 0));
    const weighted = (by) => weight.reduce((total, w, k) => (w > 0 ? total + (w / scale ** 2) * by(k) : total), 0);
    const matrix = jacobian.map((a) => jacobian.map((b) => weighted((k) => a[k + 1] * b[k + 1]))), aims = jacobian.map((a) => weighted((k) => a[k + 1] * residual[k]));
    matrix[2][2] += 1 / (model.prior * guess) ** 2;
    aims[2] += (guess - values[2]) / (model.prior * guess) ** 2;
    const spread = inverse(matrix);
    step = spread.map((row) => sum(row.map((v, k) => v * aims[k])));
    const freedom = Math.max(heard.length - size, 1); // the scale is that of residuals of a fit
    covariance = spread.map((row) => row.map((v) => ((v / EFFICIENCY) * heard.length) / freedom));
  }
  return { values, covariance, times, jacobian, residual, weight, credence: credence(sounds, residual.map((r, k) => times[k + 1] + r), times), scale };
}

// times of the sounds of hits, nan where a hit was not heard
const foundOf = (fit) => fit.residual.map((r, k) => (fit.weight[k] > 0 && fit.credence[k] > UNLIKELY ? fit.times[k + 1] + r : NaN));
const nearness = (lag, scale) => (Number.isFinite(lag) ? Math.exp(-0.5 * (lag / scale) ** 2) : 0);

function logLikelihood(fit, scale, { physics, prior }) {
  const near = fit.residual.map((r, k) => Math.log(STRAY + (1 - STRAY) * nearness(r, scale) * fit.credence[k]));
  return sum(near) - 0.5 * (Math.log(fit.values[2] / physics.push) / prior) ** 2;
}

// starts of fits with other pushes, which agree with the later hits too
function rivals(sounds, model, { times, residual, values: [, friction, push] }) {
  const late = Math.floor(residual.length / 4), starts = geomspace(0.3, 3, 93).map((part) => part * push);
  const tries = Array.from(starts, (other) => {
    const hits = model.times(friction, other).subarray(1), lags = finite(residual.map((r, k) => times[k + 1] + r - hits[k]).subarray(late));
    const start = lags.length ? quantile(lags, 0.5) : 0, moved = hits.map((t) => start + t);
    return { values: [start, friction, other], agreement: sum(match(sounds, moved, REACHES.at(-1)).map((t, k) => (Number.isFinite(t) ? Math.exp(-Math.abs(t - moved[k]) / WIDTHS.at(-1)) : 0))) };
  });
  const peaks = findPeaks([0, ...tries.map((t) => t.agreement), 0]).map((k) => tries[k - 1]);
  return peaks.sort((a, b) => b.agreement - a.agreement).slice(0, 8).map((t) => t.values);
}

// the most likely fit; its covariance contains the spread of those that are close
function bestFit(sounds, model) {
  const head = model.head(FIRST_HITS), wides = WIDTHS.slice(1).map((width) => widen(sounds.rises, width, HOP));
  const fitAll = (starts) => starts.map((values) => fitHits(sounds, head, values)).filter((fit) => fit.scale < Infinity);
  const rank = (fits) => {
    const scale = Math.min(...fits.map((fit) => fit.scale));
    return fits.map((fit) => ({ fit, likelihood: logLikelihood(fit, scale, head) })).sort((a, b) => b.likelihood - a.likelihood);
  };
  const fits = fitAll(searchGrid(sounds.rises, head, FRICTIONS).slice(0, STARTS).map((values) => refine(wides, head, values)));
  if (!fits.length) fail(NO_PATTERN);
  const ranked = rank([...fits, ...fitAll(rivals(sounds, head, rank(fits)[0].fit))]), pushes = [], spread = [0, 1, 2].map(() => [0, 0, 0]);
  let best = ranked[0].fit;
  for (const { fit: { values }, likelihood } of ranked) {
    if (pushes.some((push) => Math.abs(values[2] / push - 1) <= 0.02)) continue;
    pushes.push(values[2]);
    const difference = values.map((v, k) => v - ranked[0].fit.values[k]), share = Math.exp(likelihood - ranked[0].likelihood);
    spread.forEach((row, i) => row.forEach((_, j) => { row[j] += share * difference[i] * difference[j]; }));
  }
  for (let hits = best.residual.length; hits < model.count - 1 && best.scale < Infinity;) best = fitHits(sounds, model.head(hits *= 2), best.values);
  if (best.scale === Infinity) fail(NO_PATTERN);
  return { ...best, covariance: best.covariance.map((row, i) => row.map((v, j) => v + spread[i][j])) };
}

// how much better sounds agree with times than with others, in standard deviations; the others are evenly spread, in
// Python random
function contrast(sounds, times, scale, seconds) {
  const agreement = (at) => {
    const hits = at.subarray(1), found = match(sounds, hits, REACHES.at(-1)), likely = credence(sounds, found, at);
    return sum(found.map((t, k) => nearness(t - hits[k], scale) * likely[k]));
  };
  const middle = mean(times), even = (k, by) => (k * by) % 1; // by: those of a plane that is filled evenly
  const others = Array.from({ length: OTHERS }, (_, k) => agreement(times.map((t) => seconds * even(k + 1, 0.7548776662466927) + (0.8 + 0.4 * even(k + 1, 0.5698402909980532)) * (t - middle))));
  return (agreement(times) - mean(others)) / Math.max(deviation(others), 1);
}

// an error if the sounds are not those of one whole wave through the layout
function requirePattern(sounds, model, fit, seconds) {
  const { count } = model, hits = fit.times.subarray(1), found = foundOf(fit), heard = [...found.keys()].filter((k) => Number.isFinite(found[k]));
  if (heard.length < LEAST_HITS) fail(NO_PATTERN);
  const [first, last] = [heard[0], heard.at(-1)], part = fit.times.subarray(first, last + 2);
  if (contrast(sounds, part, fit.scale, seconds) < CHANCE || heard.length < LEAST_HEARD * (part.length - 1)) fail(NO_PATTERN);
  if (first >= SILENT || hits[0] < 0) fail(`the recording begins after the push, or is of another layout: the first hit heard is that of domino ${first + 1} of ${count}; record the whole chain`);
  if (last + 1 <= count - 1 - SILENT || hits.at(-1) > seconds) {
    fail(`the last hit heard is that of domino ${last + 1} of ${count}: the chain stopped there, or the recording was cut; only whole chains can be measured`);
  }
  const known = finite(found), rest = without(sounds, known), [second] = searchGrid(rest.rises, model.head(FIRST_HITS), [fit.values[1]]);
  if (!second) return;
  const times = model.times(fit.values[1], second[2]).map((t) => second[0] + t), again = times.subarray(1);
  const open = [...again.keys()].filter((k) => !known.some((t) => again[k] - t > -0.002 && again[k] - t < ECHO)); // not beside hits of the first
  const others = finite(match(rest, Float64Array.from(open, (k) => again[k]), 0.0015)), twice = others.length / open.length, apart = Math.abs(times[1] - hits[0]);
  if (open.length >= LEAST_HITS && twice > LEAST_HEARD && apart > 4 * ECHO && usualHeight(rest, others) > SECOND_HEIGHT * usualHeight(sounds, known) && contrast(rest, times, 0.001, seconds) > SECOND_CHANCE) {
    fail(`the recording contains two chains: ${(100 * twice).toFixed(0)}% of the hits are heard twice, ${apart.toFixed(2)} s apart; cut the recording to one`);
  }
}

// probability of a larger ratio of the F test, by sums of the beta distribution's density
function chanceOf(ratio, n, m) {
  const STEPS = 4000, part = (end) => sum(linspace(0, 1, STEPS).map((x) => end * Math.sin(end * x) ** (m - 1) * Math.cos(end * x) ** (n - 1)));
  return part(Math.asin(Math.sqrt(m / (m + n * ratio)))) / part(Math.PI / 2);
}

// true if the hits differ smoothly from the model, by an F test and by 0.5 ms
function isRejected(fit, stretched) {
  if (stretched.scale === Infinity) return false;
  const heard = [...fit.residual.keys()].filter((k) => Number.isFinite(fit.residual[k] + stretched.residual[k])), freedom = heard.length - stretched.values.length;
  const stretch = stretched.times.map((_, i) => sum(stretched.jacobian.slice(3).map((c, k) => c[i] * stretched.values[3 + k])));
  if (freedom < STRETCHES.length || deviation(stretch) < LEAST_MISFIT) return false;
  const [one, other] = [fit, stretched].map((f) => sum(heard.map((k) => f.weight[k] * f.residual[k] ** 2)) / sum(heard.map((k) => f.weight[k])));
  return chanceOf((Math.max(one / other - 1, 0) * freedom) / STRETCHES.length, STRETCHES.length, freedom) < REJECTED;
}

/**
 * Measure a chain from the samples of its sound, with the sentences of `domino_env.measure`.
 * @param {Float32Array|Float64Array} samples of any scale
 * @param {number} rate samples per second
 * @param {object} layout that was built
 * @param {object} physics gravity, and the expected push
 */
export function measure(kernels, samples, rate, layout, physics) {
  require("rate", rate, { low: LEAST_RATE, high: 1e6 }, { unit: "samples per second" });
  const model = new Model(kernels, layout, physics), { count } = model, seconds = samples.length / rate;
  if (count <= LEAST_HITS) fail(`the layout has ${count} dominoes: measure one of at least ${LEAST_HITS + 1}`);
  if (samples.length < rate * HOP * 100 || samples.every((v) => v === samples[0])) fail("the recording is silent: record it again");
  const sounds = findSounds(samples, rate), fit = bestFit(sounds, model);
  requirePattern(sounds, model, fit, seconds);
  const stretched = fitHits(sounds, model, fit.values, STRETCHES.length), modelRejected = isRejected(fit, stretched), best = modelRejected ? stretched : fit;
  const { times, covariance, jacobian, values: [start, friction, push] } = best, curve = times.map((t) => t - times[0]), predicted = model.times(friction, push);
  const [, frictionError, pushError] = covariance.map((row, k) => Math.sqrt(row[k]));
  const arrivalTimes = Float64Array.of(0, ...foundOf(best).map((t) => t - times[0])), change = jacobian.map((column) => column[count - 1] - column[0]);
  const variance = sum(change.map((a, i) => sum(change.map((b, j) => a * b * covariance[i][j])))), duration = curve[count - 1];
  const meanSpeed = positions(layout)[count - 1] / duration, meanSpeedError = meanSpeed * Math.hypot(Math.sqrt(variance) / duration, CLOCK);
  const misfit = arrivalTimes.map((t, k) => t - predicted[k]), known = finite(misfit.subarray(1)), rms = Math.sqrt(mean(known.map((v) => v * v)));
  const verdict = `${known.length} of ${count - 1} hits heard: ${meanSpeed.toFixed(4)} ± ${meanSpeedError.toFixed(4)} m/s, friction ${friction.toFixed(4)} ± ` +
    `${frictionError.toFixed(4)}, push ${push.toFixed(2)} ± ${pushError.toFixed(2)} rad/s; the model ${modelRejected ? "is rejected" : "explains the hits"} ` +
    `(differences ${(1000 * rms).toFixed(2)} ms RMS, ${(1000 * known.reduce((a, b) => Math.max(a, Math.abs(b)), 0)).toFixed(2)} ms at most)`;
  return { friction, frictionError, push, pushError, meanSpeed, meanSpeedError, arrivalTimes, predicted, curve, misfit, modelRejected, start: times[0], hop: HOP, rises: sounds.rises, verdict };
}
