/**
 * The simulator: layouts, waves, gradients, motion and free-standing dominoes, as in Python.
 *
 * `chain.wasm` has the kernels (`make wasm`); here are the arrays that they read and write, derived
 * values, and checks with Python's sentences. All quantities are in SI units. A layout is a plain
 * object: spacing (N-1), thickness (N) and height (N) as Float64Array, width, density (a number or
 * N), and on uneven ground rise (N-1) and tilt (N).
 */

export const STANDARD = { height: 0.048, width: 0.024, thickness: 0.0075, density: 1040 };
const RELEASED = 0.1; // angular velocity at the balance of a released domino, over the smallest push
const PIECES = 32; // samples of a fall, less one
const MAX_STEP = 0.999; // largest ratio of the next pivot's rise to the height that a tip strikes
const OUTCOMES = ["PROPAGATED", "STALLED", "OUT_OF_REACH", "JAMMED", "NO_RIGID_ANSWER"];
const EXPLANATIONS = {
  PROPAGATED: "the wave completed: the last domino passed its tipping angle",
  STALLED: "the wave stalled: the leading domino stopped before it reached the next; push harder, " +
    "or use wider gaps or thinner dominoes near where it stopped",
  OUT_OF_REACH: "a gap is out of reach: it is not smaller than the height of the domino before it; " +
    "bring the next domino closer",
  JAMMED: "the chain jammed: friction is too high for the stack to pass the push on; use less " +
    "friction, thinner dominoes or narrower gaps there",
  NO_RIGID_ANSWER: "rigid bodies have no answer here (Painlevé's paradox: the effective inertia is " +
    "not positive); use less friction or thinner dominoes there",
};
const PHYSICS = {
  friction: [0, "coefficient between dominoes; 0 for none"],
  gravity: [1e-9, "[m/s²]; 9.81 on Earth"],
  push: [1e-9, "angular velocity of domino 0 at t = 0 [rad/s]"],
};

// --- Numbers in sentences -------------------------------------------------------------------------

/** Return a number as Python's format "g" writes it, with some significant digits. */
export function general(value, digits = 6) {
  if (!Number.isFinite(value)) return String(value).replace("Infinity", "inf").replace("NaN", "nan");
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e").map(Number);
  if (value !== 0 && (exponent < -4 || exponent >= digits)) {
    const power = String(Math.abs(exponent)).padStart(2, "0");
    return `${mantissa}e${exponent < 0 ? "-" : "+"}${power}`;
  }
  return String(Number(value.toPrecision(digits)));
}

/** Return a float as Python's repr writes it. */
export function repr(value) {
  if (!Number.isFinite(value)) return general(value);
  const size = Math.abs(value);
  if (size > 0 && (size < 1e-4 || size >= 1e16)) return value.toExponential().replace(/e([+-])(\d)$/, "e$10$2");
  const text = Object.is(value, -0) ? "-0" : String(value);
  return text.includes(".") ? text : `${text}.0`;
}

/** Return "did you mean 'height'? " for a name that is like one of some others, or "". */
export function didYouMean(name, others) {
  const pairs = (word) => Array.from(word, (_, i) => word.slice(i, i + 2));
  const alike = (other) => pairs(other).filter((pair) => pairs(name).includes(pair)).length / Math.max(other.length, name.length);
  const nearest = others.reduce((a, b) => (alike(b) > alike(a) ? b : a));
  return alike(nearest) >= 0.5 ? `did you mean '${nearest}'? ` : "";
}

/** Return a range as Python's messages have it, such as ", more than 0". */
export function rangeText({ low, above, high, below }) {
  if (low !== undefined && high !== undefined) return ` from ${general(low)} to ${general(high)}`;
  const words = [["at least", low], ["more than", above], ["at most", high], ["less than", below]];
  return words.filter(([, x]) => x !== undefined).map(([word, x]) => `, ${word} ${general(x)}`).join("");
}

/** Throw a RangeError for anything but a finite number in a range. */
export function require(name, value, range = {}, { unit = "", hint = "", whole = false, inArray = false } = {}) {
  const { low = -Infinity, above = -Infinity, high = Infinity, below = Infinity } = range;
  const isNumber = typeof value === "number" && Number.isFinite(value) && (!whole || Number.isInteger(value));
  if (isNumber && value >= low && value > above && value <= high && value < below) return;
  const given = typeof value === "number" ? (inArray ? repr(value) : general(value, 17)) : `'${value}'`;
  const [space, ending] = [unit && " ", hint && ` (${hint})`];
  throw new RangeError(
    `${name} = ${given}${space}${unit}: give a ${whole ? "whole" : "finite"} number${rangeText(range)}${ending}`,
  );
}

function requireAll(name, values, unit) {
  for (let i = 0; i < values.length; i++) {
    if (!(values[i] > 0 && values[i] < Infinity)) {
      require(`${name}[${i}]`, values[i], { above: 0 }, { unit, inArray: true });
    }
  }
}

// --- Layouts --------------------------------------------------------------------------------------

/** Return an array of `count` numbers from one number or as many. */
export function full(name, values, count) {
  if (typeof values === "number") return new Float64Array(count).fill(values);
  if (values?.length === count) return Float64Array.from(values);
  throw new RangeError(`${name} has shape (${values?.length},): give (${count},), or one number for all`);
}

/** Return the rise of each next pivot, normal to the ground under it (N-1) [m]. */
function normalRises({ spacing, thickness, rise, tilt }) {
  if (!rise) return new Float64Array(spacing.length);
  return spacing.map((s, i) => (s + thickness[i + 1]) * Math.tan(tilt[i + 1]) + rise[i] / Math.cos(tilt[i + 1]));
}

/** Return the distances from pivot to pivot (N-1) [m]. */
export function pitch(layout) {
  const { spacing, thickness, rise } = layout;
  if (!rise) return spacing.map((s, i) => s + thickness[i + 1]);
  const normal = normalRises(layout);
  return spacing.map((s, i) => Math.hypot(s + thickness[i + 1], normal[i]));
}

/** Return the positions of the pivots along the line through them (N) [m], the first at 0. */
export function positions(layout) {
  const places = new Float64Array(layout.thickness.length);
  pitch(layout).forEach((distance, i) => { places[i + 1] = places[i] + distance; });
  return places;
}

/** Push of a released first domino of a layout [rad/s], as `released_push` of domino_env/physics/physics.py. */
export function releasedPush({ height: [height], thickness: [thickness], tilt }, gravity) {
  const angle = Math.atan2(thickness, height) - (tilt ? tilt[0] : 0);
  return Math.hypot(1, RELEASED) * Math.sqrt((6 * gravity) / Math.hypot(height, thickness)) * Math.sin(0.5 * angle);
}

/** Return the coordinates [x, z] of the pivots, x forward and z up [m], the first at 0. */
export function pivots(layout) {
  const { spacing, thickness, rise, tilt } = layout;
  if (!rise) return Array.from(positions(layout), (x) => [x, 0]);
  const places = [[0, 0]];
  for (let i = 0; i < rise.length; i++) {
    const forward = (spacing[i] + thickness[i + 1] + rise[i] * Math.sin(tilt[i + 1])) / Math.cos(tilt[i + 1]);
    places.push([places[i][0] + forward, places[i][1] + rise[i]]);
  }
  return places;
}

/** Throw a RangeError for a layout that Python's `Layout` does not accept. */
export function checkLayout(layout) {
  const { spacing, thickness, height, density, width, rise, tilt } = layout;
  const count = spacing.length + 1;
  for (const [name, values] of Object.entries({ thickness, height, density, tilt })) {
    if (values?.length && values.length !== count) full(name, values, count);
  }
  if (rise && rise.length !== count - 1) full("rise", rise, count - 1);
  requireAll("spacing", spacing, "m");
  requireAll("thickness", thickness, "m");
  requireAll("height", height, "m");
  requireAll("density", typeof density === "number" ? [density] : density, "kg/m³");
  require("width", width ?? STANDARD.width, { above: 0 }, { unit: "m" });
  if (rise || height.some((h, i) => i > 0 && h > height[i - 1]) || height.some((h, i) => h < height[0])) {
    const fault = standingFault(layout);
    if (fault) throw new RangeError(fault);
  }
}

/** Return a sentence about a domino that cannot stand or a contact that the model lacks, or "". */
function standingFault(layout) {
  const { spacing, thickness, height, rise, tilt } = layout;
  const [n, slope] = [thickness.length, (i) => (tilt ? tilt[i] : 0)];
  for (const [name, values, unit] of [["rise", rise ?? [], "m"], ["tilt", tilt ?? [], "rad"]]) {
    const i = values.findIndex((x) => !Number.isFinite(x));
    if (i >= 0) return `${name}[${i}] = ${repr(values[i])} ${unit}: give a finite number`;
  }
  const degrees = (x) => general((x * 180) / Math.PI, 4);
  for (let i = 0; i < n; i++) {
    const steepest = Math.atan2(thickness[i], height[i]);
    if (Math.abs(slope(i)) >= steepest) {
      return `domino ${i} does not stand: tilt[${i}] is ${degrees(slope(i))}°, and it tips over by itself ` +
        `from ${degrees(steepest)}° on (the angle whose tangent is thickness over height); make the ` +
        "ground flatter there, or the domino thicker";
    }
  }
  const offset = normalRises(layout);
  const least = spacing.map((_, i) => height[i] * Math.sin(slope(i) - slope(i + 1)));
  const strike = spacing.map((s, i) => Math.sqrt(Math.max(height[i] ** 2 - s ** 2, 0)));
  const first = (test) => spacing.findIndex((s, i) => s < height[i] && test(s, i));
  let i = first((s, k) => least[k] >= s);
  if (i >= 0) {
    return `dominoes ${i} and ${i + 1} lean against each other before anything falls, as the ground ` +
      `between them is hollow: make spacing[${i}] = ${repr(spacing[i])} m more than ${general(least[i])} m, ` +
      "or the difference of their tilts smaller";
  }
  i = first((s, k) => offset[k] > Math.min(s, MAX_STEP * strike[k]));
  if (i >= 0) {
    const limit = Math.min(spacing[i], MAX_STEP * strike[i]);
    return `domino ${i + 1} stands ${general(offset[i])} m above domino ${i}, normal to its own ground: the ` +
      `model accepts at most ${general(limit)} m over spacing[${i}] = ${repr(spacing[i])} m; make the step lower`;
  }
  i = first((s, k) => strike[k] - offset[k] > Math.min(height[k + 1] * (1 + 1e-12), (1 + MAX_STEP) * strike[k]));
  if (i < 0) return "";
  const limit = Math.min(height[i + 1], (1 + MAX_STEP) * strike[i]);
  return `domino ${i} (height ${repr(height[i])} m) would strike ${general(strike[i] - offset[i])} m up domino ` +
    `${i + 1} (height[${i + 1}] = ${repr(height[i + 1])} m), normal to its own ground: at most ` +
    `${general(limit)} m; widen spacing[${i}] = ${repr(spacing[i])} m, make domino ${i + 1} taller, or the ` +
    "ground less hollow";
}

/** Throw a RangeError for friction, gravity or push out of range. */
export function checkPhysics(physics) {
  for (const [name, [low, hint]] of Object.entries(PHYSICS)) require(name, physics[name], { low, high: 1e9 }, { hint });
}

// --- Results --------------------------------------------------------------------------------------

/** Wave of a layout: arrival times, velocities and outcome, with the meanings of Python's `Wave`. */
export class Wave {
  constructor(layout, physics, rtol, summary, arrivals) {
    const field = (k) => {
      const values = new Float64Array(arrivals.length / 4);
      for (let i = 0; i < values.length; i++) values[i] = arrivals[4 * i + k];
      return values;
    };
    Object.assign(this, { layout, physics, rtol, ...summary });
    this.arrivalTimes = field(0);
    this.releaseVelocity = field(1);
    this.impactVelocity = field(2).subarray(0, -1);
    this.stallMargin = field(3);
  }

  get propagated() { return this.outcome === "PROPAGATED"; }
  get converged() { return this.errorEstimate <= this.rtol; }

  /** Length of the layout over the last arrival time [m/s]; 0 for a wave that stops. */
  get meanSpeed() {
    const n = this.arrivalTimes.length;
    return this.propagated && n > 1 ? positions(this.layout)[n - 1] / this.arrivalTimes[n - 1] : 0;
  }

  /** Pitches over the times between hits (N-1) [m/s]; nan where not reached. */
  get localSpeed() {
    const t = this.arrivalTimes;
    return pitch(this.layout).map((p, i) => (t[i + 1] < Infinity ? p / (t[i + 1] - t[i]) : NaN));
  }

  /** Reason why the wave ended, the place and the next action, in a sentence. */
  get explanation() {
    if (this.propagated) return `${EXPLANATIONS.PROPAGATED}.`;
    const leader = this.stallMargin.filter(Number.isFinite).length - 1;
    const reason = this.outcome === "STALLED" && leader === 0
      ? `the wave stalled: the push of ${general(this.physics.push)} rad/s is too small, the first domino ` +
        "falls back; push harder (smallest_push computes how hard)"
      : EXPLANATIONS[this.outcome];
    return `${reason} (leading domino ${leader}; ${this.hit} of ${this.arrivalTimes.length} were hit, ` +
      `${this.toppled} toppled).`;
  }
}

/** Leans of all dominoes of a chain over time. */
export class Motion {
  /** samples: rows of `PIECES + 1` records (angle, time since the hit, speed), one for each fall. */
  constructor(kernels, layout, samples) {
    this.kernels = kernels;
    this.layout = layout;
    this.samples = samples;
    this.starts = new Float64Array(samples.length / (3 * PIECES + 3) + 1);
    for (let k = 1; k < this.starts.length; k++) {
      this.starts[k] = this.starts[k - 1] + samples[k * (3 * PIECES + 3) - 2];
    }
    this.contacts = contactGeometry(layout);
  }

  /** Time at which nothing moves any more [s]. */
  get end() { return this.starts.at(-1); }

  /** Return the leading domino at a time and its lean from the vertical: {domino, lean}. */
  leader(time) {
    const t = Math.min(Math.max(time, 0), this.end);
    const n = lastAtMost(this.starts.length - 1, (k) => this.starts[k], t);
    const [row, since] = [n * (3 * PIECES + 3), t - this.starts[n]];
    const at = (j, k) => this.samples[row + 3 * j + k]; // 0: angle, 1: time, 2: speed
    const j = Math.min(lastAtMost(PIECES + 1, (k) => at(k, 1), since), PIECES - 1);
    const h = at(j + 1, 1) - at(j, 1);
    const x = Math.min(Math.max((since - at(j, 1)) / (h > 0 ? h : 1), 0), 1), y = 1 - x;
    const angle = at(j, 0) * y * y * (1 + 2 * x) + at(j + 1, 0) * x * x * (1 + 2 * y) +
      h * x * y * (at(j, 2) * y - at(j + 1, 2) * x);
    return { domino: n, lean: angle + (this.layout.tilt?.[n] ?? 0) };
  }

  /** Return the leans of all dominoes from the vertical at a time (N) [rad]. */
  leans(time) {
    const { domino, lean } = this.leader(time);
    return this.kernels.leans(this.layout, this.contacts, domino, lean);
  }
}

/** Return the last of `count` rising numbers that is at most x, or the first. */
function lastAtMost(count, value, x) {
  let [low, high] = [0, count];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (value(middle) <= x) low = middle; else high = middle;
  }
  return low;
}

/** Return the geometry of the contacts for the kernel of leans (N-1 rows of 7). */
function contactGeometry(layout) {
  const { spacing, thickness, height, tilt } = layout, rises = normalRises(layout);
  const rows = new Float64Array(7 * spacing.length);
  for (let i = 0; i < spacing.length; i++) {
    const d = thickness[i + 1] / height[i], p = spacing[i] / height[i] + d, e = rises[i] / height[i];
    const r = Math.hypot(p, e), slant = Math.atan2(e, p);
    const cosine = Math.min(Math.max((r * r + d * d - 1) / (2 * d * r), -1), 1);
    rows.set([p, e, d, r, slant, Math.acos(cosine) - slant, tilt?.[i + 1] ?? 0], 7 * i);
  }
  return rows;
}

// --- Free-standing dominoes: as in `domino_env.rigid.simulation` -----------------------------------

const COARSEST = 4, FINEST = 1 / 32, SWEEP_TOLERANCE = 5e-6, SAFETY = 3, CHANCE_ERROR = 2e-4;
const FIXED_PIVOTS = -1, FAILED = 2;
const WINDOW = 24, NEGLIGIBLE = 1e-4, PATIENCE = 3;

/** Return the number of dominoes behind the leader that still move. */
function windowSize(layout) {
  const { thickness, height } = layout, decay = [0];
  pitch(layout).forEach((p, i) => {
    const ratio = 1 - Math.sqrt(Math.max(p ** 2 - thickness[i + 1] ** 2, 0)) / height[i];
    decay.push(decay[i] - Math.log(Math.min(Math.max(ratio, 1e-3), 1 - 1e-3)));
  });
  let first = 0, most = 0; // first: index of the first domino with a larger decay than allowed
  decay.forEach((x, i) => {
    while (first < decay.length && decay[first] <= x + Math.log(NEGLIGIBLE)) first += 1;
    most = Math.max(most, i - first);
  });
  return Math.max(WINDOW, most + 1);
}

/** Return the time without a hit after which a wave has stopped [s]. */
function longestWait({ thickness, height, tilt }, { gravity, push }) {
  const [h, d, a] = [height[0], thickness[0], tilt?.[0] ?? 0], diagonal = Math.hypot(h, d);
  const lift = diagonal - h * Math.cos(a) - d * Math.sin(a);
  const tipping = Math.sqrt(3 * gravity * lift) / diagonal;
  return PATIENCE * Math.sqrt(Math.max(...height) / gravity) + 2 / Math.max(push, tipping);
}

/** Return the largest relative difference of arrival times; Infinity if other dominoes are hit. */
function largestDifference(times, reference) {
  let largest = 0;
  for (let k = 0; k < times.length; k++) {
    if (Number.isFinite(times[k]) !== Number.isFinite(reference[k])) return Infinity;
    if (Number.isFinite(times[k]) && reference[k] > 0) largest = Math.max(largest, Math.abs(times[k] / reference[k] - 1));
  }
  return largest;
}

// --- The module -----------------------------------------------------------------------------------

const { sin, cos, tan, asin, acos, atan, atan2, exp, log, log10 } = Math;
const MATHS = { sin, cos, tan, asin, acos, atan, atan2, exp, log, log10 };

/** Load `chain.wasm` from its bytes. */
export async function loadKernels(bytes) {
  const { instance } = await WebAssembly.instantiate(bytes, { env: MATHS });
  return new Kernels(instance.exports);
}

class Kernels {
  constructor(exports) { this.exports = exports; }

  /** Take memory for some numbers of bytes, and free what was taken before. */
  #take(...sizes) {
    this.exports.rewind(0);
    return sizes.map((size) => this.exports.take(size));
  }

  #numbers(pointer, length) { return new Float64Array(this.exports.memory.buffer, pointer, length); }

  /** Write a layout and a setting; return 1 for uneven ground, else 0. */
  #write(layout, physics, rtol, table, setting) {
    const { spacing, thickness, height, density, rise, tilt } = layout;
    this.#fill(table, thickness.length, [spacing, thickness, height, density, ...(rise ? [rise, tilt] : [])]);
    this.#numbers(setting, 4).set([physics.friction, physics.gravity, physics.push, rtol]);
    return rise ? 1 : 0;
  }

  /** Write rows of n numbers: each an array of at most n, or one number for all. */
  #fill(pointer, n, rows) {
    rows.forEach((row, k) => {
      const written = this.#numbers(pointer + 8 * n * k, n);
      if (typeof row === "number") written.fill(row); else written.set(row);
    });
  }

  /** Simulate with an event tape of some length; return the wave and what `pullback` needs. */
  #run(layout, physics, rtol, events, exactMargins) {
    const n = layout.thickness.length;
    const [table, setting, arrivals, summary, tape] = this.#take(48 * n, 32, 32 * n, 88, 96 * events);
    const uneven = this.#write(layout, physics, rtol, table, setting);
    this.exports.run_simulate(n, uneven, table, setting, exactMargins ? 1 : 0, arrivals, summary, tape, events);
    const whole = new BigInt64Array(this.exports.memory.buffer, summary, 11);
    const count = (k) => Number(whole[k]), numbers = this.#numbers(summary, 11);
    const wave = new Wave(layout, physics, rtol, {
      outcome: OUTCOMES[count(0)], hit: count(1), toppled: count(2), reach: numbers[3],
      totalTime: numbers[4], errorEstimate: numbers[5], flushes: count(6), releases: count(7),
      largestFlushLoss: numbers[8], lowestStallMargin: numbers[9],
    }, this.#numbers(arrivals, 4 * n));
    return { wave, uneven, table, setting, tape, events: count(10) };
  }

  /** Simulate the wave of a layout; `exactMargins: false` locates minima of ω² only near a stall. */
  simulate(layout, physics, { rtol = 1e-8, exactMargins = true } = {}) {
    this.#check(layout, physics, rtol);
    return this.#run(layout, physics, rtol, 0, exactMargins).wave;
  }

  /**
   * Return the wave and the derivatives of Σ arrivalBar · arrival times by the layout and physics.
   *
   * arrivalBar: N numbers, or a function of the wave that returns them (null: no derivatives).
   */
  gradient(layout, physics, arrivalBar, { rtol = 1e-8 } = {}) {
    this.#check(layout, physics, rtol);
    const n = layout.thickness.length;
    let events = 4 * n + 16, run = this.#run(layout, physics, rtol, events, true);
    if (run.events > events) {
      events = run.events;
      run = this.#run(layout, physics, rtol, events, true);
    }
    const { wave } = run, bar = typeof arrivalBar === "function" ? arrivalBar(wave) : arrivalBar;
    if (!bar) return { wave };
    for (let k = 0; k < n; k++) {
      if (bar[k] !== 0 && !(wave.arrivalTimes[k] < Infinity)) {
        throw new RangeError(`arrivalBar[${k}] = ${bar[k]}, but the wave did not reach domino ${k}: leave it at 0`);
      }
    }
    const [given, bars, byPhysics] = [8 * n, 48 * n, 24].map((size) => this.exports.take(size));
    this.#fill(given, n, [bar]);
    this.exports.run_pullback(n, run.uneven, run.table, run.setting, run.tape, run.events, given, bars, byPhysics);
    const row = (k, length) => this.#numbers(bars + 8 * n * k, length).slice();
    const [friction, gravity, push] = this.#numbers(byPhysics, 3);
    const derivatives = { spacing: row(0, n - 1), thickness: row(1, n), height: row(2, n), density: row(3, n) };
    const ground = run.uneven ? { rise: row(4, n - 1), tilt: row(5, n) } : {};
    return { wave, ...derivatives, ...ground, friction, gravity, push };
  }

  /** Return the motion of a wave. */
  motion({ layout, physics, rtol }) {
    const n = layout.thickness.length, size = 3 * (PIECES + 1);
    const [table, setting, snapshots] = this.#take(48 * n, 32, 8 * size * n);
    const uneven = this.#write(layout, physics, rtol, table, setting);
    this.#numbers(snapshots, size * n).fill(0);
    const falls = this.exports.run_motion(n, uneven, table, setting, snapshots);
    return new Motion(this, layout, this.#numbers(snapshots, size * falls).slice());
  }

  /** Return the leans of all dominoes (N) [rad] from that of the leader; see `Motion`. */
  leans(layout, contacts, leader, lean) {
    const n = layout.thickness.length, [rows, leans] = this.#take(8 * contacts.length, 8 * n);
    this.#fill(rows, contacts.length, [contacts]);
    this.#fill(leans, n, [layout.tilt ?? 0]);
    this.exports.run_lean(n, rows, leader, lean, leans);
    return this.#numbers(leans, n).slice();
  }

  /** Return rise and tilt of a layout on curved ground: knots (K), starts (K+1), pieces (4K+4). */
  place(layout, curve, knots) {
    const n = layout.thickness.length, [table, ground] = this.#take(48 * n, 8 * curve.length);
    this.#fill(table, n, [layout.spacing, layout.thickness]);
    this.#fill(ground, curve.length, [curve]);
    this.exports.run_place(n, table, knots, ground);
    return { rise: this.#numbers(table + 32 * n, n - 1).slice(), tilt: this.#numbers(table + 40 * n, n).slice() };
  }

  /** Return derivatives by spacing and thickness of dominoes that move along curved ground. */
  alongCurve(layout, curve, knots, { spacing, thickness, rise, tilt }) {
    const n = layout.thickness.length, [table, ground, bars] = this.#take(48 * n, 8 * curve.length, 48 * n);
    this.#fill(table, n, [layout.spacing, layout.thickness, 0, 0, layout.rise, layout.tilt]);
    this.#fill(ground, curve.length, [curve]);
    this.#fill(bars, n, [spacing, thickness, 0, 0, rise, tilt]);
    this.exports.run_place_back(n, table, knots, ground, bars);
    return { spacing: this.#numbers(bars, n - 1).slice(), thickness: this.#numbers(bars + 8 * n, n).slice() };
  }

  /**
   * Simulate free-standing dominoes on a floor, or on fixed pivots if its friction is null.
   *
   * Steps are halved until the arrival times converge; takes seconds. Returns arrivalTimes, lean
   * (largest), slid, opened, openedAt, topples (true where a domino fell), hit, toppled, propagated,
   * meanSpeed, errorEstimate and converged.
   */
  standing(layout, physics, floorFriction, { rtol = 1e-3 } = {}) {
    this.#check(layout, physics, 1e-8);
    if (floorFriction !== null) require("floor_friction", floorFriction, { low: 0 }, { hint: "None for fixed pivots" });
    require("rtol", rtol, { low: 1e-5, below: 1 }, { hint: "1e-3 is quick" });
    let run = this.#stand(layout, physics, floorFriction, COARSEST), largest = 0, errorEstimate = Infinity;
    for (let coarseness = COARSEST / 2; coarseness >= FINEST; coarseness /= 2) {
      const finer = this.#stand(layout, physics, floorFriction, coarseness);
      largest = Math.max(largestDifference(run[0], finer[0]), 0.5 * largest);
      errorEstimate = SAFETY * largest + CHANCE_ERROR * coarseness;
      run = finer;
      if (errorEstimate <= rtol && coarseness <= COARSEST / 4) break;
    }
    const [arrivalTimes, lean, slid, opened, openedAt] = run, n = lean.length;
    const topples = Array.from(lean, (x, i) => x > Math.atan2(layout.thickness[i], layout.height[i]));
    const hit = arrivalTimes.filter(Number.isFinite).length, toppled = topples.filter(Boolean).length;
    const last = arrivalTimes[n - 1], meanSpeed = last > 0 && last < Infinity ? positions(layout)[n - 1] / last : 0;
    return {
      layout, physics, floorFriction, rtol, arrivalTimes, lean, slid, opened, openedAt, topples, hit, toppled,
      propagated: hit === n && toppled === n, meanSpeed, errorEstimate, converged: errorEstimate <= rtol,
    };
  }

  /** Simulate with steps of one coarseness; return arrival times, leans, slips, openings, their times. */
  #stand(layout, physics, floorFriction, coarseness) {
    const { thickness, height, density } = layout, n = height.length, fixed = floorFriction === null;
    const tilt = layout.tilt ?? new Float64Array(n), places = pivots(layout), tallest = Math.max(...height);
    const mass = height.map((h, i) => (typeof density === "number" ? density : density[i]) * h * thickness[i]);
    const inertia = mass.map((m, i) => (m * (height[i] ** 2 + thickness[i] ** 2)) / (fixed ? 3 : 12));
    const [table, setting, record] = this.#take(88 * n, 56, 40 * n);
    this.#fill(table, n, [
      height, thickness, mass, inertia, places.map(([x]) => x), places.map(([, z]) => z), tilt,
      tilt.map(Math.sin), tilt.map(Math.cos), fixed ? 0 : thickness.map((d) => 0.5 * d),
      fixed ? 0 : height.map((h) => -0.5 * h),
    ]);
    const tolerance = SWEEP_TOLERANCE * coarseness * Math.sqrt(physics.gravity * tallest);
    this.#numbers(setting, 7).set([
      physics.friction, fixed ? FIXED_PIVOTS : floorFriction, physics.gravity, coarseness, tolerance,
      windowSize(layout), longestWait(layout, physics),
    ]);
    const results = this.#numbers(record, 5 * n).fill(0);
    results.fill(Infinity, 1, n);
    if (this.exports.run_standing(n, table, setting, physics.push, record) === FAILED) {
      throw new Error("a velocity is not a number; this is a fault of the simulator: please report the layout");
    }
    return [n, n, n, n - 1, n - 1].map((length, k) => this.#numbers(record + 8 * n * k, length).slice());
  }

  #check(layout, physics, rtol) {
    checkLayout(layout);
    checkPhysics(physics);
    require("rtol", rtol, { low: 1e-13, high: 1e-3 });
  }
}
