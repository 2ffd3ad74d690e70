/**
 * Scenes: rules, scores and best equal gaps, as `domino_env.scenes`.
 *
 * A document has the tables and keys of a scene file. Scores follow from the wave on fixed pivots
 * or, with a floor, from free-standing dominoes; placement errors and random orders are not drawn.
 */

import { Ground } from "./ground.js";
import { STANDARD, didYouMean, full, general, pitch, positions, releasedPush, repr, require } from "./kernels.js";

const LENGTH_TOLERANCE = 1e-9; // [m]
const SCORE_RTOL = 1e-10;
const GROUND_TOLERANCE = 1e-9; // [m], [rad]
const SAME_THICKNESS = 1e-9; // [m] in a stock
const SAME_PUSH = 1e-9; // relative difference from the push of a released domino
const MAX_DOMINOES = 100000;

// --- Documents ------------------------------------------------------------------------------------

const number = (low, high, hint) => ({ low, high, hint });
const size = (hint) => number(1e-9, 1e9, hint);
const whole = (low, high, hint) => ({ low, high, hint, whole: true });
const RANGE = {
  fixed: size("the only value allowed [m]"), min: size("smallest value [m]"), max: size("largest value [m]"), of: {},
};
// keys of each table with their ranges; `needed` are required, {} is checked elsewhere
const TABLES = {
  row: {
    count: { ...whole(2, MAX_DOMINOES, "number of dominoes"), needed: true },
    height: size("height of every domino, or of the first [m]"),
    width: size("size across the chain; times do not depend on it [m]"),
    density: size("density of every domino [kg/m³]"),
    first_thickness: size("thickness of domino 0 [m]; required if thickness is free"),
    length: size("exact distance from first to last pivot [m]"),
  },
  spacing: RANGE,
  thickness: RANGE,
  growth: {
    min: number(1, 1e9, "smallest ratio"), max: { ...number(1, 1e9, "largest ratio"), needed: true },
  },
  physics: {
    friction: number(0, 1e9, "coefficient between dominoes; 0 for none"),
    gravity: size("[m/s²]; 9.81 on Earth"),
    push: size("angular velocity of domino 0 at t = 0 [rad/s]"),
    floor_friction: number(0, 1e9, "friction coefficient of the floor; without it pivots are fixed"),
  },
  limits: { stall_margin: { low: 0, below: 1, hint: "smallest allowed stall margin", needed: true } },
  stock: { thickness: { needed: true }, count: { needed: true }, hand: whole(1, MAX_DOMINOES, "pieces held at a time, drawn in random order; without it, the whole box") },
  ground: { slope: {}, profile: {} },
  tempo: {
    from: size("frequency between dominoes 0 and 1 [hits/s]"), to: size("frequency between the last two [hits/s]"),
    times: {}, tolerance: size("root-mean-square error that halves the score [s]"),
  },
  placement: {
    deviation: { ...size("standard deviation of each gap's error [m]"), needed: true },
    draws: whole(0, 100000, "number of draws that are scored; 0: no errors"),
    quantile: { above: 0, high: 1, hint: "share of the draws that may score less; default: their mean" },
    seed: whole(0, 2 ** 63, "seed of the first draw"),
  },
  run_out: {
    count: { ...whole(1, MAX_DOMINOES, "number of fixed dominoes"), needed: true },
    spacing: { ...size("free gap before each of them [m]"), needed: true },
  },
};
const TOP = ["name", "title", "objective"], OBJECTIVES = ["magnify", "mean_speed", "tempo"];
const EXCLUSIVE = [
  ["thickness", "stock"], ["physics.floor_friction", "limits"], ["stock.hand", "physics.floor_friction"],
  ["stock.hand", "row.length"], ["run_out", "stock"], ["run_out", "growth"], ["run_out", "tempo"],
  ["run_out", "ground.profile"], ["ground.profile", "row.length"], ["ground.profile", "growth"],
];

/** Throw a RangeError about the first key of a document with another value than a scene may have. */
function checkDocument(document) {
  const fail = (sentence) => { throw new RangeError(sentence); };
  const allowed = (key, names) => `${didYouMean(key, names)}allowed: ${names.join(", ")}`;
  for (const [name, table] of Object.entries(document)) {
    if (TOP.includes(name)) continue;
    const keys = TABLES[name] ?? fail(`unknown key '${name}': ${allowed(name, [...TOP, ...Object.keys(TABLES)])}`);
    if (typeof table !== "object") fail(`${name} = ${table}: give a table of ${Object.keys(keys).join(", ")}`);
    for (const key of Object.keys(table)) {
      const range = keys[key] ?? fail(`unknown key '${name}.${key}': ${allowed(key, Object.keys(keys))}`);
      if (range.hint) require(`${name}.${key}`, table[key], range, { hint: range.hint, whole: range.whole });
    }
  }
  if (!OBJECTIVES.includes(document.objective ?? "mean_speed")) {
    fail(`objective = ${typeof document.objective === "string" ? `'${document.objective}'` : document.objective}: choose one of ${OBJECTIVES.join(", ")}`);
  }
  for (const [name, keys] of Object.entries(TABLES)) {
    if (!document[name] && ["row", "spacing"].includes(name)) fail(`${name} is missing: give a table of ${Object.keys(keys).join(", ")}`);
    for (const [key, range] of Object.entries(document[name] ? keys : {})) {
      if (range.needed && document[name][key] === undefined) fail(`${name}.${key} is missing: give it`);
    }
  }
  const at = (place) => place.split(".").reduce((value, key) => value?.[key], document);
  if (!document.thickness && !document.stock) fail("thickness is missing: give a table of fixed, min, max, of");
  for (const [a, b] of EXCLUSIVE) {
    if (at(a) !== undefined && at(b) !== undefined) fail(`${a} and ${b} exclude each other: leave one of them out`);
  }
  for (const name of ["spacing", "thickness"].filter((key) => document[key])) {
    const { fixed, min, max, of } = document[name];
    const given = ["fixed", "min", "max"].filter((key) => document[name][key] !== undefined);
    if (!["fixed", "min,max"].includes(given.join())) {
      fail(`${name}: it has ${given.join(" and ") || "no value"}: give either fixed, or min and max [m]`);
    }
    if (![undefined, "height"].includes(of)) fail(`${name}.of = '${of}': choose height, or leave it out`);
  }
  for (const name of ["spacing", "thickness", "growth"]) {
    const { min = 1, max } = document[name] ?? {};
    if (min > max) fail(`${name}.min = ${repr(min)} is more than max = ${repr(max)}: give min <= max`);
  }
  for (const [key, list] of Object.entries(document.stock ?? {})) {
    if (key !== "hand" && !(Array.isArray(list) && list.length && list.every((x) => x > 0 && x < 1e9))) fail(`stock.${key} = ${list}: give a list of positive numbers`);
  }
  if ((document.spacing.of !== document.thickness?.of && document.thickness) || (document.growth && !document.spacing.of)) {
    fail('spacing and thickness: give both in heights (of = "height"), as [growth] needs them, or both in metres');
  }
  if (document.spacing.of && (document.row.length || document.stock)) fail('row.length and [stock] are in metres: leave out of = "height"');
  for (const [name, objective] of [["tempo", "tempo"], ["growth", "magnify"]]) {
    const given = document[name] !== undefined, chosen = document.objective === objective;
    if (given !== chosen && (name === "tempo" || chosen)) {
      fail(`the table [${name}] ${given ? "is given" : "is missing"} and objective = '${document.objective ?? "mean_speed"}': ` +
        `give both [${name}] and objective = '${objective}', or neither`);
    }
  }
  if (document.physics?.floor_friction !== undefined && (document.objective ?? "mean_speed") !== "mean_speed") {
    fail(`physics.floor_friction and objective = '${document.objective}': free-standing layouts are scored by their speed; ` +
      "choose objective = 'mean_speed', or leave the floor out");
  }
  if (document.placement?.quantile !== undefined && !document.placement.draws) {
    fail("placement.quantile is given without draws: give draws of at least 1, or leave quantile out");
  }
  if (document.thickness?.fixed === undefined && document.row.first_thickness === undefined) {
    fail("row.first_thickness is missing: give the thickness of domino 0 [m], as that of the others is not fixed");
  }
}

// --- Scenes ---------------------------------------------------------------------------------------

export class Scene {
  /** document: tables and keys of a scene file. */
  constructor(kernels, document) {
    const isReleased = document.physics?.push === "released";
    checkDocument(isReleased ? { ...document, physics: { ...document.physics, push: 1 } } : document);
    const { row, spacing, thickness, physics = {}, growth, run_out: runOut, objective = "mean_speed" } = document;
    const unit = spacing.of ? row.height ?? STANDARD.height : 1;
    const bounds = ({ fixed, min, max }) => [(fixed ?? min) * unit, (fixed ?? max) * unit];
    Object.assign(this, { kernels, document, objective, runOut, inHeights: Boolean(spacing.of) });
    this.name = document.name ?? "own";
    this.title = document.title ?? this.name;
    this.count = row.count;
    for (const key of ["height", "width", "density"]) this[key] = row[key] ?? STANDARD[key];
    this.length = row.length ?? null;
    this.spacing = bounds(spacing); // [m]; with growth for a domino as high as the first
    this.sizeUnit = this.inHeights ? "heights" : "m";
    this.growth = growth ? [growth.min ?? 1, growth.max] : null;
    const { friction = 0.25, gravity = 9.81, push = 8 } = physics;
    this.physics = { friction, gravity, push };
    this.floorFriction = physics.floor_friction ?? null;
    this.stallMargin = document.limits?.stall_margin ?? null;
    this.placement = document.placement ?? null;
    this.firstThickness = row.first_thickness ?? thickness.fixed * unit;
    this.ground = document.ground ? new Ground(kernels, document.ground) : null;
    const d = this.firstThickness, footing = this.ground?.riseAndTilt({ spacing: [d], thickness: [d, d] });
    const released = releasedPush({ ...footing, height: [this.height], thickness: [d] }, gravity);
    this.isReleased = isReleased || Math.abs(push / released - 1) < SAME_PUSH; // files may have the number
    if (this.isReleased) this.physics.push = released;
    this.tempo = document.tempo ? { tolerance: 1e-3, ...document.tempo, schedule: this.#schedule(document.tempo) } : null;
    this.stock = document.stock ?? null;
    const pieces = this.stock ? this.#pieces() : [];
    this.thickness = this.stock ? [Math.min(...pieces), Math.max(...pieces)] : bounds(thickness);
    this.#checkReach();
    if (this.length !== null) this.#checkLength(pieces);
  }

  #checkReach() {
    if (!this.growth && this.spacing[0] >= this.height) {
      throw new RangeError(`spacing of at least ${general(this.spacing[0])} m is out of reach of a domino ${general(this.height)} m high: give less; lengths are in metres`);
    }
    if (this.runOut?.spacing >= this.height) {
      throw new RangeError(`run_out.spacing = ${general(this.runOut.spacing)} m is out of reach of a domino ${general(this.height)} m high: ` +
        "give less; lengths are in metres, 3 mm is 0.003");
    }
  }

  /** Tables for another scene, in which a released start stays one with other sizes. */
  get tables() {
    const { document } = this;
    return this.isReleased ? { ...document, physics: { ...document.physics, push: "released" } } : document;
  }

  get freeSpacing() { return this.spacing[0] < this.spacing[1]; }
  get freeThickness() { return this.thickness[0] < this.thickness[1]; }
  get freeHeight() { return this.growth !== null && this.growth[0] < this.growth[1]; }
  get isMeanSpeed() { return this.objective === "mean_speed"; }

  /** Sentence with the command that searches a scene which this page does not search, or "". */
  get whyNotSearched() {
    const command = this.name === "own" ? "save the scene, and `domino optimize scene.toml` searches it" : `\`domino optimize ${this.name}\` searches it`;
    if (this.placement?.draws) return `The score is taken over random placement errors, and this page shows the row without them: ${command}.`;
    if (this.floorFriction !== null) return `Free-standing rows take too long here: ${command}.`;
    if (this.stock) return `The order of the pieces of a stock is not searched here: ${command}.`;
    if (this.growth) return `Growing heights are not searched here: ${command}.`;
    return this.freeSpacing || this.freeThickness ? "" : "Gaps and thicknesses are fixed: give spacing or thickness a min and a max.";
  }

  /** Return another scene: tables are merged, null leaves a key or a table out. */
  replaced(changes) {
    const merged = { ...this.tables };
    for (const [key, value] of Object.entries(changes)) {
      merged[key] = value && typeof value === "object" ? { ...merged[key], ...value } : value;
    }
    return new Scene(this.kernels, JSON.parse(JSON.stringify(merged, (_, value) => value ?? undefined)));
  }

  /** Return the scheduled arrival times of dominoes 1 … N-1 [s]. */
  #schedule({ from, to, times }) {
    const pairs = this.count - 1, rates = [from, to].filter((rate) => rate !== undefined).length;
    if (times ? rates > 0 : rates < 2) throw new RangeError("tempo: give either from and to [hits/s], or times [s]");
    if (times && times.length !== pairs) {
      throw new RangeError(`tempo.times has ${times.length} entries: ${this.count} dominoes need one for each but the first, ${pairs}`);
    }
    let time = 0;
    return Float64Array.from(times ?? { length: pairs }, (given, i) => {
      if (times && !(given > time)) throw new RangeError(`tempo.times[${i}] = ${given} s: give more than ${time} s`);
      time = times ? given : time + 1 / (from + ((to - from) * i) / Math.max(pairs - 1, 1));
      return time;
    });
  }

  /** Return the thicknesses of the pieces of the stock without the first domino, in order of kinds. */
  #pieces() {
    const { thickness, count } = this.stock, total = count.reduce((sum, k) => sum + k, 0);
    if (thickness.length !== count.length) throw new RangeError("stock: give one count for each thickness");
    if (total < this.count) throw new RangeError(`stock.count adds up to ${total} dominoes: row.count = ${this.count} needs at least as many`);
    const first = thickness.findIndex((d, k) => Math.abs(d - this.firstThickness) <= SAME_THICKNESS && count[k] > 0);
    if (first < 0) throw new RangeError(`row.first_thickness = ${this.firstThickness}: no such domino is in the stock`);
    return thickness.flatMap((d, k) => Array(count[k] - (k === first ? 1 : 0)).fill(d));
  }

  #checkLength(pieces) {
    const pairs = this.count - 1, mean = pieces.reduce((sum, d) => sum + d, 0) / pieces.length;
    const [low, high] = [0, 1].map((k) => pairs * (this.spacing[k] + (this.stock ? mean : this.thickness[k])));
    if (!(low - 1e-12 <= this.length && this.length <= high + 1e-12)) {
      const fewest = Math.ceil((this.length * pairs) / high - 1e-9) + 1;
      const most = Math.min(Math.floor((this.length * pairs) / low + 1e-9) + 1, MAX_DOMINOES);
      const fits = !this.stock && fewest >= 2 && fewest <= most, counts = fewest < most ? `${fewest} to ${most}` : most;
      throw new RangeError(`row.length = ${general(this.length)} m cannot be met: ${this.count} dominoes within the bounds ` +
        `cover ${general(low)} to ${general(high)} m; ${fits ? `row.count = ${counts} would fit` : "change the length or the bounds"}`);
    }
  }

  /** Return a layout from gaps, and thicknesses and heights of dominoes 1 … N-1: numbers or arrays [m]. */
  layout(spacing, thickness, height) {
    const pairs = this.count - 1;
    if (thickness === undefined && this.freeThickness) {
      throw new RangeError(`thickness is missing: give it, scene '${this.name}' leaves it free`);
    }
    if (height === undefined && this.growth) {
      throw new RangeError(`height is missing: give it, as heights grow in scene '${this.name}'`);
    }
    const heights = Float64Array.of(this.height, ...full("height", height ?? this.height, pairs));
    const ratio = this.thickness[0] / this.height;
    const others = thickness ?? (this.inHeights ? heights.subarray(1).map((h) => ratio * h) : this.thickness[0]);
    const thicknesses = Float64Array.of(this.firstThickness, ...full("thickness", others, pairs));
    return this.#placed({
      spacing: full("spacing", spacing, pairs), thickness: thicknesses, height: heights, width: this.width, density: this.density,
    });
  }

  #placed(layout) { return this.ground ? { ...layout, ...this.ground.riseAndTilt(layout) } : layout; }

  /** Return the whole row of a layout, with the dominoes of the run-out. */
  row(layout) {
    if (!this.runOut || layout.thickness.length !== this.count) return layout;
    const { count, spacing } = this.runOut, extended = (values, value) => Float64Array.of(...values, ...Array(count).fill(value));
    const { thickness, height, density, width } = layout;
    return this.#placed({
      spacing: extended(layout.spacing, spacing), thickness: extended(thickness, thickness[0]),
      height: extended(height, height.at(-1)), width, density: density.length ? extended(density, density.at(-1)) : density,
    });
  }

  /** Return the sentences about rules of the scene that a layout violates. */
  violations(layout) {
    const { spacing, thickness, height, density } = layout, n = thickness.length;
    if (n !== this.count) return [`the layout has ${n} dominoes, and the scene ${this.count}`];
    const found = this.#groundViolations(layout);
    const check = (name, values, [low, high], first, unit, slack = 1e-12) => {
      const text = low < high ? `${repr(low)} to ${repr(high)} ${unit}` : `${repr(low)} ${unit}`;
      found.push(...outside(name, values, (x) => x >= low - slack * high && x <= high + slack * high, text, first, unit));
    };
    check("thickness", [thickness[0]], [this.firstThickness, this.firstThickness], 0, "m", 1e-9);
    check("height", this.growth ? [height[0]] : height, [this.height, this.height], 0, "m", 1e-9);
    check("density", typeof density === "number" ? [density] : density, [this.density, this.density], 0, "kg/m³", 1e-9);
    if (this.growth) check("growth", height.slice(1).map((h, i) => h / height[i]), this.growth, 1, "");
    const scaled = ([low, high]) => (this.inHeights ? [low / this.height, high / this.height] : [low, high]);
    const shorter = (i) => (this.inHeights ? Math.min(height[i], height[i + 1]) : 1);
    check("spacing", spacing.map((s, i) => s / shorter(i)), scaled(this.spacing), 0, this.sizeUnit);
    if (this.stock) found.push(...this.#stockViolations(thickness));
    else {
      const ratios = thickness.slice(1).map((d, i) => (this.inHeights ? d / height[i + 1] : d));
      check("thickness", ratios, scaled(this.thickness), 1, this.sizeUnit);
    }
    const total = positions(layout)[n - 1], error = total - (this.length ?? total);
    if (Math.abs(error) > LENGTH_TOLERANCE) {
      found.push(`the layout is ${total.toFixed(9)} m long: the scene has ${repr(this.length)} m (${error < 0 ? "" : "+"}${general(error, 3)} m)`);
    }
    return found;
  }

  #groundViolations(layout) {
    if (!this.ground) {
      const flat = !layout.rise || (layout.rise.every((x) => x === 0) && layout.tilt.every((x) => x === 0));
      return flat ? [] : ["the layout is on uneven ground, the scene on flat: give rise and tilt of 0"];
    }
    const expected = this.ground.riseAndTilt(layout), found = [];
    for (const [name, unit] of [["rise", "m"], ["tilt", "rad"]]) {
      const values = layout[name] ?? expected[name].map(() => 0), fits = (x, i) => Math.abs(x - expected[name][i]) <= GROUND_TOLERANCE;
      const i = values.findIndex((x, k) => !fits(x, k));
      const text = `${general(expected[name][i] ?? 0, 9)} ${unit} on its ground; make the layout with \`scene.layout\``;
      found.push(...outside(name, values, fits, text, 0, unit));
    }
    return found;
  }

  #stockViolations(thickness) {
    const { thickness: kinds, count } = this.stock;
    const described = kinds.map((d, k) => `${count[k]} of ${general(d)} m`).join(", ");
    const kindOf = (d) => kinds.findIndex((kind) => Math.abs(kind - d) <= SAME_THICKNESS);
    const unknown = thickness.findIndex((d) => kindOf(d) < 0);
    if (unknown >= 0) return [`thickness[${unknown}] = ${repr(thickness[unknown])} m: the stock has ${described}`];
    const used = kinds.map((_, k) => thickness.filter((d) => kindOf(d) === k).length);
    return used.flatMap((number, k) => (number > count[k] ? [`${number} dominoes are ${repr(kinds[k])} m thick: the stock has ${count[k]}`] : []));
  }

  // --- Scores -------------------------------------------------------------------------------------

  /**
   * Return {score, wave, violations, text} of a layout; on a floor `standing` too, after seconds.
   *
   * A layout that cannot stand has a violation, the score -1 and no wave.
   */
  score(layout) {
    const violations = this.violations(layout);
    try {
      const wave = this.kernels.simulate(this.row(layout), this.physics, { rtol: SCORE_RTOL });
      const standing = this.floorFriction === null ? null : this.kernels.standing(this.row(layout), this.physics, this.floorFriction);
      const score = standing ? standingScore(standing) : this.scoreOf(wave);
      return { score, wave, standing, violations, text: this.text(score, wave) };
    } catch (error) {
      if (!(error instanceof RangeError)) throw error;
      return { score: -1, wave: null, violations: [error.message], text: "cannot stand" };
    }
  }

  /** Return the score of a wave on fixed pivots. */
  scoreOf(wave) {
    const score = wave.propagated ? this.#success(wave) : wave.reach - 1;
    if (this.stallMargin === null) return score;
    const excess = Math.max(this.stallMargin - wave.lowestStallMargin, 0);
    if (score > 0 && excess > (wave.rtol <= 1e-9 ? 1e-6 : 0)) return (-0.5 * excess) / (1 + excess);
    return score < 0 ? 0.5 * score - 0.5 : score;
  }

  #success(wave) {
    if (this.isMeanSpeed) return wave.meanSpeed;
    if (this.objective === "magnify") return wave.layout.height.at(-1);
    return 1 / (1 + this.rmsError(wave) / this.tempo.tolerance);
  }

  /** Return the root-mean-square error of arrival times [s]; for scenes with a schedule. */
  rmsError(wave) {
    const { schedule } = this.tempo, squares = schedule.map((t, i) => (wave.arrivalTimes[i + 1] - t) ** 2);
    return Math.sqrt(squares.reduce((sum, x) => sum + x, 0) / schedule.length);
  }

  /**
   * Return {score, wave, spacing, thickness, height} with derivatives of the score (N-1 each, of
   * dominoes 1 …); null in place of all three for a score of 0 or less.
   */
  gradient(layout, { rtol = SCORE_RTOL } = {}) {
    const row = this.row(layout), pairs = this.count - 1;
    const byTimes = (wave) => {
      if (!(this.scoreOf(wave) > 0)) return null;
      const bar = new Float64Array(wave.arrivalTimes.length), last = bar.length - 1;
      if (this.isMeanSpeed) bar[last] = -wave.meanSpeed / wave.totalTime;
      if (this.objective === "tempo") {
        const rms = Math.max(this.rmsError(wave), 1e-300), { schedule, tolerance } = this.tempo, score = 1 / (1 + rms / tolerance);
        schedule.forEach((t, i) => { bar[i + 1] = ((-(score ** 2) / tolerance) * (wave.arrivalTimes[i + 1] - t)) / (pairs * rms); });
      }
      return bar;
    };
    let gradient = this.kernels.gradient(row, this.physics, byTimes, { rtol });
    const { wave } = gradient, score = this.scoreOf(wave);
    if (!gradient.spacing) return { score, wave, spacing: null, thickness: null, height: null };
    if (this.isMeanSpeed) gradient = withLength(gradient, row, 1 / wave.totalTime);
    if (this.ground) gradient = { ...gradient, ...this.ground.along(gradient, row) };
    if (this.objective === "magnify") gradient.height[pairs] += 1;
    const [spacing, thickness, height] = [gradient.spacing.slice(0, pairs), gradient.thickness, gradient.height];
    return { score, wave, spacing, thickness: thickness.slice(1, pairs + 1), height: height.slice(1, pairs + 1) };
  }

  /** Return a score with its unit, or the reason for a score of 0 or less. */
  text(score, wave) {
    if (!(score > 0)) {
      if (this.stallMargin !== null && wave.propagated) return "violates a limit of the scene";
      return { mean_speed: "no speed", magnify: "no height", tempo: "no success" }[this.objective];
    }
    if (this.objective === "magnify") return `last domino ${score.toFixed(6)} m high`;
    if (this.objective === "tempo") return `RMS error ${this.#milliseconds(score)}`;
    if (this.floorFriction === null) return `${score.toFixed(6)} m/s`;
    return `${score.toFixed(4)} m/s on a floor of friction ${general(this.floorFriction)}`;
  }

  #milliseconds(score) {
    const error = 1e3 * this.tempo.tolerance * (1 / score - 1);
    return error <= 1e-6 ? "below 1 ns" : `${general(error)} ms`;
  }

  /** Return the gain of a score over the best equal gaps; null if one of them is no success. */
  gain(score) {
    const reference = this.uniform().score;
    if (Math.min(score, reference) <= 0) return null;
    if (this.objective !== "tempo") return score / reference - 1;
    return 0.1 * Math.log10(Math.max(score, 1e-4) / Math.max(reference, 1e-4));
  }

  // --- Best equal gaps ----------------------------------------------------------------------------

  /**
   * Return {point, layout, wave, score} of the best layout with equal gaps; takes up to seconds.
   *
   * point: result of an earlier search, in another worker say. On a floor the gaps are those that
   * are best on fixed pivots.
   */
  uniform(point) {
    if (point) this.baseline = undefined;
    this.baseline ??= (() => {
      const best = point ?? new UniformLayouts(this).best(), layout = new UniformLayouts(this).layout(best);
      return { point: best, layout, ...this.score(layout) };
    })();
    return this.baseline;
  }
}

/** Return a sentence about the first value that does not fit, with the number of others. */
function outside(name, values, fits, allowed, first, unit) {
  const places = Array.from(values.keys()).filter((i) => !fits(values[i], i));
  if (!places.length) return [];
  const more = places.length > 1 ? ` (and ${places.length - 1} more)` : "";
  const given = `${name}[${places[0] + first}] = ${general(values[places[0]], 13)} ${unit}`.trim();
  return [`${given}${more}: the scene allows ${allowed.trim()}`];
}

/** Return the score of free-standing dominoes. */
function standingScore({ propagated, meanSpeed, topples, lean, layout }) {
  const count = topples.length, k = topples.indexOf(false);
  if (propagated) return meanSpeed;
  if (k < 0) return -0.5 / count;
  const tipping = Math.atan2(layout.thickness[k], layout.height[k]);
  return (k + (0.99 * Math.max(lean[k], 0)) / tipping) / count - 1;
}

/** Return a gradient plus `weight` times the gradient of the length. */
function withLength(gradient, layout, weight) {
  const thickness = gradient.thickness.map((g, i) => (i > 0 && !gradient.rise ? g + weight : g));
  if (!gradient.rise) return { ...gradient, spacing: gradient.spacing.map((g) => g + weight), thickness };
  const [spacing, rise, tilt] = [gradient.spacing, gradient.rise, gradient.tilt].map((values) => values.slice());
  pitch(layout).forEach((distance, i) => {
    const ahead = layout.tilt[i + 1], tan = Math.tan(ahead), sec = 1 / Math.cos(ahead);
    const along = layout.spacing[i] + layout.thickness[i + 1], normal = along * tan + layout.rise[i] * sec;
    const forward = (weight * along) / distance, up = (weight * normal) / distance;
    spacing[i] += forward + up * tan;
    thickness[i + 1] += forward + up * tan;
    rise[i] += up * sec;
    tilt[i + 1] += up * (along * sec + layout.rise[i] * tan) * sec;
  });
  return { ...gradient, spacing, thickness, rise, tilt };
}

// --- Uniform layouts: as `domino_env.scenes.uniform` -----------------------------------------------

const LINE = 256, PLANE = 48, KEEP = [6, 2], AROUND = 9, SHRINK = 4, FINEST_CELL = 1e-7, GRID_RTOL = 1e-8;

/** Layouts with equal gaps, each given by a point: gap and thickness, or what replaces them. */
class UniformLayouts {
  constructor(scene) {
    this.scene = scene;
    const { spacing, thickness, growth, stock, length } = scene, pairs = scene.count - 1;
    let first = spacing, second = growth ?? thickness;
    this.pieces = null;
    if (stock) {
      this.pieces = stock.thickness.flatMap((d, k) => Array(stock.count[k]).fill(d));
      this.pieces.splice(this.pieces.findIndex((d) => Math.abs(d - scene.firstThickness) <= SAME_THICKNESS), 1);
      this.pieces.length = pairs;
      second = [0, 0];
      const pitches = [spacing[0] + Math.max(...this.pieces), spacing[1] + Math.min(...this.pieces)];
      const mean = length === null ? pitches[0] : length / pairs;
      this.onePitch = !stock.hand && pitches[0] <= mean && mean <= pitches[1];
      if (this.onePitch) first = pitches;
    }
    this.low = [first[0], second[0]];
    this.high = [first[1], second[1]];
    if (length !== null) this.#meetLength(length / pairs);
  }

  #meetLength(mean) {
    const { spacing } = this.scene;
    if (this.pieces) {
      const exact = this.onePitch ? mean : mean - this.pieces.reduce((sum, d) => sum + d, 0) / this.pieces.length;
      this.low[0] = this.high[0] = Math.min(Math.max(exact, this.low[0]), this.high[0]);
      return;
    }
    this.low[1] = Math.max(this.low[1], mean - spacing[1]);
    this.high[1] = Math.min(this.high[1], mean - spacing[0]);
    this.low[0] = this.high[0] = mean - this.low[1];
  }

  layout([first, second]) {
    const { scene } = this, pairs = scene.count - 1;
    if (scene.growth) { // first: gap of a domino as high as the first
      const heights = Array.from({ length: pairs }, (_, i) => scene.height * second ** (i + 1));
      return scene.layout([scene.height, ...heights].slice(0, -1).map((h) => (first / scene.height) * h), undefined, heights);
    }
    if (this.pieces) {
      const gap = (d) => Math.min(Math.max(first - d, scene.spacing[0]), scene.spacing[1]);
      return scene.layout(this.onePitch ? this.pieces.map(gap) : first, this.pieces);
    }
    return scene.layout(scene.length === null ? first : scene.length / pairs - second, second);
  }

  score(point) {
    const { scene } = this;
    try {
      return scene.scoreOf(scene.kernels.simulate(scene.row(this.layout(point)), scene.physics, { rtol: GRID_RTOL, exactMargins: scene.stallMargin !== null }));
    } catch (error) {
      if (error instanceof RangeError) return -1; // cannot stand
      throw error;
    }
  }

  /** Return the point with the highest score, by finer and finer grids around the best points. */
  best() {
    const { low, high } = this, number = low.every((x, k) => x < high[k]) ? PLANE : LINE;
    const axes = low.map((x, k) => (x < high[k] ? spread(x, high[k], number) : [x]));
    const scored = (points) => points.map((point) => ({ point, score: this.score(point) }));
    const first = scored(axes[0].flatMap((x) => axes[1].map((y) => [x, y])));
    let cell = axes.map((axis) => (axis.length > 1 ? axis[1] - axis[0] : 0)), entries = first, keep = KEEP[0];
    while (Math.max(...cell) > FINEST_CELL) {
      const offsets = cell.map((c) => (c > 0 ? spread(-c, c, AROUND) : [0])), known = new Map();
      for (const { point } of separate(entries, cell.map((c) => 2 * c), keep)) {
        for (const x of offsets[0]) {
          for (const y of offsets[1]) {
            const near = [point[0] + x, point[1] + y].map((value, k) => Math.min(Math.max(value, low[k]), high[k]));
            known.set(near.join(), near);
          }
        }
      }
      entries = scored([...known.values()]);
      [cell, keep] = [cell.map((c) => c / SHRINK), KEEP[1]];
    }
    const best = entries.reduce((a, b) => (b.score > a.score ? b : a));
    const equal = first.filter(({ score }) => score >= best.score); // the middle one of equal scores
    return equal.length ? equal[equal.length >> 1].point : best.point;
  }
}

function spread(low, high, number) {
  return Array.from({ length: number }, (_, i) => low + ((high - low) * i) / (number - 1));
}

/** Return the best entries, at most `keep`, without those within a distance of a better one. */
function separate(entries, distance, keep) {
  const chosen = [];
  for (const entry of [...entries].sort((a, b) => b.score - a.score)) {
    const near = chosen.some(({ point }) => point.every((x, k) => Math.abs(x - entry.point[k]) <= distance[k]));
    if (!near) chosen.push(entry);
    if (chosen.length === keep) break;
  }
  return chosen;
}
