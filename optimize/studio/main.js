// Page: state and history of the drafts, and what its buttons, settings and files do.

import { loadKernels } from "./kernels.js";
import { Scene } from "./scene.js";
import { Draft, OWN, sceneFor } from "./draft.js";
import { createRow, corners } from "./row.js";
import { createCurves, rangeOf } from "./curves.js";
import { pivotsOf } from "./geometry.js";
import { documentToml, layoutCsv, layoutJson, makeLayout, makeLink, readFiles, readLink, save, unpack, withName } from "./files.js";
import { printPages, stripSvg } from "./print.js";
import { showReport } from "./report.js";
import { createRecordings, isRecording } from "./recordings.js";

const PATIENCE = 2, LEAST_GAIN = 1e-4; // a search ends after this time [s] with less relative gain
const SECONDS = 60, THOROUGH = 300; // [s] of a search at most
const MOST = 5000; // dominoes that are drawn
const DRAWN = 100; // dominoes in a picture of the gallery
const UNIFORM = "best equal gaps", BEST = "best known row", KEPT = "kept row";
const MM = 1000, PUSH = 8; // [mm/m]; [rad/s] of a domino that was released in the file of its scene

// Numbers of a scene by the title of their group: label, table, key, value on the page over that in the table, step, and
// true if 0 on the page stands for no such key; hidden in scenes that do not have them. A word instead of a value over
// another makes a checkbox: if it is checked, the key has this word, otherwise the number from before.
const CONTROLS = {
  Dominoes: [["Number of dominoes", "row", "count", 1, 1], ["Height [mm]", "row", "height"], ["Width [mm]", "row", "width"], ["Thickness [mm]", "thickness", "fixed"]],
  "Ground, floor and friction": [
    ["Push of the first domino [rad/s]", "physics", "push", 1], ["released, not pushed", "physics", "push", "released"],
    ["Friction between dominoes", "physics", "friction", 1, 0.01],
    ["Slope [°], positive downhill", "ground", "slope", 1, 0.1, true], ["Floor friction (0: fixed pivots)", "physics", "floor_friction", 1, 0.05, true]],
  Rules: [
    ["Smallest gap [mm]", "spacing", "min"], ["Largest gap [mm]", "spacing", "max"], ["Smallest thickness [mm]", "thickness", "min"],
    ["Largest thickness [mm]", "thickness", "max"], ["Length [mm] (0: any)", "row", "length", MM, 0.1, true], ["Dominoes of the run-out", "run_out", "count", 1, 1],
    ["Gaps of the run-out [mm]", "run_out", "spacing"], ["Placement noise [mm]", "placement", "deviation", MM, 0.01]],
};

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const sorted = (_, v) => (v && typeof v === "object" && !Array.isArray(v) ? Object.fromEntries(Object.keys(v).sort().map((key) => [key, v[key]])) : v);
const texts = new WeakMap();
// text of a document, equal for equal documents
const canonical = (document) => texts.get(document) ?? texts.set(document, JSON.stringify(document, sorted)).get(document);
const plain = (layout) => ({ ...layout, spacing: [...layout.spacing], thickness: [...layout.thickness], height: [...layout.height] });

// workers: of a search, of best equal gaps, of recordings, and of what takes seconds and is dropped when the row changes
const searcher = createWorker(), helper = createWorker(), listener = createWorker(), slow = createWorker();
// `wanted`: scene of settings whose best equal gaps are computed
let bytes, kernels, row, curves, recordings, draft, kept = null, steps = [], position = -1, baselines = new Map(), search = null, ticket = 0, pending = null, wanted = null;

// workers ------------------------------------------------------------------------------------------

// worker with the library of the page, which starts when it is first asked: `ask` sends a message and returns the
// promise of its answer; `end` drops what was asked
function createWorker() {
  let worker = null, waiting = new Map(), count = 0;
  function begin() {
    const url = URL.createObjectURL(new Blob([$("library").textContent, "\n", $("worker").textContent], { type: "text/javascript" }));
    worker = new Worker(url);
    worker.postMessage({ type: "load", bytes });
    worker.onmessage = ({ data: answer }) => {
      const entry = waiting.get(answer.id);
      if (!entry) return;
      if (answer.type === "better") { entry.onBetter(answer); return; }
      waiting.delete(answer.id);
      if (answer.type === "error") entry.reject(new RangeError(answer.message)); else entry.resolve(answer);
    };
    worker.onerror = (event) => { for (const entry of waiting.values()) entry.reject(new Error(event.message)); };
  }
  return {
    ask: (message, onBetter) => new Promise((resolve, reject) => {
      if (!worker) begin();
      waiting.set(++count, { resolve, reject, onBetter });
      worker.postMessage({ ...message, id: count });
    }),
    end() {
      if (waiting.size) { worker.terminate(); worker = null; }
      waiting = new Map();
    },
    close() { worker?.terminate(); },
  };
}

// shipped scene with the same rules, if there is one
const shippedOf = (scene) => data.scenes[scene.document.name] && canonical(data.scenes[scene.document.name].document) === canonical(scene.document) ? data.scenes[scene.document.name] : null;

// draft of shipped gaps, thicknesses and heights; null for those that the scene has
const shippedDraft = (scene, sizes) => new Draft(scene, scene.layout(...sizes.map((v) => v ?? undefined)));

// draft of the best equal gaps of a scene, as `{value, promise}`: the shipped one, or one that the worker computes
function baseline(scene) {
  const key = canonical(scene.document), shipped = shippedOf(scene)?.uniform;
  if (!baselines.has(key)) {
    const entry = { value: shipped && shippedDraft(scene, shipped) };
    const asked = () => helper.ask({ type: "uniform", document: scene.document }).then(({ layout, score }) => new Draft(scene, layout, score));
    entry.promise = shipped ? scored(entry.value) : asked();
    entry.promise.then((value) => Object.assign(entry, { value, done: true }), () => { entry.done = true; });
    baselines.set(key, entry);
  }
  return baselines.get(key);
}

// promise of a draft with its score, which the worker computes if that takes long
const scored = async (made, by = helper) => {
  if (made.score === undefined) made.score = (await by.ask({ type: "score", document: made.scene.document, layout: made.layout })).score;
  return made;
};

// draft to race against; undefined if there is none
function otherOf(name) {
  const shipped = shippedOf(draft.scene), more = data.rows.find((r) => r.name === name);
  if (name === UNIFORM) return baseline(draft.scene).value;
  if (name === BEST) return bestOf(shipped);
  return name === KEPT ? kept : more && draftOf(more);
}

const draftOf = (entry) => (entry.draft ??= new Draft(new Scene(kernels, entry.document), makeLayout(entry.layout)));

const bestOf = (shipped) => shipped?.best && (shipped.draft ??= shippedDraft(new Scene(kernels, shipped.document), shipped.best));

// from the draft to the page -----------------------------------------------------------------------

function notify(text, kind = "") {
  $("message").textContent = text;
  $("message").className = `message ${kind}`;
}

function report(error) {
  if (!(error instanceof RangeError)) console.error(error);
  if (draft) settle();
  notify(error.message.replace(/(^|: )row\.(?=\w+ (=|is))/, "$1"), "error"); // the table of a scene's file
}

// draws row, result and curves; `glide` lets the dominoes move to new places
function draw(glide = false) {
  const { scene } = draft, name = $("against").value, other = otherOf(name), isStep = draft === steps[position];
  const known = baseline(scene).value, uniform = known?.score === undefined ? undefined : known;
  const waves = [draft.wave, ...(other ? [other.wave] : [])];
  row.show(waves, { designed: scene.count, stop: draft.stop, other: name, keepScale: !isStep && !search, glide });
  const x = [row.view.low, row.view.high], schedule = scene.tempo?.schedule;
  const sizes = (d, quantity) => {
    const { x: pivots } = pivotsOf(d.layout), t = d.layout.thickness;
    return quantity === "spacing"
      ? { x: [...d.layout.spacing].map((_, i) => 0.5 * (pivots[i] + pivots[i + 1] - t[i + 1])), y: [...d.layout.spacing].map((v) => MM * v) }
      : { x: [...t.slice(1)].map((v, i) => pivots[i + 1] - 0.5 * v), y: [...t.slice(1)].map((v) => MM * v) };
  };
  const both = (values) => [{ ...values(draft), colour: "result" }, ...(other ? [{ ...values(other), colour: "uniform" }] : [])];
  for (const quantity of ["spacing", "thickness"]) if (!$(quantity).hidden) {
    const series = both((d) => sizes(d, quantity)), scale = MM * (scene.inHeights ? draft.layout.height.reduce((a, b) => Math.max(a, b)) / scene.height : 1);
    series[0].points = true;
    curves[quantity].draw({ title: `${quantity === "spacing" ? "Gap" : "Thickness"} [mm]: drag the points`, x, y: rangeOf(scene[quantity].map((v) => scale * v)), series });
  }
  const speeds = both((d) => {
    const { x: pivots } = pivotsOf(d.wave.layout), t = d.wave.layout.thickness, times = d.wave.arrivalTimes;
    return schedule
      ? { x: [...pivots.slice(1)], y: [...times.slice(1)].map((v, i) => MM * (v - schedule[i])) }
      : { x: [...pivots.slice(1)].map((v, i) => 0.5 * (pivots[i] + v - t[i + 1])), y: [...d.wave.localSpeed] };
  });
  curves.speed.draw({ title: `${schedule ? "Lateness of each hit [ms]" : "Local speed [m/s]"} – grey: the other row`, x, y: rangeOf(speeds.flatMap((s) => s.y), 0), series: speeds, axis: "m" });
  [$("number").textContent, $("sentence").textContent] = draft.headline(uniform);
  $("details").textContent = draft.details(uniform, draft.isSlow ? undefined : bestOf(shippedOf(scene)));
  $("repair").hidden = draft.stop < 0;
}

// shows the present step of the history; slow computations run in the worker
function settle() {
  notify("");
  draft = steps[position];
  wanted = null;
  const { scene } = draft, shown = draft;
  $("title").textContent = scene.title;
  document.title = `Domino studio: ${scene.title}`;
  for (const control of controls) {
    const value = readControl(control, scene);
    control.box.hidden = value === null;
    if (control.word) control.input.checked = value; else control.input.value = value ?? "";
  }
  document.querySelectorAll("#controls details").forEach((group) => { group.hidden = !group.querySelector("label:not([hidden])"); });
  $("spacing").hidden = !scene.freeSpacing;
  $("thickness").hidden = !scene.freeThickness;
  $("undo").disabled = position === 0;
  $("redo").disabled = position === steps.length - 1;
  $("faster").textContent = "Make it faster";
  const names = [UNIFORM, ...(shippedOf(scene)?.best ? [BEST] : []), ...(kept ? [KEPT] : []), ...data.rows.map((r) => r.name)], before = $("against").value;
  $("against").replaceChildren(...names.map((name) => new Option(name, name, false, name === before)));
  keepAddress();
  const again = () => { if (draft === shown) draw(); };
  slow.end();
  Promise.all([scored(shown, slow), baseline(scene).promise]).then(again, (error) => { if (draft === shown) notify(error.message, "error"); });
  draw();
}

async function keepAddress() {
  const shown = draft, link = await makeLink(draft.scene.document, draft.layout);
  if (draft !== shown) return;
  try { history.replaceState(null, "", link ? `#${link}` : "#"); } catch { /* the page of a frame without an address */ }
  $("link").replaceChildren(link ? Object.assign(document.createElement("a"), { href: `#${link}`, textContent: "Link to this row", target: "_blank" }) : "The row is too long for a link: save layout and scene.");
}

// from the page to the draft -----------------------------------------------------------------------

// ends a search, calls a function, and shows the message of its error, if any
function attempt(action) {
  try {
    endSearch();
    return action();
  } catch (error) {
    report(error);
    return undefined;
  }
}

// shows the present step of the history with a change
function preview(change) {
  attempt(() => { draft = standing(change(steps[position])); draw(); });
}

// a draft whose dominoes can stand; else an error
function standing(made) {
  if (made.wave) return made;
  throw new RangeError("the row has no wave");
}

function commit(next = draft) {
  draft = standing(next);
  ticket += 1;
  if (search) { search = null; searcher.end(); }
  if (draft !== steps[position]) steps.splice(++position, steps.length, draft);
  settle();
}

const edit = (change) => attempt(() => commit(change(draft)));

// commits a draft that takes time, unless another one is committed before; `pending` is its promise
function commitLater(promise, words) {
  const mine = ++ticket, waiting = setTimeout(() => { if (mine === ticket) notify("computing the best equal gaps …"); }, 100);
  pending = promise.then((next) => {
    if (mine === ticket) { commit(next); if (words) notify(words); }
  }).catch((error) => {
    if (mine === ticket) report(error);
  }).finally(() => clearTimeout(waiting));
  return pending;
}

function checkSize(scene) {
  const count = scene.count + (scene.runOut?.count ?? 0);
  if (count > MOST) throw new RangeError(`scene '${scene.name}' has ${count.toLocaleString("en")} dominoes: give at most ${MOST.toLocaleString("en")}, as each is drawn`);
  if (!scene.freeSpacing && !scene.freeThickness && !scene.freeHeight) throw new RangeError(`scene '${scene.name}' leaves nothing free: give bounds for the gaps`);
  return scene;
}

const uniformDraft = async (scene) => {
  const { value, promise } = baseline(checkSize(scene));
  return value ?? promise;
};

// draft of a document, a layout, or both; a layout without a scene keeps the present one if it can
async function made({ document: tables, layout }) {
  if (!layout) return uniformDraft(new Scene(kernels, tables));
  const scene = tables ? new Scene(kernels, tables) : sceneFor(layout, draft?.scene, (document) => new Scene(kernels, document));
  if (scene.ground && !layout.rise) Object.assign(layout, scene.ground.riseAndTilt(layout));
  const violations = checkSize(scene).violations(layout);
  if (violations.length) throw new RangeError(`not a layout of scene '${scene.name}': ${violations.join("; ")}`);
  return new Draft(scene, layout);
}

const move = (by) => attempt(() => { ticket += 1; position = Math.min(Math.max(position + by, 0), steps.length - 1); settle(); });

async function openFiles(list) {
  const sounds = [...list].filter(isRecording);
  if (sounds.length) { await recordings.open(sounds); return; }
  endSearch();
  const names = [...list].map((file) => file.name).join(", "), contents = new Map();
  const opened = async () => {
    for (const file of list) contents.set(file.name, await file.arrayBuffer());
    const found = readFiles(contents, draft.scene.width);
    return made(found).catch((error) => withName(names, () => { throw error; }));
  };
  await commitLater(opened(), `opened ${names}`);
}

async function openAddress() {
  const text = decodeURIComponent(location.hash.slice(1)), [key, name] = text.split("=");
  if (key === "scene") {
    if (!data.scenes[name]) throw new RangeError(`scene = ${name}: choose one of ${Object.keys(data.scenes).join(", ")}`);
    return made({ document: data.scenes[name].document });
  }
  return key === "design" ? made(await readLink(text)) : null;
}

// settings -----------------------------------------------------------------------------------------

function readControl({ table, key, unit, word, optional }, scene) {
  const { document, physics, height, width, isReleased } = scene, defaults = { physics, row: { height, width } };
  const values = { ...defaults[table], ...document[table] }, value = values[key] ?? (optional ? 0 : null);
  if (word) return isReleased;
  // not the push of a released domino, a length in heights of a domino, nor the slope of a curve
  return value === null || (key === "push" && isReleased) || "of" in values || "profile" in values ? null : Number((unit * value).toPrecision(12));
}

function changeControl(control, value) {
  const { table, key, unit, word, optional } = control, scene = wanted ?? draft.scene;
  const tables = structuredClone(scene.tables), values = (tables[table] ??= {});
  if (word && !scene.isReleased) control.before = scene.physics.push;
  values[key] = word ? (value ? word : control.before ?? PUSH) : value / unit;
  if (optional && !value) delete values[key];
  if (key === "fixed") delete tables.row.first_thickness; // thickness, also of the first domino
  if (!Object.keys(values).length) delete tables[table];
  wanted = checkSize(new Scene(kernels, { ...tables, ...OWN }));
  for (const [name, entry] of baselines) if (!entry.done) baselines.delete(name);
  helper.end(); // of settings that are changed again
  commitLater(draft.isUniform ? uniformDraft(wanted) : Promise.resolve(draft.withScene(wanted)));
}

// friction and push of a measurement for the row that is shown
function usePhysics({ friction, push }) {
  const { scene } = draft, rounded = (value) => Number(value.toPrecision(4)), start = scene.isReleased ? "released" : rounded(push);
  commit(draft.withScene(scene.replaced({ physics: { friction: rounded(friction), push: start }, ...OWN })));
  notify(`friction ${rounded(friction)}, ${scene.isReleased ? "released" : `push ${start} rad/s`}`);
}

const controls = Object.entries(CONTROLS).flatMap(([title, entries]) => {
  const group = document.createElement("details"), fields = document.createElement("div");
  group.append(Object.assign(document.createElement("summary"), { textContent: title }), fields);
  fields.className = "fields";
  $("controls").append(group);
  return entries.map(([label, table, key, unit = MM, step = 0.1, optional = false]) => {
    const word = typeof unit === "string" ? unit : null, form = word ? { type: "checkbox" } : { type: "number", step: step === 1 ? 1 : "any" };
    const box = document.createElement("label"), input = Object.assign(document.createElement("input"), form);
    const control = { table, key, unit, word, optional, box, input };
    input.addEventListener("change", () => attempt(() => {
      if (word) { changeControl(control, input.checked); return; }
      if (input.value === "" || !Number.isFinite(input.valueAsNumber)) throw new RangeError(`${label}: give a number`);
      changeControl(control, input.valueAsNumber);
    }));
    box.append(...(word ? [input, ` ${label}`] : [`${label} `, input]));
    fields.append(box);
    return control;
  });
});

// in the background --------------------------------------------------------------------------------

function endSearch() {
  if (!search) return;
  commit(search.found ?? draft);
}

async function startSearch(thorough) {
  await pending;
  if (search) return;
  const { scene } = draft, first = draft, why = scene.whyNotSearched, base = baseline(scene).value;
  if (why) { notify(why); return; }
  const mine = (search = { score: first.score, found: null, gained: performance.now(), shown: 0 });
  $("faster").textContent = "Stop";
  notify("searching …");
  const show = ({ layout, score, seconds }) => {
    if (search !== mine) return;
    const now = performance.now();
    if (score > (mine.base ?? -1) * (1 + LEAST_GAIN)) Object.assign(mine, { gained: now, base: score });
    if (score <= mine.score) return;
    Object.assign(mine, { score, found: new Draft(scene, layout, score) });
    if (now < mine.shown + 100) return;
    mine.shown = now;
    draft = mine.found;
    draw(true);
    notify(`searching: ${seconds.toFixed(1)} s …`);
  };
  const limit = setInterval(() => { // the search ends by itself; otherwise when it gains no more
    if (search !== mine) clearInterval(limit);
    else if (!thorough && mine.base !== undefined && performance.now() > mine.gained + 1000 * PATIENCE) finish(`the last ${PATIENCE} s gained less than ${100 * LEAST_GAIN}%`);
  }, 100);
  const finish = (reason) => {
    if (search !== mine) return;
    clearInterval(limit);
    const isBetter = mine.found !== null, seconds = ((performance.now() - mine.began) / 1000).toFixed(1);
    endSearch();
    notify(`${isBetter ? "best row found" : "no better row was found"} in ${seconds} s: ${reason}`);
  };
  mine.began = performance.now();
  try {
    const done = await searcher.ask({ type: "search", document: scene.document, baseline: base && { layout: base.layout, score: base.score }, start: first.layout, seconds: thorough ? THOROUGH : SECONDS, seed: 0 }, show);
    if (search !== mine) return;
    if (done.score > mine.score) mine.found = new Draft(scene, done.layout, done.score);
    finish(done.reason);
  } catch (error) {
    if (search === mine) { clearInterval(limit); endSearch(); report(error); }
  }
}

async function checkRow() {
  const shown = draft;
  notify("placing the row 256 times, and letting it fall on a floor …");
  try {
    const { text } = await slow.ask({ type: "check", document: shown.scene.document, layout: shown.layout });
    if (draft === shown) notify(text);
  } catch (error) {
    if (draft === shown) report(error);
  }
}

// to the table -------------------------------------------------------------------------------------

function fillPaper() {
  $("papersize").textContent = ""; // nothing of an earlier row is printed after an error
  $("paper-pages").replaceChildren();
  const name = $("against").value, other = $("both").checked ? otherOf(name) : null;
  if (other === undefined) throw new RangeError(`${name} are being computed: print again in a moment`);
  const entry = (label, d) => ({ name: label, layout: d.wave.layout, designed: d.scene.count, start: d.scene.isReleased ? "tip slowly" : "push" });
  const pages = printPages([entry("your row", draft), ...(other ? [entry(name, other)] : [])], {
    paper: $("paper").value, roll: $("roll").valueAsNumber, safety: $("safety").valueAsNumber, title: draft.scene.title,
  });
  $("papersize").textContent = `@page { size: ${pages[0].width}mm ${pages[0].height}mm; margin: 0 }`;
  $("paper-pages").innerHTML = pages.map((page) => page.svg).join("");
}

const saveStrip = () => save("strip.svg", stripSvg(draft.wave.layout, { tolerance: $("tolerance").valueAsNumber, piece: $("piece").valueAsNumber, safety: $("safety").valueAsNumber }), "image/svg+xml");

// pictures of the shipped scenes half-way through their fall, each a link that opens it
function fillGallery() {
  $("gallery").replaceChildren(...Object.entries(data.scenes).map(([name, { document: tables, best, uniform }]) => {
    const scene = new Scene(kernels, tables), { wave } = shippedDraft(scene, best ?? uniform);
    const last = Math.min(wave.hit, DRAWN) - 1, leans = kernels.motion(wave).leans(0.5 * wave.arrivalTimes[last]), pivots = pivotsOf(wave.layout);
    const points = Array.from({ length: last + 1 }, (_, i) => corners(wave.layout, pivots, i, leans[i]).map(([x, z]) => [MM * x, -MM * z]));
    const [xs, zs] = [0, 1].map((k) => points.flat().map((p) => p[k])), low = [Math.min(...xs), Math.min(...zs)];
    const path = points.map((four) => `M${four.map((p) => p.map(Math.round).join()).join(" ")}z`).join("");
    const link = document.createElement("a");
    link.href = `#scene=${name}`;
    link.innerHTML = `<svg viewBox="${low.map(Math.round).join(" ")} ${Math.round(Math.max(...xs) - low[0])} ${Math.round(Math.max(...zs) - low[1])}"><path d="${path}"/></svg>`;
    link.append(Object.assign(document.createElement("b"), { textContent: name }), ` ${scene.title}`);
    return link;
  }));
}

// the page -----------------------------------------------------------------------------------------

function listen() {
  const click = (id, action) => $(id).addEventListener("click", action);
  click("faster", () => { if (search) { endSearch(); notify("stopped; this is the best so far"); } else startSearch(false); });
  click("thorough", () => attempt(() => startSearch(true)));
  click("undo", () => move(-1));
  click("redo", () => move(1));
  click("equal", () => attempt(() => commitLater(uniformDraft(draft.scene))));
  click("repair", () => attempt(() => commitLater(baseline(draft.scene).promise.then(({ layout }) => {
    const gap = Math.min(draft.stop, draft.scene.count - 2);
    return draft.withSize("spacing", gap, layout.spacing[gap]);
  }))));
  click("check", () => attempt(checkRow));
  click("keep", () => attempt(() => { kept = draft; settle(); $("against").value = KEPT; draw(); }));
  click("print", () => attempt(() => { fillPaper(); window.print(); }));
  click("strip", () => attempt(saveStrip));
  click("csv", () => save("layout.csv", layoutCsv(draft.layout), "text/csv"));
  click("json", () => save("layout.json", layoutJson(draft.layout), "application/json"));
  click("toml", () => save("scene.toml", documentToml(draft.scene.document), "application/toml"));
  $("against").addEventListener("change", () => draw());
  $("pace").addEventListener("change", (e) => row.setPace(Number(e.target.value)));
  $("sound").addEventListener("change", (e) => row.setSound(e.target.checked));
  $("paper").addEventListener("change", () => { $("rollbox").hidden = $("paper").value !== "roll"; });
  $("files").addEventListener("change", async (e) => { await openFiles(e.target.files); e.target.value = ""; });
  $("scenes").addEventListener("toggle", () => { if (!$("gallery").childElementCount) fillGallery(); });
  window.addEventListener("beforeprint", () => attempt(fillPaper));
  window.addEventListener("hashchange", () => attempt(() => commitLater(openAddress().then((next) => next ?? draft))));
  document.addEventListener("keydown", (e) => {
    if (!(e.ctrlKey || e.metaKey) || e.key.toLowerCase() !== "z" || e.target.matches("input[type=number]")) return;
    e.preventDefault();
    move(e.shiftKey ? 1 : -1);
  });
  for (const link of document.querySelectorAll("[data-opens]")) link.addEventListener("click", (e) => {
    e.preventDefault();
    const fold = [...document.querySelectorAll("details")].find((d) => d.firstElementChild.textContent === link.dataset.opens);
    fold.open = true;
    fold.scrollIntoView({ behavior: "smooth" });
    fold.querySelector("input, select").focus({ preventScroll: true });
  });
  const over = (on, act = () => {}) => (e) => { // text may be dropped into a field
    if (![...e.dataTransfer.types].includes("Files")) return;
    e.preventDefault();
    $("drop").hidden = !on;
    act(e.dataTransfer.files);
  };
  document.addEventListener("dragover", over(true));
  document.addEventListener("dragleave", (e) => { if (!e.relatedTarget) over(false)(e); });
  document.addEventListener("drop", over(false, openFiles));
}

async function start() {
  bytes = await unpack($("wasm").textContent);
  kernels = await loadKernels(bytes);
  row = createRow($("row"), kernels, {
    drag: (index, shift, following) => preview((d) => d.withShift(index, shift, following)),
    commit: () => attempt(commit),
    insert: (gap) => edit((d) => d.withDomino(gap)),
    remove: (index) => edit((d) => d.withoutDomino(index)),
    touch: (chosen) => {
      endSearch();
      if (chosen !== undefined) notify(`domino ${chosen + 1} of ${draft.scene.count}`);
    },
    moved: (x) => curves?.speed.point(x),
  });
  const drags = (quantity) => ({ drag: (index, value) => preview((d) => d.withSize(quantity, index, value / MM)), commit: () => attempt(commit), unit: "mm" });
  curves = { spacing: createCurves($("spacing"), "Gaps along the row", drags("spacing")), thickness: createCurves($("thickness"), "Thicknesses along the row", drags("thickness")), speed: createCurves($("speed"), "Local speed along the row") };
  recordings = createRecordings($, () => ({ document: draft.scene.document, layout: draft.layout }), (recording) => listener.ask({ type: "measure", ...recording }), (result) => attempt(() => usePhysics(result)));
  listen();
  const first = { document: data.first.document, layout: data.first.layout && makeLayout(data.first.layout) };
  let next = null, message = "";
  try { next = await openAddress(); } catch (error) { message = error.message; }
  if (!next) notify("computing the best equal gaps …");
  try { next ??= await made(first); } catch (error) { message = error.message; }
  commit(next ?? (await made({ document: data.scenes.course.document })));
  if (message) notify(message, "error");
  if (data.headline) showReport($("runs"), data, draftOf);
}

/** Console of the page, see `About this page`. */
window.domino = {
  ready: start().catch((error) => { console.error(error); notify(error.message, "error"); throw error; }),
  simulate({ friction = 0.25, gravity = 9.81, push = 8, ...layout }) {
    const { outcome, arrivalTimes, meanSpeed, errorEstimate } = kernels.simulate(makeLayout(layout), { friction, gravity, push });
    return { outcome, arrivalTimes: [...arrivalTimes], meanSpeed, errorEstimate };
  },
  async search(name, { seconds = 5, seed = 0 } = {}) {
    if (!data.scenes[name]) throw new RangeError(`scene = ${name}: choose one of ${Object.keys(data.scenes).join(", ")}`);
    const scene = new Scene(kernels, data.scenes[name].document), worker = createWorker();
    const { layout, score } = await worker.ask({ type: "search", document: scene.document, seconds, seed }, () => {}).finally(worker.close);
    scene.baseline = await baseline(scene).promise;
    return { score, gain: scene.gain(score), spacing: [...layout.spacing], thickness: [...layout.thickness] };
  },
  layout: () => plain(draft.layout),
  async open(layout) {
    endSearch();
    commit(await made({ layout: makeLayout(layout) }));
  },
  get state() { return { draft, row, curves, search }; },
};
