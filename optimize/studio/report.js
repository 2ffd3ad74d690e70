// Report: results of several rows, their curves, curves of search and training, and verifications.

import { createCurves, rangeOf } from "./curves.js";
import { makeLink } from "./files.js";
import { positions } from "./kernels.js";

const COLOURS = ["result", "leader", "chosen", "uniform", "error"]; // names in page.css, of rows and terms of an energy
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3], [14, 4]];
const MILLI = 1000;
const WIDE = 20; // axes over values with a larger ratio are logarithmic

const element = (name, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
};
const style = (k) => ({ colour: COLOURS[k % COLOURS.length], dash: DASHES[k % DASHES.length] });

// piece of curve k
function swatch(k) {
  const box = element("span", { className: "swatch" }), { colour, dash } = style(k);
  box.innerHTML = `<svg width="30" height="8"><path d="M0 4H30" style="stroke:var(--${colour})" stroke-width="2.5" stroke-dasharray="${dash.join(" ")}"/></svg>`;
  return box;
}

// true if all values are positive, and the largest is more than `WIDE` times the least
const isWide = (values) => Math.min(...values) > 0 && Math.max(...values) > WIDE * Math.min(...values);
const short = (v) => (v >= 1e4 ? `${v / 1e3} k` : String(v));
const power = (v) => short(Number((10 ** v).toPrecision(2)));

// appends a chart of series `{x, y, colour, dash}`; a logarithmic axis where a flag of `wide` is true
function chart(box, title, series, wide = [false, false]) {
  const shown = series.map((s) => ({ ...s, x: wide[0] ? s.x.map(Math.log10) : s.x, y: wide[1] ? s.y.map(Math.log10) : s.y }));
  const xs = shown.flatMap((s) => s.x), place = element("div", { className: "curve" });
  box.append(place);
  const [low, high] = xs.length ? [Math.min(...xs), Math.max(...xs)] : [0, 1];
  const write = wide.map((isLogarithmic) => (isLogarithmic ? power : short));
  createCurves(place, title).draw({ title, x: [low, high > low ? high : low + 1], y: rangeOf(shown.flatMap((s) => s.y)), series: shown, write });
}

// curves of searches (steps) or trainings of the rows that have one; scores below zero, of waves that stop, are left out
function runCurves(box, rows, key, title, steps) {
  const series = rows.flatMap((row, k) => {
    const [x, y] = row[key] ?? [[], []], points = x.map((v, i) => [v, y[i]]).filter(([, v]) => v >= 0);
    const held = steps ? points.flatMap(([v, w], i) => (i ? [[v, points[i - 1][1]], [v, w]] : [[v, w]])) : points;
    return points.length ? [{ x: held.map(([v]) => v), y: held.map(([, w]) => w), ...style(k) }] : [];
  });
  if (!series.length) return;
  const quantity = rows.find((row) => row[key]).quantity, ys = series.flatMap((s) => s.y);
  chart(box, title.replace("{}", quantity), series, [steps && isWide(series.flatMap((s) => s.x)), !quantity.startsWith("score") && isWide(ys)]);
}

function resultTable(rows, drafts) {
  const base = drafts.findLast(({ wave }) => wave.meanSpeed > 0); // the best equal gaps if there is a scene
  const isSpeed = rows.every((row) => row.quantity.startsWith("score")), texts = rows.some((row) => row.score && !row.score.endsWith("m/s"));
  const names = ["row", ...(texts ? ["result"] : []), "mean speed", ...(base && rows.length > 1 && isSpeed ? [`over ${rows[drafts.indexOf(base)].name}`] : []), "last hit", "length", "dominoes", "outcome"];
  const lines = rows.map((row, k) => {
    const { wave } = drafts[k], speed = wave.meanSpeed, last = wave.arrivalTimes.at(-1);
    const link = element(row.fits ? "a" : "span", { textContent: row.name });
    if (row.fits) makeLink(row.document, drafts[k].layout).then((text) => { if (text) link.href = `#${text}`; });
    const gain = 100 * (speed / base?.wave.meanSpeed - 1);
    const cells = [element("span", {}, swatch(k), link), ...(texts ? [row.score ?? "–"] : []), speed ? `${speed.toFixed(5)} m/s` : "–",
      ...(names.some((name) => name.startsWith("over ")) ? [speed ? `${gain > 0 ? "+" : ""}${gain.toFixed(2)} %` : "–"] : []),
      speed ? `${(MILLI * last).toFixed(2)} ms` : "never", `${positions(wave.layout).at(-1).toFixed(4)} m`, wave.arrivalTimes.length, wave.outcome.toLowerCase()];
    return element("tr", {}, ...cells.map((cell) => element("td", {}, cell)));
  });
  const head = element("tr", {}, ...names.map((name) => element("th", { textContent: name, scope: "col" })));
  return element("div", { className: "wide", tabIndex: 0 }, element("table", {}, head, ...lines));
}

function verifications(rows) {
  const percent = (v) => (v === null ? "never hit" : `${v > 0 ? "+" : ""}${(100 * v).toFixed(3)} %`);
  const lines = rows.filter((row) => row.verification).map(({ name, verification: { verdict, last, simulator } }) => element("li", {
    textContent: `${name}: ${verdict} Time of the last hit relative to the model: ${last.map(([floor, v]) => `${floor} ${percent(v)}`).join(", ")} (${simulator}).`,
  }));
  return lines.length ? [element("h2", { textContent: "Verification by rigid-body simulation" }), element("ul", {}, ...lines)] : [];
}

/**
 * Fill a section of the page with the report of rows.
 * @param {HTMLElement} box
 * @param {object} data of the page: `headline`, and `rows` as of report.py
 * @param {function} draftOf draft of a row
 */
export function showReport(box, { rows, headline }, draftOf) {
  const drafts = rows.map(draftOf), charts = element("div", { className: "charts" }), waves = drafts.map((draft) => draft.wave);
  const numbers = (values) => Array.from(values, (_, i) => i + 1), scaled = (values) => Array.from(values, (v) => MILLI * v);
  box.hidden = false;
  box.append(element("h2", { textContent: "Report" }), element("p", { textContent: headline }), resultTable(rows, drafts), charts, ...verifications(rows));
  box.append(element("ul", {}, ...rows.map(({ name }, k) => element("li", { textContent: `${name}: ${waves[k].explanation}` }))));
  chart(charts, "Gap in front of each domino [mm]", waves.map(({ layout: { spacing } }, k) => ({ x: numbers(spacing), y: scaled(spacing), ...style(k) })));
  chart(charts, "Local speed at each domino [m/s]", waves.map(({ localSpeed }, k) => ({ x: numbers(localSpeed), y: [...localSpeed], ...style(k) })));
  chart(charts, "Kinetic energy, mean of each interval between hits [mJ], over time [s]", rows.map(({ kinetic: [x, y] }, k) => ({ x, y: scaled(y), ...style(k) })));
  const { energy } = rows[0], terms = { released: "released by gravity", kinetic: "kinetic", hits: "lost in hits", friction: "lost to friction", flushes: "lost in face impacts" };
  const balance = element("div");
  charts.append(balance);
  chart(balance, `Energy of ${rows[0].name} [mJ], over time [s]`, Object.keys(terms).map((term, k) => ({ x: energy.time, y: scaled(energy[term]), ...style(k) })));
  balance.append(element("p", { className: "details" }, ...Object.values(terms).flatMap((words, k) => [swatch(k), `${words} `])));
  runCurves(charts, rows, "search", "Best row of the search: {}, over time [s]", true);
  runCurves(charts, rows, "training", "Policy in training: {}, over dominoes placed", false);
}
