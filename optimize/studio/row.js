// Row of dominoes on a canvas: dragged, pushed, raced and heard. Times in s, lengths in m, screen in pixels.

import { groundLine, pivotsOf } from "./geometry.js";
import { positions } from "./kernels.js";

/** Margins of the row and of the curves at the left [px]. */
export const LEFT = 48;
/** Margin at the right [px]. */
export const RIGHT = 12;
const SKY = 52, FOOT = 12, MAP = 26; // [px] above and below the row, and for the map of long rows
const SMALLEST = 26, REACH = 9, STILL = 4; // [px] height of a domino in view; distances of the pointer
const BEHIND = 0.8, BEYOND = 1.2; // [tallest domino] before the first pivot, and ahead of the last one
const SOON = 0.1; // [s] in which clicks are scheduled
const GLIDE = 250; // [ms] in which dominoes move to new places during a search
const TIE = 5e-4; // [s] smaller differences are a tie

/** Colour of the page by its name in page.css, such as "ink". */
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/** Result of a race in words. */
export function verdict(own, other, name) {
  for (const [wave, words] of [[own, "yours stops"], [other, `${name}: the wave stops`]]) if (wave.outcome !== "PROPAGATED") return words;
  const end = (row) => positions(row.layout).at(-1);
  const earlier = other.arrivalTimes.at(-1) - own.arrivalTimes.at(-1), longer = 1000 * (end(own) - end(other));
  let words = Math.abs(earlier) < TIE ? `at the same time as ${name}` : `${Math.abs(earlier).toFixed(3)} s ${earlier > 0 ? "earlier" : "later"} than ${name}`;
  if (Math.abs(longer) >= 1) words += `; the row is ${Math.abs(longer).toFixed(0)} mm ${longer > 0 ? "longer" : "shorter"}`;
  return words;
}

/** Corners of domino i with a lean, [x, z] in metres: front bottom edge, top front, top rear, bottom rear. */
export function corners(layout, pivots, i, lean) {
  const s = Math.sin(lean), c = Math.cos(lean), x = pivots.x[i], z = pivots.z[i], h = layout.height[i], d = layout.thickness[i];
  return [[x, z], [x + h * s, z + h * c], [x + h * s - d * c, z + h * c + d * s], [x - d * c, z + d * s]];
}

/**
 * Show rows on a canvas.
 * @param {HTMLCanvasElement} canvas
 * @param {object} kernels for the motion of a wave
 * @param {object} act functions `drag(index, shift, following)`, `commit()`, `insert(gap)`, `remove(index)`, `touch(chosen)`
 *   and `moved(position)`, which is called with the position of the wave [m], null for none
 * @returns {object} `show(waves, options)`, `push()`, `setPace(pace)`, `setSound(on)`, and `view`, the range of x
 */
export function createRow(canvas, kernels, act) {
  const pen = canvas.getContext("2d");
  let rows = [], own, options = {}, view = {}, shift = 0, colours = {};
  let now = 0, playing = false, last = null, clicked = 0, pace = 0.25, sounds = true;
  let grip = null, glide = null, chosen = -1, frame = 0, audio = null, click = null;
  const runs = () => now > 0;
  const end = () => Math.max(...rows.map((row) => row.motion.end));

  function rowOf(wave) {
    let motion; // computed when it is first needed
    return {
      wave, layout: wave.layout, ...pivotsOf(wave.layout), line: groundLine(wave.layout), hit: wave.hit, arrivals: wave.arrivalTimes,
      get motion() { return (motion ??= kernels.motion(wave)); },
    };
  }

  function show(waves, given) {
    rows = waves.map((wave) => rows.find((row) => row.wave === wave) ?? rowOf(wave));
    const isNew = own?.wave !== rows[0].wave, before = own && shown(own);
    [own] = rows;
    options = given;
    if (isNew) glide = given.glide && before.length === own.x.length ? { from: before, began: performance.now() } : null;
    if (isNew) { playing = false; now = 0; act.moved(null); }
    if (chosen >= options.designed) chosen = -1;
    resize();
  }

  // chooses the scale; a row too long for the width is followed, with a map of the whole below it
  function resize() {
    if (!canvas.clientWidth || !own) return;
    colours = Object.fromEntries(["ink", "soft", "line", "fallen", "leader", "ghost", "chosen"].map((name) => [name, colour(name)]));
    const tallest = Math.max(...rows.map((row) => row.layout.height.reduce((a, b) => Math.max(a, b))));
    const bottom = Math.min(...rows.map((row) => row.z.reduce((a, b) => Math.min(a, b))));
    const top = Math.max(...rows.map((row) => row.z.reduce((a, b) => Math.max(a, b)))) + tallest;
    let { low, high } = view;
    if (!options.keepScale || low === undefined) [low, high] = [-BEHIND * tallest, Math.max(...rows.map((row) => row.x.at(-1))) + BEYOND * tallest];
    const heights = [...own.layout.height].sort((a, b) => a - b), ratio = devicePixelRatio || 1;
    const width = canvas.clientWidth - LEFT - RIGHT, fit = width / (high - low);
    const k = Math.min(Math.max(fit, SMALLEST / heights[heights.length >> 1]), (0.45 * innerHeight - SKY) / (top - bottom));
    const follows = k > 1.02 * fit, foot = FOOT + (follows ? MAP : 0);
    const height = Math.max(0.2 * innerHeight, SKY + k * (top - bottom) + foot);
    view = { k, fit, follows, height, width, low, high, bottom, ratio, floor: height - foot };
    canvas.style.height = `${height}px`;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(height * ratio);
    pan(shift);
  }
  function pan(to) {
    shift = view.follows ? Math.min(Math.max(to, 0), view.high - view.low - view.width / view.k) : 0;
    draw();
  }
  // positions of the dominoes on the screen [m], which glide to those of a new layout
  function shown(row) {
    const done = glide && row === own ? (performance.now() - glide.began) / GLIDE : 1;
    if (done >= 1) return row.x;
    return row.x.map((x, i) => x + (1 - done) ** 2 * (glide.from[i] - x));
  }
  const px = (x) => LEFT + (x - view.low - shift) * view.k;
  const pz = (z) => view.floor - (z - view.bottom) * view.k;

  // x of the wave at the present time, between the pivots of two hits
  function place(row) {
    const n = row.motion.leader(now).domino, next = row.arrivals[n + 1];
    if (!Number.isFinite(next)) return row.x[n];
    const fraction = Math.min(Math.max((now - row.arrivals[n]) / (next - row.arrivals[n]), 0), 1);
    return row.x[n] + fraction * (row.x[n + 1] - row.x[n]);
  }

  function draw() {
    const width = canvas.clientWidth;
    pen.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    pen.clearRect(0, 0, width, view.height);
    pen.strokeStyle = colours.soft;
    pen.beginPath(); own.line.forEach(([x, z]) => pen.lineTo(px(x), pz(z))); pen.stroke();
    for (const row of [...rows].reverse()) drawRow(row, row !== own, width);
    const top = (i) => pz(own.z[i] + own.layout.height[i]) - 4;
    if (options.stop >= 0) write("▼", px(own.x[options.stop]), top(options.stop), colours.leader, "center");
    if (!runs()) write("▶", px(-own.layout.thickness[0]) - 6, top(0) + 20, colours.leader, "right");
    caption(width);
    map();
  }
  function drawRow(row, ghost, width) {
    const first = runs() ? row.motion.leader(now).domino : -1, leans = runs() ? row.motion.leans(now) : null, up = ghost ? 5 : 0;
    const pivots = { x: shown(row), z: row.z };
    if (pivots.x !== row.x) requestAnimationFrame(draw);
    for (let i = 0; i < row.x.length; i++) {
      const u = px(pivots.x[i]), h = row.layout.height[i] * view.k;
      if (u < -2 * h || u > width + 2 * h) continue;
      const standing = i >= options.designed ? colours.soft : i === chosen ? colours.chosen : colours.ink;
      pen.fillStyle = ghost ? colours.ghost : i < first ? colours.fallen : i === first ? colours.leader : standing;
      pen.beginPath();
      for (const [x, z] of corners(row.layout, pivots, i, leans?.[i] ?? row.layout.tilt?.[i] ?? 0)) pen.lineTo(px(x), pz(z) - up);
      pen.closePath(); pen.fill();
    }
    const finish = px(row.x.at(-1));
    pen.strokeStyle = ghost ? colours.ghost : colours.ink; pen.setLineDash([4, 4]);
    pen.beginPath(); pen.moveTo(finish, pz(row.z.at(-1)) + 6); pen.lineTo(finish, SKY - 8); pen.stroke(); pen.setLineDash([]);
  }
  function write(text, x, y, fill, align = "left") {
    pen.fillStyle = fill; pen.textAlign = align; pen.font = "14px system-ui, sans-serif";
    pen.fillText(text, x, y, canvas.clientWidth - 24);
  }
  function caption(width) { // times of the race: running, and frozen at the finish
    const time = (row) => {
      const t = row.arrivals.at(-1);
      return Number.isFinite(t) && now >= t ? `${t.toFixed(3)} s` : now >= row.motion.end ? "stops" : `${now.toFixed(2)} s …`;
    };
    write(runs() ? `yours ${time(own)}` : "Click the first domino to push the row.", 12, 18, colours.ink);
    if (runs() && rows[1]) write(`${options.other} ${time(rows[1])}`, 142, 18, colours.soft);
    const hint = width < 700 ? "Drag the others. Double tap: one more." : "Drag the others (with Shift: and all ahead). Double click: one more; Delete: one less.";
    const result = rows[1] ? verdict(own.wave, rows[1].wave, options.other) : "";
    write(!runs() ? hint : now >= end() ? result : "", 12, 38, runs() ? colours.ink : colours.soft);
  }
  function map() { // the whole row as a line, the part in view as a box, the wave as a dot
    if (!view.follows) return;
    const y = view.height - 12, x = (p) => LEFT + (p - view.low) * view.fit;
    pen.fillStyle = colours.line; pen.fillRect(x(0), y, own.x.at(-1) * view.fit, 6);
    pen.strokeStyle = colours.ink; pen.strokeRect(x(view.low + shift), y - 4, (view.width / view.k) * view.fit, 14);
    if (runs()) { pen.fillStyle = colours.leader; pen.fillRect(x(place(own)) - 2, y - 4, 4, 14); }
  }

  // play
  function push() {
    act.touch();
    now = 0; clicked = 0; play(true);
  }
  function play(on) {
    playing = on; last = null;
    if (on && sounds && window.AudioContext) { audio ??= new AudioContext(); audio.resume(); }
    cancelAnimationFrame(frame);
    if (on) frame = requestAnimationFrame(tick);
  }
  function tick(stamp) {
    if (!playing) return;
    if (last !== null) now = Math.min(now + Math.min((stamp - last) / 1000, 0.1) * pace, end()); // a stall is no leap
    last = stamp;
    sound();
    pan(place(own) - view.low - (0.6 * view.width) / view.k);
    act.moved(place(own));
    playing = now < end();
    if (playing) frame = requestAnimationFrame(tick);
  }
  function sound() { // one node for each hit, at its time
    if (!audio || !sounds) return;
    if (!click) { // a damped sine
      click = audio.createBuffer(1, 0.02 * audio.sampleRate, audio.sampleRate);
      click.getChannelData(0).forEach((_, i, data) => { const t = i / audio.sampleRate; data[i] = 0.5 * Math.sin(2 * Math.PI * 3200 * t) * Math.exp(-t / 0.0012); });
    }
    for (; clicked + 1 < own.hit && own.arrivals[clicked + 1] < now + SOON * pace; clicked++) {
      const node = audio.createBufferSource();
      node.buffer = click; node.connect(audio.destination);
      node.start(audio.currentTime + Math.max(own.arrivals[clicked + 1] - now, 0) / pace);
    }
  }

  // changes by hand
  function find(e) { // index of the domino under the pointer, or -1
    let near = -1, least = e.pointerType === "touch" ? 2 * REACH : REACH;
    if (Math.abs(e.offsetX - px(0) + 18) < 18 && e.offsetY > SKY && e.offsetY < view.floor) return 0; // ▶
    for (let i = 0; i < options.designed; i++) {
      const d = own.layout.thickness[i] * view.k, distance = Math.max(Math.abs(e.offsetX - px(own.x[i]) + 0.5 * d) - 0.5 * d, 0);
      const above = pz(own.z[i]) - e.offsetY;
      if (distance < least && above > -REACH && above < own.layout.height[i] * view.k + REACH) [near, least] = [i, distance];
    }
    return near;
  }
  canvas.addEventListener("pointerdown", (e) => {
    if (grip || !e.isPrimary || e.button) return;
    const onMap = view.follows && e.offsetY > view.floor + FOOT;
    if (onMap) { playing = false; pan((e.offsetX - LEFT) / view.fit - (0.5 * view.width) / view.k); }
    grip = { i: onMap ? -1 : find(e), scale: onMap ? view.fit : -view.k, x: e.clientX, shift, moved: false };
    canvas.setPointerCapture(e.pointerId);
  });
  canvas.addEventListener("pointermove", (e) => {
    if (grip && !e.buttons) release(); // its end was not seen
    if (!grip) { canvas.style.cursor = ["grab", "pointer", "ew-resize"][Math.sign(find(e)) + 1]; return; }
    const by = e.clientX - grip.x;
    if (Math.abs(by) < STILL && !grip.moved) return;
    grip.moved = true;
    if (grip.i < 1) { pan(grip.shift + by / grip.scale); return; }
    chosen = grip.i; playing = false; now = 0; act.moved(null);
    act.drag(grip.i, by / view.k, e.shiftKey);
  });
  function release() {
    if (grip?.moved && grip.i > 0) act.commit();
    grip = null;
  }
  canvas.addEventListener("pointerup", () => {
    if (grip?.i === 0 && !grip.moved) push();
    else if (grip && !grip.moved) { chosen = grip.i; act.touch(chosen); draw(); }
    release();
  });
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("dblclick", (e) => {
    const gap = own.x.findIndex((p, i) => i + 1 < options.designed && px(p) <= e.offsetX && e.offsetX < px(own.x[i + 1]));
    if (gap >= 0 && e.offsetY > SKY && e.offsetY < view.floor + FOOT) act.insert(gap);
  });
  document.addEventListener("keydown", (e) => { // anywhere on the page but in a control
    if (![canvas, document.body].includes(e.target) || e.altKey || e.ctrlKey || e.metaKey) return;
    const next = { ArrowLeft: -1, ArrowRight: 1 }[e.key], step = { ArrowUp: 0.0005, ArrowDown: -0.0005 }[e.key];
    if (e.key === " ") { if (playing || (runs() && now < end())) play(!playing); else push(); }
    else if (["Delete", "Backspace"].includes(e.key) && chosen > 0) { act.remove(chosen); chosen = -1; }
    else if (next) { chosen = Math.min(Math.max(chosen + next, 0), options.designed - 1); act.touch(chosen); draw(); }
    else if (step && chosen > 0) { act.drag(chosen, step, e.shiftKey); act.commit(); }
    else if (e.key === "Escape") { chosen = -1; draw(); }
    else return;
    e.preventDefault();
  });
  new ResizeObserver(resize).observe(canvas.parentElement);
  window.addEventListener("resize", resize); // also of the height
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", resize);
  return {
    show, push, resize,
    setPace(value) { pace = value; },
    setSound(on) { sounds = on; },
    get view() { return view; },
    get state() { return { now, playing, end: own ? end() : 0, chosen, px, pz, own, other: options.other }; },
  };
}
