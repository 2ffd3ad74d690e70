/**
 * Search of better layouts: local searches on exact gradients from many starts, and changes of good
 * layouts, as the method `auto` of `optimize` (`optimize/methods/search/race.py`).
 *
 * A design is a Float64Array of values from 0 to 1, relative to the bounds of the scene: one for each
 * gap, if gaps are free, then one for the thickness of each domino but the first, if they are free.
 * Generators yield after each simulation, so that the caller can stop them or answer messages.
 */

const RTOL = 1e-6, TEMPO_RTOL = 1e-9; // of arrival times, in the search
const FIRST_GRADIENTS = 12; // gradients of every start in the first round
const CHILDREN = 32, REFINED = 8; // changed layouts of a generation that are scored, and refined
const CHILD_GRADIENTS = 10, NEAR_GRADIENTS = 60, BEST_GRADIENTS = 240;
const MARGIN = 3e-4; // relative distance to the best score that counts as near
const ELITE = 8; // layouts from which children are made
const ALIKE = 1e-3; // distance below which two designs count as the same
const IDLE = [6, 3e-6], LARGE_IDLE = [4, 2e-5]; // generations, each with at most this relative gain
const MANY_PLACES = 64; // places above which starts and patience are smaller
const AGREEMENT = 5e-5, ENOUGH = 3, MOST_ISLANDS = 8; // independent searches that end the search
const LONG = 512, SHORT = 160; // dominoes of a row that is stretched from a shorter one
const MAX_TIGHT = 8, FACE = 1e-3; // tight gaps at the end; distance to a bound that counts as on it
const ON_TIME = 1e-9; // [s] RMS error below which a search of a schedule is done
const SLICE = 30, REPORT = 100; // [ms] between answers to messages, and between reports of better layouts

// --- Problem --------------------------------------------------------------------------------------

/** Designs of a scene, their layouts, scores and gradients, and the best so far. */
class Problem {
  constructor(scene, onBetter = () => {}) {
    this.scene = scene;
    this.pairs = scene.count - 1;
    this.rtol = scene.tempo ? TEMPO_RTOL : RTOL;
    this.bounds = [...(scene.freeSpacing ? [scene.spacing] : []), ...(scene.freeThickness ? [scene.thickness] : [])];
    this.size = this.pairs * this.bounds.length;
    this.widths = Float64Array.from(this.bounds.flatMap(([low, high]) => Array(this.pairs).fill(high - low)));
    const fixed = (scene.freeSpacing ? 0 : scene.spacing[0]) + (scene.freeThickness ? 0 : scene.thickness[0]);
    const lowest = this.bounds.reduce((sum, [low]) => sum + low, fixed);
    this.room = scene.length === null ? null : scene.length - this.pairs * lowest; // sum of design times widths [m]
    this.best = { score: -Infinity, design: null };
    this.onBetter = onBetter;
  }

  /** Return gaps and thicknesses of a design [m]. */
  sizes(design) {
    const parts = this.bounds.map(([low, high], k) =>
      design.slice(k * this.pairs, (k + 1) * this.pairs).map((x) => low + (high - low) * x));
    return this.scene.freeSpacing ? parts : [this.scene.spacing[0], ...parts];
  }

  layout(design) { return this.scene.layout(...this.sizes(design)); }

  /** Return the design of a layout. */
  design({ spacing, thickness }) {
    const values = [...(this.scene.freeSpacing ? [spacing] : []), ...(this.scene.freeThickness ? [thickness.slice(1)] : [])];
    return this.project(Float64Array.from(values.flatMap((part, k) => {
      const [low, high] = this.bounds[k];
      return Array.from(part, (x) => (x - low) / (high - low));
    })));
  }

  /** Return the nearest design within the bounds, and of the given length. */
  project(design) {
    const { widths, room } = this, clip = (x) => Math.min(Math.max(x, 0), 1);
    if (room === null) return design.map(clip);
    // Newton's method within a bracket for the shift of all sizes after which the length is right
    const least = Math.min(...this.bounds.map(([from, to]) => to - from));
    let low = -Math.max(...design) / least, high = (1 - Math.min(...design)) / least, shift = 0;
    for (let k = 0; k < 100; k++) {
      let excess = -room, slope = 0;
      for (let i = 0; i < design.length; i++) {
        const x = design[i] + shift * widths[i];
        excess += widths[i] * clip(x);
        if (x > 0 && x < 1) slope += widths[i] ** 2;
      }
      if (Math.abs(excess) <= 1e-16 * design.length) break;
      if (excess > 0) high = shift; else low = shift;
      const next = shift - excess / slope;
      shift = next > low && next < high ? next : 0.5 * (low + high);
    }
    return design.map((x, i) => clip(x + shift * widths[i]));
  }

  /** Return the score of a design, with its gradient if wanted (zeros for a score of 0 or less). */
  evaluate(design, wantsGradient = false) {
    const { scene, pairs } = this;
    let score = -1, gradient = wantsGradient ? new Float64Array(this.size) : null;
    try {
      const layout = this.layout(design);
      if (wantsGradient) {
        const result = scene.gradient(layout, { rtol: this.rtol });
        const parts = [...(scene.freeSpacing ? [result.spacing] : []), ...(scene.freeThickness ? [result.thickness] : [])];
        score = result.score;
        if (result.spacing) parts.forEach((part, k) => gradient.set(part.map((g) => g * (this.bounds[k][1] - this.bounds[k][0])), k * pairs));
      } else {
        score = scene.scoreOf(scene.kernels.simulate(scene.row(layout), scene.physics, { rtol: this.rtol, exactMargins: scene.stallMargin !== null }));
      }
    } catch (error) {
      if (!(error instanceof RangeError)) throw error; // a layout that cannot stand
    }
    if (score > this.best.score) {
      this.best = { score, design };
      this.onBetter();
    }
    return { score, gradient };
  }
}

const dot = (a, b) => { let sum = 0; for (let i = 0; i < a.length; i++) sum += a[i] * b[i]; return sum; };
const norm = (a) => Math.sqrt(dot(a, a));

// --- Local search: as `optimize/methods/gradient/local_search.py` ----------------------------------

const MAX_DENSE = 200, MEMORY = 30, MAX_TRIES = 14, MAX_CHANGE = 0.15, GAIN_STEPS = 8, LEAST_GAIN = 1e-7;

/** BFGS within the box, with Armijo and weak Wolfe conditions for kinks; advanced by its caller. */
class LocalSearch {
  constructor(problem, start) {
    Object.assign(this, { problem, design: problem.project(start), score: -Infinity, evaluations: 0, done: false });
    this.steps = this.#ascend();
  }

  /** Evaluate some designs, and yield after each. */
  *advance(most) {
    for (let k = 0; k < most && !this.done; k++) {
      this.done = this.steps.next().done;
      yield;
    }
  }

  *#ascend() {
    const { problem } = this, curvature = new Curvature(this.design.length);
    let { score, gradient } = problem.evaluate(this.design, true);
    this.score = score;
    yield;
    const history = [score];
    for (;;) {
      const inward = (step) => step.map((x, i) => ((this.design[i] <= 0 && x < 0) || (this.design[i] >= 1 && x > 0) ? 0 : x));
      const slope = inward(gradient), largest = slope.reduce((most, x) => Math.max(most, Math.abs(x)), 0);
      if (!(largest > 0)) return;
      let direction = null;
      if (!curvature.isInitial) {
        direction = curvature.multiply(slope);
        direction = inward(direction.map((x, i) => (slope[i] === 0 ? 0 : x)));
        if (!(dot(direction, slope) > 1e-10 * norm(direction) * norm(slope))) {
          curvature.reset();
          direction = null;
        }
      }
      direction ??= slope.map((x) => (x * MAX_CHANGE) / (3 * largest));
      const point = yield* this.#lineSearch(direction, gradient);
      if (!point) {
        if (curvature.isInitial) return;
        curvature.reset();
        continue;
      }
      const step = point.design.map((x, i) => x - this.design[i]);
      const change = gradient.map((x, i) => (step[i] === 0 ? 0 : x - point.gradient[i])), product = dot(step, change);
      if (product > 1e-12 * norm(step) * norm(change)) curvature.update(step, change, product);
      ({ design: this.design, score: this.score, gradient } = point);
      history.push(this.score);
      if (history.length > GAIN_STEPS && this.score - history.at(-1 - GAIN_STEPS) <= LEAST_GAIN * Math.abs(this.score)) return;
    }
  }

  *#lineSearch(direction, gradient) {
    const largest = direction.reduce((most, x) => Math.max(most, Math.abs(x)), 0);
    let length = Math.min(1, MAX_CHANGE / largest), low = 0, high = Infinity, best = null;
    for (let k = 0; k < MAX_TRIES; k++) {
      const design = this.problem.project(this.design.map((x, i) => x + length * direction[i]));
      const change = design.map((x, i) => x - this.design[i]);
      if (change.every((x) => x === 0)) break;
      const result = this.problem.evaluate(design, true);
      yield;
      if (!(result.score > this.score + 1e-4 * Math.max(dot(gradient, change), 0))) high = length;
      else {
        best = { design, ...result };
        const inside = direction.map((x, i) => (design[i] > 0 && design[i] < 1 ? x : 0));
        if (dot(result.gradient, inside) <= 0.5 * dot(gradient, inside) || length * largest >= MAX_CHANGE) return best;
        low = length;
      }
      length = high < Infinity ? 0.5 * (low + high) : 2 * length;
      if (best && high - low < 0.1 * high) break;
    }
    return best;
  }
}

/** Inverse curvature of the score: a matrix (BFGS), or the last steps (L-BFGS) of many variables. */
class Curvature {
  constructor(n) { Object.assign(this, { n, dense: n <= MAX_DENSE }); this.reset(); }

  reset() { Object.assign(this, { pairs: [], matrix: null }); }
  get isInitial() { return this.dense ? this.matrix === null : this.pairs.length === 0; }

  multiply(gradient) {
    const { n, matrix, pairs } = this;
    if (this.dense) return gradient.map((_, i) => dot(matrix[i], gradient));
    const step = gradient.slice(), first = [], add = (factor, other) => { for (let i = 0; i < n; i++) step[i] += factor * other[i]; };
    for (const [s, y, product] of [...pairs].reverse()) {
      first.unshift(dot(s, step) / product);
      add(-first[0], y);
    }
    const [, y, product] = pairs.at(-1), scale = product / dot(y, y);
    for (let i = 0; i < n; i++) step[i] *= scale;
    pairs.forEach(([s, change, along], k) => add(first[k] - dot(change, step) / along, s));
    return step;
  }

  update(s, y, product) {
    if (!this.dense) {
      this.pairs = [...this.pairs, [s, y, product]].slice(-MEMORY);
      return;
    }
    const { n } = this, scale = product / dot(y, y);
    this.matrix ??= Array.from({ length: n }, (_, i) => new Float64Array(n).fill(scale, i, i + 1));
    const hy = this.matrix.map((row) => dot(row, y)), factor = (1 + dot(y, hy) / product) / product;
    for (let i = 0; i < n; i++) {
      const row = this.matrix[i], a = factor * s[i] - hy[i] / product, b = s[i] / product;
      for (let j = 0; j < n; j++) row[j] += a * s[j] - b * hy[j];
    }
  }
}

// --- Changes of good layouts: as `optimize/methods/search/perturbations.py` ------------------------

/** Source of random numbers with a seed (mulberry32). */
export class Random {
  constructor(seed) { this.state = seed >>> 0; }

  next() {
    this.state = (this.state + 0x6d2b79f5) >>> 0;
    let t = this.state;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  }

  uniform(low, high) { return low + (high - low) * this.next(); }
  whole(low, high) { return Math.floor(this.uniform(low, high)); } // high is excluded
  normal() { return Math.sqrt(-2 * Math.log(1 - this.next())) * Math.cos(2 * Math.PI * this.next()); }
  pick(values) { return values[this.whole(0, values.length)]; }
}

/** Changes of a design of some parts with `pairs` places each; each has a donor, another good design. */
class Changes {
  constructor(problem, random) {
    Object.assign(this, { pairs: problem.pairs, parts: problem.bounds.length, random });
    this.kinds = ["tight", "shift", "smooth", "all", "stretch", "bend", "join", "copy", "repeat", "end", "swap"];
    this.weights = this.kinds.map(() => 1);
  }

  /** Return a changed design and the index of the change, which is drawn by the weights. */
  child(parent, donor) {
    let place = this.random.next() * this.weights.reduce((sum, w) => sum + w, 0), kind = 0;
    while (kind < this.weights.length - 1 && place >= this.weights[kind]) place -= this.weights[kind++];
    let design = this[this.kinds[kind]](parent, donor);
    if (this.random.next() < 0.25) design = this[this.random.pick(this.kinds)](design, donor);
    return { design, kind };
  }

  reward(kind, gained) { this.weights[kind] = Math.min(Math.max(this.weights[kind] * (gained ? 1.5 : 0.97), 0.2), 5); }

  /** Return a design whose place i of each part is place source(i) of another. */
  #rearranged(design, source) {
    const last = this.pairs - 1, part = (i) => Math.floor(i / this.pairs) * this.pairs;
    return design.map((_, i) => design[part(i) + Math.min(Math.max(source(i - part(i)), 0), last)]);
  }

  #stretch() {
    const { pairs, random } = this, length = random.whole(1, Math.max(2, Math.min(pairs, 2 + Math.floor(pairs / 3))));
    const start = random.whole(0, Math.max(1, pairs - length + 1));
    return (i) => i % pairs >= start && i % pairs < start + length;
  }

  #inside(design, step) { return design.map((x, i) => (x > FACE && x < 1 - FACE ? x + step(i) : x)); }

  /** Return the number of gaps at the end that are at their lower bound. */
  tightGaps(design) {
    let count = 0;
    while (count < this.pairs && design[this.pairs - 1 - count] <= FACE) count += 1;
    return count;
  }

  #shifted(design, places) {
    const from = Math.floor(this.pairs / 2) - Math.max(places, 0);
    return this.#rearranged(design, (i) => (i >= from ? i + places : i));
  }

  /** Return a design with exactly `count` tight gaps at its end. */
  withTightGaps(design, count) {
    const { pairs } = this, tight = this.tightGaps(design);
    const result = tight ? this.#shifted(design, count - tight) : design.slice();
    result.fill(0, pairs - count, pairs);
    if (count < pairs && result[pairs - count - 1] <= FACE) {
      result[pairs - count - 1] = tight < pairs ? design[pairs - 1 - tight] : 0.5;
    }
    return result;
  }

  tight(design) {
    const tight = this.tightGaps(design), change = tight === 0 || this.random.next() < 0.5 ? 1 : -1;
    return this.withTightGaps(design, Math.min(tight + change, this.pairs - 1, MAX_TIGHT));
  }

  shift(design) {
    const free = this.pairs - this.tightGaps(design), moved = this.#shifted(design, this.random.pick([-2, -1, 1, 2]));
    return moved.map((x, i) => (i % this.pairs < free ? x : design[i]));
  }

  smooth(design) {
    const free = this.pairs - this.tightGaps(design), within = this.random.next() < 0.7 ? this.#stretch() : () => true;
    let result = design;
    for (let pass = this.random.whole(1, 6); pass > 0; pass--) {
      const known = result;
      result = known.map((x, i) => {
        const place = i % this.pairs;
        return within(i) && place > 0 && place < free - 1 ? 0.25 * known[i - 1] + 0.5 * x + 0.25 * known[i + 1] : x;
      });
    }
    return result;
  }

  all(design) {
    const size = 10 ** this.random.uniform(-2.5, -0.8);
    return this.#inside(design, () => size * this.random.normal());
  }

  stretch(design) {
    const size = 10 ** this.random.uniform(-2, -0.5), within = this.#stretch();
    return design.map((x, i) => (within(i) ? x + size * this.random.normal() : x));
  }

  bend(design) {
    const { pairs, random } = this, width = random.uniform(1, Math.max(0.25 * pairs, 2)), middle = random.uniform(0, pairs);
    const sizes = Array.from({ length: this.parts }, () => random.pick([-1, 1]) * 10 ** random.uniform(-2, -0.7));
    return this.#inside(design, (i) => sizes[Math.floor(i / pairs)] * Math.exp(-0.5 * ((i % pairs - middle) / width) ** 2));
  }

  join(design, donor) {
    const cut = this.random.whole(1, Math.max(this.pairs, 2)), [first, last] = this.random.next() < 0.5 ? [design, donor] : [donor, design];
    return design.map((_, i) => (i % this.pairs < cut ? first[i] : last[i]));
  }

  copy(design, donor) {
    const within = this.#stretch();
    return design.map((x, i) => (within(i) ? donor[i] : x));
  }

  repeat(design) {
    const [repeated, omitted] = [this.random.whole(0, this.pairs), this.random.whole(0, this.pairs)];
    return this.#rearranged(design, (i) => {
      if (omitted >= repeated) return i > repeated && i <= omitted ? i - 1 : i;
      return i >= omitted && i < repeated ? i + 1 : i;
    });
  }

  end(design) {
    const result = design.slice(), place = this.random.whole(1, Math.min(6, this.pairs) + 1);
    result[(this.random.whole(0, this.parts) + 1) * this.pairs - place] = this.random.pick([0, 1, this.random.next()]);
    return result;
  }

  swap(design) {
    const i = this.random.whole(0, this.pairs), j = Math.min(Math.max(i + this.random.whole(-4, 5), 0), this.pairs - 1);
    const only = this.random.next() < 0.5 ? null : this.random.whole(0, this.parts), result = design.slice();
    for (let part = 0; part < this.parts; part++) {
      const at = part * this.pairs;
      if (only === null || part === only) [result[at + i], result[at + j]] = [design[at + j], design[at + i]];
    }
    return result;
  }
}

// --- The race -------------------------------------------------------------------------------------

/** One search: the best layouts so far, and the changes that made them. */
class Race {
  constructor(problem, random) {
    Object.assign(this, { problem, random, changes: new Changes(problem, random), elite: [], migrants: [] });
    [this.patience, this.leastGain] = problem.pairs > MANY_PLACES ? LARGE_IDLE : IDLE;
  }

  get score() { return this.elite[0].score; }

  /** Keep a layout, unless one that counts as the same has at least its score. */
  add({ score, design }) {
    const alike = (other) => other.design.every((x, i) => Math.abs(x - design[i]) < ALIKE);
    if (this.elite.some((other) => other.score >= score && alike(other))) return;
    this.elite = [...this.elite.filter((other) => !alike(other)), { score, design }].sort((a, b) => b.score - a.score).slice(0, ELITE);
  }

  /** Score candidates {design, kind}, the best first. */
  *#scored(candidates) {
    const entries = [];
    for (const { design, kind } of candidates) {
      const projected = this.problem.project(design);
      entries.push({ design: projected, kind, score: this.problem.evaluate(projected).score });
      yield;
    }
    return entries.sort((a, b) => b.score - a.score);
  }

  /** Return local searches from entries whose waves complete. */
  #searches(entries) {
    return entries.filter(({ score }) => score > 0)
      .map(({ design, kind }) => Object.assign(new LocalSearch(this.problem, design), { kind }));
  }

  /** Run local searches from designs; after each round the worse half ends and the effort doubles. */
  *race(designs) {
    const entries = yield* this.#scored(designs.map((design) => ({ design })));
    entries.forEach((entry) => this.add(entry));
    let searches = this.#searches(entries);
    for (let gradients = FIRST_GRADIENTS; searches.length; gradients *= 2) {
      for (const local of searches) yield* local.advance(gradients);
      searches.forEach((local) => this.add(local));
      searches = searches.sort((a, b) => b.score - a.score).slice(0, (searches.length + 1) >> 1).filter((local) => !local.done);
    }
  }

  /** Score changed designs and refine some of them. */
  *#generation(children) {
    const known = this.score, entries = yield* this.#scored(children);
    entries.slice(0, REFINED / 2).forEach((entry) => this.add(entry));
    const rest = entries.slice(REFINED / 2), chosen = entries.slice(0, REFINED / 2);
    for (let k = 0; k < REFINED / 2 && rest.length; k++) chosen.push(...rest.splice(this.random.whole(0, rest.length), 1));
    const searches = this.#searches(chosen);
    for (const local of searches) yield* local.advance(CHILD_GRADIENTS);
    searches.sort((a, b) => b.score - a.score);
    const near = searches.filter(({ score }) => score > known - MARGIN * Math.abs(known)).slice(0, REFINED / 2);
    for (const local of near) yield* local.advance(NEAR_GRADIENTS);
    searches.sort((a, b) => b.score - a.score);
    const hasGained = searches.length > 0 && searches[0].score > known * (1 + 1e-6);
    searches.forEach(({ kind }, k) => { if (kind !== undefined) this.changes.reward(kind, hasGained && k === 0); });
    if (hasGained) yield* searches[0].advance(BEST_GRADIENTS);
    searches.forEach((local) => this.add(local));
  }

  #children() {
    const rank = () => { // 0 with probability 0.35, then 1, and so on
      let r = 0;
      while (r < this.elite.length - 1 && this.random.next() > 0.35) r += 1;
      return this.elite[r].design;
    };
    return Array.from({ length: CHILDREN }, () => {
      const donor = this.migrants.length && this.random.next() < 0.5 ? this.random.pick(this.migrants) : rank();
      return this.changes.child(rank(), donor);
    });
  }

  /** Run generations until several in a row, and layouts with other ends, gain too little. */
  *settle() {
    const tried = new Set();
    for (;;) {
      for (let idle = 0; idle < this.patience;) {
        const known = this.score;
        yield* this.#generation(this.#children());
        idle = this.score > known + this.leastGain * Math.abs(known) ? 0 : idle + 1;
      }
      const best = this.elite[0].design, tight = this.changes.tightGaps(best), known = this.score;
      if (!this.problem.scene.freeSpacing || tried.has(tight)) return;
      tried.add(tight);
      const counts = Array.from({ length: Math.min(MAX_TIGHT, this.problem.pairs) }, (_, k) => k).filter((k) => k !== tight);
      yield* this.race(counts.map((count) => this.changes.withTightGaps(best, count)));
      if (this.score <= known + this.leastGain * Math.abs(known)) return;
    }
  }

  /** Join the best layout and another, the start of one to the end of the other. */
  *join(migrant) {
    this.add(migrant);
    this.migrants.push(migrant.design);
    yield* this.#generation(Array.from({ length: CHILDREN }, () => ({ design: this.changes.join(this.elite[0].design, migrant.design) })));
    yield* this.settle();
  }

  /** Return starts: a design, unchanged and with one to a few tight gaps and thick dominoes at its end. */
  starts(design) {
    const { pairs, scene } = this.problem, most = Math.min(MAX_TIGHT - 2, pairs - 1), designs = [design];
    const counts = pairs > MANY_PLACES ? [2, 4] : Array.from({ length: most }, (_, k) => k + 1);
    if (scene.freeSpacing) designs.push(...counts.map((count) => this.changes.withTightGaps(design, count)));
    if (scene.freeThickness) designs.push(...designs.map((other) => other.slice().fill(1, other.length - Math.min(2, pairs))));
    return designs;
  }

  /** Return variants of a design with random bends, ends and thicknesses. */
  randomStarts(design) {
    const { pairs, scene, size } = this.problem, { random, changes } = this;
    return Array.from({ length: pairs > MANY_PLACES ? 2 : REFINED }, () => {
      let result = design.slice();
      if (scene.freeThickness && random.next() < 0.5) result.fill(random.next(), size - pairs);
      for (let k = random.whole(0, 5); k > 0; k--) result = changes.bend(result);
      if (scene.freeSpacing) result = changes.withTightGaps(result, random.whole(0, Math.min(MAX_TIGHT, pairs - 1) + 1));
      for (let k = random.whole(0, 3); k > 0; k--) result = changes.end(result);
      return result;
    });
  }
}

/** Search a problem; return a sentence about the reliability of the best layout. */
function* searchProblem(problem, random, given) {
  const uniform = problem.design(problem.scene.uniform().layout), main = new Race(problem, random), optima = [];
  const long = problem.scene.count >= LONG ? [yield* stretched(problem, random)] : [];
  yield* main.race([...given, ...long, ...(long.length ? [uniform] : main.starts(uniform))]);
  yield* main.settle();
  for (;;) {
    const best = Math.max(main.score, ...optima.map(({ score }) => score));
    const scale = problem.scene.tempo ? 1 - best : Math.abs(best);
    const agree = optima.filter(({ score }) => score >= best - AGREEMENT * scale).length;
    const report = `${agree} of ${optima.length} independent searches agree to 0.005 %`;
    if (agree >= ENOUGH || optima.length >= MOST_ISLANDS || problem.scene.count >= LONG) return report;
    const island = new Race(problem, random);
    yield* island.race(island.randomStarts(uniform));
    yield* island.settle();
    optima.push(island.elite[0]);
    yield* main.join(island.elite[0]);
  }
}

/** Return a design of a long row: that of a short one, whose middle is repeated. */
function* stretched(problem, random) {
  const { scene } = problem, { length } = scene.document.row;
  const row = { count: SHORT, ...(length ? { length: (length * (SHORT - 1)) / (scene.count - 1) } : {}) };
  const times = scene.document.tempo?.times?.slice(0, SHORT - 1);
  const short = new Problem(scene.replaced({ row, ...(times ? { tempo: { times } } : {}) }));
  const race = new Race(short, random), uniform = short.design(short.scene.uniform().layout);
  yield* race.race(race.starts(uniform));
  const { design } = short.best, middle = short.pairs >> 1, tail = short.pairs - middle;
  return Float64Array.from({ length: problem.size }, (_, i) => {
    const place = i % problem.pairs, part = Math.floor(i / problem.pairs) * short.pairs;
    const source = place < middle ? place : place >= problem.pairs - tail ? place - problem.pairs + short.pairs : middle;
    return design[part + source];
  });
}

/**
 * Search better layouts of a scene; return {layout, score, reason}.
 *
 * seconds: limit; start: a layout to begin with, beside others; onBetter({layout, score, seconds}):
 * called for better layouts, ten times a second at most; shouldStop(): true ends the search.
 */
export async function search(scene, { seconds = 5, seed = 0, start, onBetter = () => {}, shouldStop = () => false } = {}) {
  if (scene.whyNotSearched) throw new RangeError(scene.whyNotSearched);
  const began = performance.now(), elapsed = () => (performance.now() - began) / 1000;
  let isBetter = false;
  const problem = new Problem(scene, () => { isBetter = true; });
  const result = () => {
    const layout = problem.best.design ? problem.layout(problem.best.design) : start ?? scene.uniform().layout;
    return { layout, score: scene.score(layout).score, seconds: elapsed() };
  };
  const onTime = () => scene.tempo !== null && problem.best.score > 1 / (1 + ON_TIME / scene.tempo.tolerance);
  const given = start ? [problem.design(start)] : [], steps = searchProblem(problem, new Random(seed), given);
  let reason = "", slice = began, reported = began;
  while (!reason) {
    const step = steps.next();
    if (step.done) reason = step.value;
    else if (onTime()) reason = "every domino is hit on schedule, to 1 ns";
    else if (performance.now() - slice > SLICE) {
      if (isBetter && performance.now() - reported > REPORT) {
        onBetter(result());
        [isBetter, reported] = [false, performance.now()];
      }
      // messages are answered meanwhile
      await new Promise((resume) => { setTimeout(resume); });
      slice = performance.now();
      if (shouldStop()) reason = "stopped";
      else if (elapsed() > seconds) reason = `stopped after ${seconds} s; a longer search may find more`;
    }
  }
  return { ...result(), reason };
}
