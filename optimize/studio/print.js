// To the table: pages at 1:1 with a box for each domino, and a strip with slots for a laser cutter. Lengths in mm.

import { positionsAlong } from "./geometry.js";
import { require } from "./kernels.js";

/** Sizes of papers [mm], landscape; a roll is as long as the row. */
export const PAPERS = { a4: [297, 210], a3: [420, 297], letter: [279.4, 215.9] };
const MM = 1000, LONGEST = 5000; // [mm/m]; [mm] of a page of a roll, the largest that PDF has
const MARGIN = 14, LEAST_MARGIN = 6; // [mm] blank at the left and right; the least that printers need, if it saves a sheet
const LEAD = 10, HEAD = 24, FOOT = 26, EDGE = 3; // [mm] before and after the row; for title and ruler; of a roll
const BESIDE = 13, NUMBER = 2.2; // [mm] of a strip on each side of the dominoes, for numbers and gaps; half the width of a number
const RULER = 100, ROLL_HEAD = RULER + 40; // [mm] ruler; of a roll for title and ruler
const ROUNDING = 1e-6; // [mm] of a row that no strip is added for
const WEB = 0.5; // [mm] least material between two slots
const SAFE = 3; // dominoes in a row that are left out until the end

const escape = (text) => String(text).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);
const fixed = (v) => Number(v.toFixed(4));
const text = (x, y, words, size, more = "") => `<text x="${fixed(x)}" y="${fixed(y)}" font-size="${size}" ${more}>${escape(words)}</text>`;
const line = (x1, y1, x2, y2, more = "") => `<path d="M${fixed(x1)},${fixed(y1)}L${fixed(x2)},${fixed(y2)}" ${more}/>`;
const box = (x, y, w, h, more = "") => `<rect x="${fixed(x)}" y="${fixed(y)}" width="${fixed(w)}" height="${fixed(h)}" ${more}/>`;

/** Indices of dominoes that are left out until the end: three in a row, `every` millimetres apart. */
export function safetyGaps(layout, every) {
  const front = positionsAlong(layout), left = new Set();
  for (let i = 1, next = every; every > 0 && i + SAFE < front.length; i++) {
    if (MM * front[i] < next) continue;
    for (let k = 0; k < SAFE; k++) left.add(i + k);
    next = MM * front[i + SAFE] + every;
  }
  return left;
}

// parts of a row for sheets of paper, `{row, begin, end, dominoes}` with places along the row
function stripsOf(row, length, begin, end, safe) {
  const front = Array.from(positionsAlong(row.layout), (x) => MM * x), rear = front.map((x, i) => x - MM * row.layout.thickness[i]), strips = [];
  for (let from = begin; from < end - ROUNDING; from += length) {
    const to = from + length, dominoes = [...front.keys()].filter((i) => front[i] > from && rear[i] < to);
    strips.push({ row, safe, front, rear, begin: from, end: to, dominoes });
  }
  return strips.map((strip, k) => ({ ...strip, number: k + 1, of: strips.length }));
}

/**
 * Pages of rows at 1:1.
 * @param {{name: string, layout: object, designed: number, start: string}[]} rows one or two rows; `start` says what to do to the first domino
 * @param {object} options `paper` ("a4", "a3", "letter", "roll"), `roll` its width [mm], `safety` distance of safety gaps [mm], 0 for none, `title`
 * @returns {{width: number, height: number, svg: string}[]} pages with their sizes [mm]
 */
export function printPages(rows, { paper = "a4", roll = 210, safety = 0, title = "" }) {
  require("safety gap every", safety, { low: 0 }, { unit: "mm" });
  const isRoll = paper === "roll", high = isRoll ? roll : PAPERS[paper]?.[1], [top, foot] = isRoll ? [EDGE, EDGE] : [HEAD, FOOT];
  if (!(high > 0)) throw new RangeError(isRoll ? `roll = ${roll} mm: give the width of the roll` : `paper = ${paper}: choose one of ${Object.keys(PAPERS).join(", ")}, roll`);
  const widest = Math.max(...rows.map((row) => MM * row.layout.width)), across = widest + 2 * BESIDE, perSheet = Math.floor((high - top - foot) / across);
  if (perSheet < 1) throw new RangeError(`dominoes ${widest} mm wide: give at most ${(high - top - foot - 2 * BESIDE).toFixed(0)} mm for this paper`);
  const placed = rows.map((row) => ({ row, begin: -MM * row.layout.thickness[0] - LEAD, end: MM * positionsAlong(row.layout).at(-1) + LEAD }));
  const longest = Math.max(...placed.map(({ begin, end }) => end - begin)), left = isRoll ? ROLL_HEAD : 0;
  const wide = isRoll ? Math.min(longest + 2 * MARGIN + left, LONGEST) : PAPERS[paper][0];
  const sheets = (margin) => Math.ceil(placed.reduce((n, { begin, end }) => n + Math.ceil((end - begin - ROUNDING) / (wide - left - 2 * margin)), 0) / perSheet);
  const margin = sheets(LEAST_MARGIN) < sheets(MARGIN) ? LEAST_MARGIN : MARGIN, count = sheets(margin);
  const strips = placed.flatMap(({ row, begin, end }) => stripsOf(row, wide - left - 2 * margin, begin, end, safetyGaps(row.layout, safety)));
  return Array.from({ length: count }, (_, sheet) => {
    const parts = strips.slice(sheet * perSheet, (sheet + 1) * perSheet).map((strip, place) => drawStrip(strip, left + margin, top + (place + 0.5) * across));
    const x = isRoll ? EDGE : MARGIN, head = text(x, isRoll ? 9 : 14, title, 4.5, 'font-weight="bold"') + text(x, isRoll ? 15 : 20, `sheet ${sheet + 1} of ${count}`, 3.2);
    const ruler = drawRuler(x, isRoll ? Math.min(30, high - 6) : high - 14);
    const svg = `<svg xmlns="http://www.w3.org/2000/svg" width="${wide}mm" height="${high}mm" viewBox="0 0 ${fixed(wide)} ${high}" font-family="sans-serif" fill="#000" stroke="none">${head}${ruler}${parts.join("")}</svg>`;
    return { width: wide, height: high, svg };
  });
}

function drawStrip({ row, safe, front, rear, begin, end, dominoes, number, of }, left, middle) {
  const half = 0.5 * MM * row.layout.width, edge = half + BESIDE, x = (s) => left + s - begin, right = left + end - begin, last = front.length - 1;
  const thin = 'stroke="#000" stroke-width="0.15" fill="none"', pale = 'stroke="#999" stroke-width="0.1" fill="none"';
  const parts = [line(left, middle - edge, right, middle - edge, pale), line(left, middle + edge, right, middle + edge, pale), line(left, middle, right, middle, `${pale} stroke-dasharray="4 1 1 1"`)];
  for (const i of dominoes) {
    const is = { first: i === 0, last: i === last, late: safe.has(i), fixed: i >= row.designed }, d = front[i] - rear[i], centre = x(rear[i] + 0.5 * d);
    const fill = is.first || is.last ? "#bbb" : is.fixed ? "#ddd" : "none";
    parts.push(box(x(rear[i]), middle - half, d, 2 * half, `class="domino" stroke="#000" stroke-width="0.15" fill="${fill}"`));
    if (is.late) parts.push(line(x(rear[i]), middle - half, x(front[i]), middle + half, pale), line(x(rear[i]), middle + half, x(front[i]), middle - half, pale));
    const label = Math.min(Math.max(centre, left + NUMBER), right - NUMBER); // on both strips if the domino is on two
    parts.push(text(label, middle + half + (i % 2 ? 6.6 : 3.4), i + 1, 2.4, 'text-anchor="middle"'));
    if (centre >= left && centre < right) {
      if (is.first || is.last || (is.late && !safe.has(i - 1))) parts.push(text(centre, middle + half + 10.5, is.first ? `first: ${row.start} →` : is.last ? "last" : "leave out until the end", 2.8, `text-anchor="${is.last ? "end" : "start"}"`));
    }
  }
  for (let i = 0; i < last; i++) { // also a gap between dominoes that are on other strips
    const gap = x(0.5 * (front[i] + rear[i + 1]));
    if (gap >= left && gap < right) parts.push(text(0, 0, (MM * row.layout.spacing[i]).toFixed(1), 2.4, `class="gap" transform="translate(${fixed(gap + 0.8)} ${fixed(middle - half - 1)}) rotate(-90)"`));
  }
  parts.push(text(0.5 * (left + right), middle - edge + 4, `${row.name}${of > 1 ? `, strip ${number} of ${of}` : ""}; numbers between the boxes: gaps in mm`, 2.5, 'text-anchor="middle"'));
  for (const [at, neighbour, anchor, by] of [[left, number - 1, "start", 1], [right, number + 1, "end", -1]]) if (neighbour >= 1 && neighbour <= of) {
    parts.push(line(at, middle - edge, at, middle + edge, `${thin} stroke-dasharray="2 1"`), text(at + by, middle - edge + 4, `joins strip ${neighbour}`, 2.5, `text-anchor="${anchor}"`));
  }
  return parts.join("");
}

function drawRuler(x, y) {
  const thin = 'stroke="#000" stroke-width="0.2"', parts = [line(x, y, x + RULER, y, `${thin} class="ruler"`)];
  for (let k = 0; k <= 10; k++) parts.push(line(x + 10 * k, y, x + 10 * k, y - 3, thin));
  return parts.join("") + text(x, y + 4.5, "100 mm: if not, print at 100 %, not fitted to the page", 2.8);
}

/**
 * Outline of a strip with one slot for each domino, in pieces, as the text of an SVG file in millimetres: red lines are cut, blue ones engraved.
 * @param {object} layout
 * @param {object} options `tolerance` by which slots are larger than a domino, `piece` largest length of a piece, `safety` distance of safety gaps, 0 for none [mm]
 */
export function stripSvg(layout, { tolerance = 0.3, piece = 300, safety = 0 }) {
  require("slots larger by", tolerance, { low: 0 }, { unit: "mm" });
  require("longest piece", piece, { above: 0 }, { unit: "mm" });
  require("safety gap every", safety, { low: 0 }, { unit: "mm" });
  const front = Array.from(positionsAlong(layout), (x) => MM * x), rear = front.map((x, i) => x - MM * layout.thickness[i]), last = front.length - 1;
  const narrow = front.findIndex((x, i) => i < last && rear[i + 1] - x - tolerance < WEB);
  if (narrow >= 0) throw new RangeError(`gap ${narrow + 1} is ${(rear[narrow + 1] - front[narrow]).toFixed(2)} mm wide: with slots ${tolerance} mm larger than the dominoes, ${WEB} mm of material have to remain; give a smaller tolerance or a wider gap`);
  const cuts = [rear[0] - LEAD], end = front[last] + LEAD, middles = front.slice(0, -1).map((x, i) => 0.5 * (x + rear[i + 1]));
  while (end - cuts.at(-1) > piece) {
    const next = middles.findLast((m) => m <= cuts.at(-1) + piece && m > cuts.at(-1));
    if (next === undefined) throw new RangeError(`pieces of ${piece} mm: give at least ${Math.ceil(Math.max(...middles.map((m, i) => m - (i ? middles[i - 1] : cuts[0])), end - middles.at(-1)))} mm, a domino with the gaps beside it`);
    cuts.push(next);
  }
  cuts.push(end);
  const high = MM * layout.width + 2 * BESIDE, safe = safetyGaps(layout, safety), parts = [], wide = Math.max(...cuts.slice(1).map((c, k) => c - cuts[k]));
  const cut = 'fill="none" stroke="#f00" stroke-width="0.1"', engrave = 'fill="#00f" font-family="sans-serif"';
  for (let k = 0; k + 1 < cuts.length; k++) {
    const y = k * (high + 5), x = (s) => s - cuts[k];
    parts.push(box(0, y, cuts[k + 1] - cuts[k], high, `${cut} class="piece"`), text(2, y + 4, `${k + 1}/${cuts.length - 1}`, 3, engrave));
    for (let i = 0; i <= last; i++) if (front[i] > cuts[k] && front[i] < cuts[k + 1]) {
      const label = i === 0 ? "→ 1" : safe.has(i) ? `(${i + 1})` : (i + 1) % 10 === 0 || i === last ? String(i + 1) : "";
      parts.push(box(x(rear[i] - 0.5 * tolerance), y + BESIDE - 0.5 * tolerance, front[i] - rear[i] + tolerance, MM * layout.width + tolerance, `${cut} class="slot"`));
      if (label) parts.push(text(x(0.5 * (rear[i] + front[i])), y + high - 4, label, 3, `${engrave} text-anchor="middle"`));
    }
  }
  const total = (cuts.length - 1) * (high + 5) - 5;
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${fixed(wide)}mm" height="${fixed(total)}mm" viewBox="0 0 ${fixed(wide)} ${fixed(total)}">\n${parts.join("\n")}\n</svg>\n`;
}
