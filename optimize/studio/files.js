// Files and links: layouts (.csv, .json) and scenes (.toml) with the messages of Python, and saving.

import toml from "./vendor/smol-toml.cjs";
import { isFlat } from "./geometry.js";
import { STANDARD, didYouMean, full, general } from "./kernels.js";

const SMALLEST = 1e-9, LARGEST = 1e9; // bounds of sizes in files [SI units]
const MAX_LINK_LENGTH = 30000; // characters that programs accept in an address
const MAX_LINK_CONTENT = 2 ** 20; // [characters] of a link, unpacked
const UNIT = "SI: m, kg/m3";
const SIZES = ["spacing", "thickness", "height", "width", "density"], GROUND = ["rise", "tilt"];
const MEANINGS = {
  spacing: "free gaps, one fewer than dominoes [m]", thickness: "along the chain [m]", height: "[m]", width: "across the chain [m]", density: "[kg/m³]",
  rise: "height of the next pivot above this one [m]", tilt: "slope of the ground under it, positive downhill [rad]",
};
// cells are divided by these, not multiplied by 0.001: 18 mm is then exactly the number 0.018
const PER_UNIT = { density: 1, tilt: 1, tilt_rad: 1, tilt_deg: 180 / Math.PI };
for (const name of ["spacing", "thickness", "height", "width", "rise"]) Object.assign(PER_UNIT, { [name]: 1, [`${name}_m`]: 1, [`${name}_mm`]: 1000 });

const fail = (message) => { throw new RangeError(message); };
const oneLine = (text, most = 100) => { const line = String(text).replace(/\s+/g, " "); return line.length > most ? `${line.slice(0, most)}…` : line; };

/** Call a function, and put the name of a file before the message of its error. */
export function withName(name, work) {
  try {
    return work();
  } catch (error) {
    if (!(error instanceof RangeError)) throw error;
    throw new RangeError(error.message.startsWith(name) ? error.message : `${name}: ${error.message}`);
  }
}

/** Layout of arguments as in a file: single numbers hold for all dominoes. */
export function makeLayout({ spacing, thickness, height = STANDARD.height, width = STANDARD.width, density = STANDARD.density, rise, tilt }) {
  const count = spacing.length + 1;
  const layout = { spacing: Float64Array.from(spacing), thickness: full("thickness", thickness, count), height: full("height", height, count), width, density };
  if (typeof density !== "number") layout.density = full("density", density, count);
  const ground = { rise: full("rise", rise ?? 0, count - 1), tilt: full("tilt", tilt ?? 0, count) };
  return isFlat(ground) ? layout : { ...layout, ...ground };
}

// arguments in JSON: one number for equal values
function short(layout) {
  const plain = (value) => (typeof value === "number" ? value : value.every((v) => v === value[0]) ? value[0] : [...value]);
  const names = [...SIZES, ...(isFlat(layout) ? [] : GROUND)];
  return { ...Object.fromEntries(names.map((name) => [name, plain(layout[name])])), spacing: [...layout.spacing] };
}

/** Layout of the text of a .csv or .json file; `width` holds if the file has none. */
export function readLayout(name, text, width) {
  return withName(name, () => makeLayout({ width, ...(/\.csv$/i.test(name) ? readTable(name, text) : readJson(text)) }));
}

function readJson(text) {
  let values;
  try { values = JSON.parse(text); } catch (error) { fail(`not JSON: ${error.message}`); }
  const allowed = [...SIZES, ...GROUND, "unit"];
  if (values === null || typeof values !== "object" || Array.isArray(values)) fail("not a layout: give an object with spacing and thickness");
  for (const [key, value] of Object.entries(values)) {
    if (!allowed.includes(key)) fail(`unknown key '${oneLine(key, 60)}': ${didYouMean(key, allowed)}allowed: ${allowed.join(", ")}`);
    if (key === "unit") { if (value !== UNIT) fail(`unit = '${oneLine(value)}': choose one of ${UNIT}`); continue; }
    const signed = GROUND.includes(key), list = Array.isArray(value) ? value : [value];
    if (key === "spacing" ? !Array.isArray(value) : key === "width" && Array.isArray(value)) fail(`${key} = ${oneLine(JSON.stringify(value))}: give a ${key === "spacing" ? "list of numbers" : "number"}`);
    list.forEach((v, i) => {
      const low = signed ? -LARGEST : SMALLEST;
      if (typeof v !== "number" || !(v >= low && v <= LARGEST)) fail(`${key}${Array.isArray(value) ? `[${i}]` : ""} = ${oneLine(JSON.stringify(v))}: give a finite number from ${general(low)} to ${general(LARGEST)} (${MEANINGS[key]})`);
    });
  }
  for (const key of ["spacing", "thickness"]) if (!(key in values)) fail(`${key} is missing: give ${key === "spacing" ? "" : "a number or "}a list of numbers (${MEANINGS[key]})`);
  delete values.unit;
  return values;
}

// cells of a line; those in quotes may contain the separator
function split(line, separator) {
  const cells = [""];
  let quoted = false;
  for (const sign of line) {
    if (sign === '"') quoted = !quoted;
    else if (sign === separator && !quoted) cells.push("");
    else cells[cells.length - 1] += sign;
  }
  return cells;
}

// lines of cells that are not blank, with their numbers
const cellsOf = (text, separator) => text.split(/\r\n|\n|\r/).map((line, k) => [k + 1, split(line, separator)]).filter(([, cells]) => cells.some((cell) => cell.trim()));

function readTable(name, text) {
  const tables = [";", "\t", ","].map((sign) => ({ sign, lines: cellsOf(text.replace(/^\ufeff/, ""), sign) }));
  const { sign, lines } = tables.reduce((a, b) => ((b.lines[0]?.[1].length ?? 0) > (a.lines[0]?.[1].length ?? 0) ? b : a));
  if (!lines.length) fail("the file is empty: give a line of names, such as spacing_mm,thickness_mm");
  const [[head, first], ...dominoes] = lines, places = {};
  const names = first.map((cell) => cell.toLowerCase().split(/[\s_()[\]]+/).filter(Boolean).join("_"));
  names.forEach((column, place) => {
    const [kind] = column.split("_");
    if (!(column in PER_UNIT)) return;
    if (kind in places) fail(`${name}, line ${head}: two columns give the ${kind}; keep one`);
    places[kind] = place;
  });
  for (const kind of ["spacing", "thickness"]) if (!(kind in places)) {
    fail(`${name}, line ${head}: no column for the ${kind}; name one '${kind}' (metres) or '${kind}_mm' (found: ${names.filter(Boolean).slice(0, 20).map((n) => oneLine(n, 40)).join(", ") || "nothing"})`);
  }
  if (!dominoes.length) fail("no dominoes below the line of names: give one line per domino");
  const values = Object.fromEntries(Object.keys(places).map((kind) => [kind, []]));
  for (const [line, cells] of dominoes) {
    if (cells.slice(names.length).some((cell) => cell.trim())) fail(`${name}, line ${line}: more cells than the ${names.length} names: where commas separate cells, write 18.5 with a point, or separate them by semicolons`);
    for (const [kind, place] of Object.entries(places)) {
      const cell = (cells[place] ?? "").trim(), isGap = /[^\s0.,]/.test(cell), isLast = line === dominoes.at(-1)[0];
      const wrong = (reason) => fail(`${name}, line ${line}, column '${oneLine(names[place])}': ${reason}`);
      if (kind === "spacing" && isGap === isLast) wrong(isLast ? "leave it empty, as the last domino has no gap in front, or add dominoes" : "empty or 0: give the free gap in front of every domino but the last");
      if (["spacing", "rise"].includes(kind) && isLast) continue;
      values[kind].push(number(kind, cell, PER_UNIT[names[place]], sign, wrong));
    }
  }
  if (values.width) {
    const [low, high] = [Math.min(...values.width), Math.max(...values.width)];
    if (low < high) fail(`${name}, line ${head}, column '${names[places.width]}': dominoes of ${low} and ${high} m: give one width for all`);
    values.width = low;
  }
  return values;
}

function number(kind, cell, perUnit, sign, wrong) {
  if (!cell) wrong(`empty; every domino needs a ${kind}`);
  const quoted = oneLine(cell, 60), text = sign === "," ? cell : cell.replace(",", ".");
  const value = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(text) ? Number(text) / perUnit : NaN;
  if (Number.isNaN(value)) wrong(`'${quoted}' is not a number${/^\d+,\d+$/.test(cell) ? `: where commas separate cells, write ${cell.replace(",", ".")}` : ""}`);
  if (GROUND.includes(kind) ? Math.abs(value) > LARGEST : !(value >= SMALLEST && value <= LARGEST)) wrong(`${quoted}: give a number more than 0, ${general(SMALLEST)} to ${general(LARGEST)} in SI units`);
  return value;
}

/** Document of the text of a .toml file. */
export function readDocument(name, text) {
  return withName(name, () => {
    let document;
    try { document = toml.parse(text); } catch (error) { fail(`not TOML: ${error.message.split("\n")[0].replace("Invalid TOML document: ", "")} (at line ${error.line}, column ${error.column})`); }
    return { name: name.replace(/^.*[/\\]|(\.scene)?\.toml$/gi, "") || "own", ...document };
  });
}

// UTF-16 if its byte order mark is there, else UTF-8 if valid, else Latin-1, as spreadsheets write
function decode(bytes) {
  const mark = { "255,254": "utf-16le", "254,255": "utf-16be" }[bytes.slice(0, 2).join()];
  try {
    return { utf: new TextDecoder(mark ?? "utf-8", { fatal: true }).decode(bytes) };
  } catch {
    return { latin: new TextDecoder("latin1").decode(bytes) };
  }
}

/**
 * Scene and layout of opened files, `{document, layout}`, of which one may be missing.
 * @param {Map<string, ArrayBuffer>} files contents by name: a layout, a scene, or one of each
 * @param {number} width of the dominoes of a layout without one [m]
 */
export function readFiles(files, width) {
  const ending = (name) => name.toLowerCase().match(/\.(csv|json|toml)$/)?.[1], found = {};
  const kinds = [...files.keys()].map((name) => (ending(name) === "toml" ? "scene" : ending(name) && "layout"));
  if (!files.size || kinds.includes(undefined) || new Set(kinds).size < kinds.length) {
    fail(`${oneLine([...files.keys()].join(", "), 200)}: give a layout (.csv or .json), a scene (.toml), or one of each`);
  }
  for (const [name, bytes] of files) {
    const text = decode(new Uint8Array(bytes)), isScene = ending(name) === "toml";
    if (isScene && text.latin) fail(`${oneLine(name)}: not UTF-8 text: save the file as UTF-8`);
    if (isScene) found.document = readDocument(oneLine(name), text.utf);
    else found.layout = readLayout(oneLine(name), text.utf ?? text.latin, width);
  }
  return found;
}

/** Text of a layout as CSV, one line per domino in SI units. */
export function layoutCsv(layout) {
  const names = [...SIZES, ...(isFlat(layout) ? [] : GROUND)];
  const lines = Array.from(layout.thickness, (_, i) => [i, ...names.map((name) => (typeof layout[name] === "number" ? layout[name] : layout[name][i] ?? ""))]);
  return [["number", ...names], ...lines].map((cells) => `${cells.join(",")}\r\n`).join("");
}

/** Text of a layout as JSON, in SI units. */
export const layoutJson = (layout) => `${JSON.stringify({ unit: UNIT, ...short(layout) }, null, 1)}\n`;

/** Text of a document as TOML: values before tables, and inner tables in one line. */
export function documentToml(document) {
  const isTable = (v) => typeof v === "object" && v !== null && !Array.isArray(v);
  const format = (v) => (isTable(v) ? `{${Object.entries(v).map(([k, w]) => `${k} = ${format(w)}`).join(", ")}}` : Array.isArray(v) ? `[${v.map(format).join(", ")}]` : JSON.stringify(v).replace("\x7f", "\\u007f"));
  const lines = (table) => Object.entries(table).filter(([, v]) => v != null).map(([k, v]) => `${k} = ${format(v)}`);
  const tables = Object.entries(document).filter(([, v]) => isTable(v));
  const top = lines(Object.fromEntries(Object.entries(document).filter(([, v]) => !isTable(v))));
  return `${[...top, ...tables.flatMap(([name, table]) => ["", `[${name}]`, ...lines(table)])].join("\n")}\n`;
}

/** Offer a text as a file to download. */
export function save(name, text, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const through = (bytes, stream) => new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer();

/** Bytes of a text in base64, unpacked by gzip. */
export async function unpack(text) {
  return new Uint8Array(await through(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)), new DecompressionStream("gzip")));
}

/** Part of the address after # that holds scene and layout; "" if it is too long. */
export async function makeLink(document, layout) {
  const bytes = new Uint8Array(await through(JSON.stringify({ scene: document, layout: short(layout) }), new CompressionStream("deflate")));
  const text = btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join("")).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
  return text.length < MAX_LINK_LENGTH ? `design=${text}` : "";
}

/** Scene and layout of `makeLink`, as of `readFiles`. */
export async function readLink(text) {
  let values;
  try {
    const bytes = Uint8Array.from(atob(text.replace(/^design=/, "").replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
    const json = new TextDecoder("utf-8", { fatal: true }).decode(await through(bytes, new DecompressionStream("deflate")));
    if (json.length > MAX_LINK_CONTENT) throw new RangeError("too long");
    values = JSON.parse(json);
    if (!values.scene.row || !values.layout.spacing) throw new RangeError("no row");
  } catch {
    fail("the row in the link: it was cut or changed: copy the whole link");
  }
  return withName("the row in the link", () => ({ document: values.scene, layout: makeLayout(readJson(JSON.stringify(values.layout))) }));
}
