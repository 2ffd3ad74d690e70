// *Will it work?*: a row placed many times with errors, and free-standing on a floor.

import { Random } from "./search.js";

const DRAWS = 256, DEVIATION = 0.0005, LEAST_GAP = 0.0002; // draws; [m] error of a gap of a scene without one, and least gap with an error
const FLOOR = 0.5; // friction of the floor of a scene without one
const LIKELY = 0.95; // fraction of rows, or of dominoes, that has to fall for "Probably"

/** Answer in words, for a layout of a scene. */
export function check(kernels, scene, layout) {
  const random = new Random(1), floor = scene.floorFriction ?? FLOOR, row = scene.row(layout);
  const deviation = scene.placement?.deviation ?? DEVIATION;
  const sizes = [scene.freeThickness ? layout.thickness.slice(1) : undefined, scene.growth ? layout.height.slice(1) : undefined];
  let falls = 0;
  for (let k = 0; k < DRAWS; k++) {
    const spacing = layout.spacing.map((gap) => Math.max(gap + deviation * random.normal(), LEAST_GAP));
    try {
      falls += kernels.simulate(scene.row(scene.layout(spacing, ...sizes)), scene.physics, { rtol: 1e-6 }).propagated;
    } catch (error) {
      if (!(error instanceof RangeError)) throw error; // a domino does not stand on uneven ground
    }
  }
  const standing = kernels.standing(row, scene.physics, floor), count = row.thickness.length;
  const least = Math.min(falls / DRAWS, standing.toppled / count), answer = least === 1 ? "Yes" : least > LIKELY ? "Probably" : "No";
  return `${answer}. Placed to ±${1000 * deviation} mm, ${falls} of ${DRAWS} rows fall to the end. ` +
    `On a floor of friction ${floor}, ${standing.toppled} of ${count} dominoes fall${standing.meanSpeed ? `, at ${standing.meanSpeed.toFixed(3)} m/s` : ""}.`;
}
