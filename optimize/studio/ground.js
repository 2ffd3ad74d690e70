/** Ground under a chain, an even slope or a smooth curve through points: as `domino_env.physics.ground`. */

import { general, require } from "./kernels.js";

const MAX_DEVIATION = 1e-4; // of the ground under a base from its chord [m]
const MAX_SLOPE = 45; // [°]

export class Ground {
  /** slope: angle, positive downhill [°]; profile: points [x, y] of a curve, x rising [m]. */
  constructor(kernels, { slope, profile }) {
    if ((slope === undefined) === (profile === undefined)) {
      throw new RangeError("ground: give either slope [°] or profile, a list of points [x, y] [m]");
    }
    if (profile !== undefined && !(Array.isArray(profile) && profile.length > 1 && profile.every((point) => point?.length === 2))) {
      throw new RangeError("ground.profile: give a list of two or more points [x, y] [m]");
    }
    Object.assign(this, { kernels, slope, profile });
    if (profile) this.#fit();
    else require("slope", slope, { low: -MAX_SLOPE, high: MAX_SLOPE }, { hint: "of an even slope, positive downhill [degrees]" });
  }

  get isEven() { return this.profile === undefined; }

  /** Compute the pieces of the natural cubic spline through the points. */
  #fit() {
    const x = this.profile.map((point) => point[0]), y = this.profile.map((point) => point[1]), last = x.length - 1;
    [...x, ...y].forEach((value) => require("profile", value, { low: -1e9, high: 1e9 }));
    x.forEach((here, i) => {
      if (i > 0 && !(here > x[i - 1])) {
        throw new RangeError(`profile[${i}] lies at x = ${general(here)} m and profile[${i - 1}] at ` +
          `${general(x[i - 1])} m: give points of rising x`);
      }
    });
    const h = x.slice(1).map((here, i) => here - x[i]), rate = h.map((step, i) => (y[i + 1] - y[i]) / step);
    const second = new Float64Array(last + 1), factor = new Float64Array(last + 1); // second derivatives
    for (let i = 1; i < last; i++) {
      const pivot = 2 * (h[i - 1] + h[i]) - h[i - 1] * factor[i - 1];
      factor[i] = h[i] / pivot;
      second[i] = (6 * (rate[i] - rate[i - 1]) - h[i - 1] * second[i - 1]) / pivot;
    }
    for (let i = last - 1; i > 0; i--) second[i] -= factor[i] * second[i + 1];
    const slopes = rate.map((r, i) => r - (h[i] * (2 * second[i] + second[i + 1])) / 6);
    const end = rate[last - 1] + (h[last - 1] * (second[last - 1] + 2 * second[last])) / 6;
    this.knots = Float64Array.from(x);
    this.starts = Float64Array.from([x[0], ...x]);
    this.pieces = [
      [0, 0, slopes[0], y[0]],
      ...h.map((step, i) => [(second[i + 1] - second[i]) / (6 * step), second[i] / 2, slopes[i], y[i]]),
      [0, 0, end, y[last]],
    ];
    this.curve = Float64Array.from([...this.knots, ...this.starts, ...this.pieces.flat()]);
    const [place, steepest] = this.#steepest();
    if (steepest > Math.tan((MAX_SLOPE * Math.PI) / 180)) {
      const degrees = general((Math.atan(steepest) * 180) / Math.PI, 3);
      throw new RangeError(`profile slopes by ${degrees}° near x = ${general(place, 4)} m: at most ${MAX_SLOPE}°; ` +
        "place the points further apart in x");
    }
  }

  #steepest() {
    let [place, steepest] = [0, 0];
    this.pieces.slice(1).forEach(([a, b, c], i) => {
      for (const t of [0, -b / (3 * a)]) { // the slope is largest at a knot or where nothing is curved
        const inside = t === 0 || (t > 0 && t < this.knots[i + 1] - this.knots[i]);
        const slope = Math.abs((3 * a * t + 2 * b) * t + c);
        if (inside && slope > steepest) [place, steepest] = [this.knots[i] + t, slope];
      }
    });
    return [place, steepest];
  }

  /** Return the height of the ground at x [m]. */
  height(x) {
    if (this.isEven) return -Math.tan((this.slope * Math.PI) / 180) * x;
    let k = 0;
    while (k < this.knots.length && x > this.knots[k]) k += 1;
    const t = x - this.starts[k], [a, b, c, d] = this.pieces[k];
    return ((a * t + b) * t + c) * t + d;
  }

  /** Return {rise, tilt} of a layout on the ground. */
  riseAndTilt({ spacing, thickness }) {
    if (!this.isEven) {
      const fault = this.violation(Math.max(...thickness));
      if (fault) throw new RangeError(fault);
      return this.kernels.place({ spacing, thickness }, this.curve, this.knots.length);
    }
    const angle = (this.slope * Math.PI) / 180, sine = Math.sin(angle);
    return { rise: spacing.map((s, i) => -sine * (s + thickness[i + 1])), tilt: thickness.map(() => angle) };
  }

  /** Return a sentence if the ground is too curved for a base somewhere, else "". */
  violation(thickness) {
    if (this.isEven) return "";
    for (const [sign, verb] of [[1, "is hollow"], [-1, "bulges"]]) {
      let [place, curvature] = [0, 0];
      this.pieces.slice(1).forEach(([, b], i) => {
        if (sign * 2 * b > curvature) [place, curvature] = [this.knots[i], sign * 2 * b];
      });
      const deviation = (curvature * thickness ** 2) / 8;
      if (deviation > MAX_DEVIATION) {
        return `the ground ${verb} by ${general(1e3 * deviation, 3)} mm under a base ${general(1e3 * thickness, 4)} ` +
          `mm thick near x = ${general(place, 4)} m: at most ${general(1e3 * MAX_DEVIATION)} mm; make it more even ` +
          "there or the dominoes thinner";
      }
    }
    return "";
  }

  /** Return derivatives by spacing and thickness of dominoes that move along the ground. */
  along(gradient, layout) {
    if (!this.isEven) return this.kernels.alongCurve(layout, this.curve, this.knots.length, gradient);
    const sine = Math.sin((this.slope * Math.PI) / 180), { rise, spacing, thickness } = gradient;
    return {
      spacing: spacing.map((g, i) => g - sine * rise[i]),
      thickness: thickness.map((g, i) => (i > 0 ? g - sine * rise[i - 1] : g)),
    };
  }
}
