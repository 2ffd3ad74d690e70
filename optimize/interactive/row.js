// Row of dominoes on a canvas: it is dragged, pushed and heard here, without the server.
// motion.js, which is loaded before it, computes the leans. Times in s, lengths in m, screen in pixels.
const LEFT = 48, RIGHT = 12, SKY = 34, MAP = 26; // margins; those at the sides are the plots'
const SMALLEST = 26, REACH = 9, STILL = 4; // height of a domino in view; distances of the pointer
const EASE = 120, AHEAD = 0.1; // [ms] of a movement to new places; [s] in which clicks are scheduled
const COLOURS = { ink: "#1d2126", soft: "#5c636d", line: "#c9ced4", fallen: "#0b6e99", leader: "#d55e00",
  ghost: "#b4bac2", chosen: "#e69f00" };

export function render({ model, el }) {
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  canvas.tabIndex = 0;
  canvas.style.cssText = "display:block;width:100%;touch-action:pan-y;cursor:grab;outline-offset:-2px";
  canvas.setAttribute("role", "application");
  canvas.setAttribute("aria-label", "Row of dominoes. Space pushes the first one. Drag a domino to move it.");
  el.append(canvas);
  let rows = [], state = {}, shown = [], view = {}, shift = 0, base = 0; // base: y of the lowest pivot; shown: x of own dominoes, on their way to new places
  let now = 0, playing = false, wanted = false, last = null, clicked = 0; // `wanted`: push when motion arrives
  let grip = null, chosen = -1, frame = 0, audio = null, click = null;
  const send = (name, ...values) => model.send_msg([name, ...values]);
  const moves = () => rows.length && rows.every((row) => row.falls);
  const end = () => Math.max(...rows.map((row) => row.end));
  const edge = (row) => row.ground.x[row.ground.x.length - 1];

  // chooses the scale; a row too long for the width is followed, with a map of the whole below it
  function resize() {
    if (!rows.length || !el.clientWidth) return;
    const width = el.clientWidth - LEFT - RIGHT, { low, high, bottom, top } = state.extent;
    const fit = width / (high - low), heights = [...rows[0].height].sort((a, b) => a - b);
    const most = 0.45 * innerHeight - SKY, middle = heights[heights.length >> 1];
    let k = Math.min(fit, most / (top - bottom));
    if (k * middle < SMALLEST && edge(rows[0]) > 12 * middle) k = Math.min(SMALLEST / middle, 160 / heights.at(-1));
    const follows = k > 1.02 * fit, room = Math.min(k * (top - bottom), most);
    const height = Math.max(0.2 * innerHeight, SKY + room + (follows ? MAP : 0) + 12), ratio = devicePixelRatio || 1;
    view = { k, fit, follows, room, height, width, low, high, ratio };
    canvas.style.height = height + "px";
    canvas.width = Math.round(el.clientWidth * ratio);
    canvas.height = Math.round(height * ratio);
    pan(shift);
  }
  function pan(to) { shift = view.follows ? Math.min(Math.max(to, 0), view.high - view.low - view.width / view.k) : 0; }
  const px = (x) => LEFT + (x - view.low - shift) * view.k;
  const pz = (z) => base - (z - state.extent.bottom) * view.k;
  function floor() { // a high relief is followed as well
    const foot = view.height - 10 - (view.follows ? MAP : 0);
    const { bottom, top } = state.extent, excess = view.k * (top - bottom) - view.room;
    return excess <= 0 ? foot : foot + Math.min(Math.max((height(place()) - bottom) * view.k - 0.4 * view.room, 0), excess);
  }
  const height = (x) => { const g = rows[0].ground, i = g.x.findIndex((p) => p >= x); return g.z[i < 0 ? g.z.length - 1 : i]; };
  const place = () => (moves() && now > 0 ? wavePosition(rows[0], now) : view.low + shift + 0.5 * view.width / view.k);

  function domino(row, i, x, lean, up) {
    const h = row.height[i] * view.k, d = row.thickness[i] * view.k, s = Math.sin(lean), c = Math.cos(lean);
    const u = px(x), v = pz(row.ground.z[i]) - up;
    if (u < -2 * h || u - d > el.clientWidth + 2 * h) return;
    pen.beginPath();
    for (const [a, b] of [[0, 0], [h, 0], [h, d], [0, d]]) pen.lineTo(u + a * s - b * c, v - a * c - b * s);
    pen.closePath(); pen.fill();
  }

  function draw() {
    if (!rows.length || !view.k) return;
    pen.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    pen.clearRect(0, 0, el.clientWidth, view.height);
    if (view.follows && playing) pan(wavePosition(rows[0], now) - view.low - 0.6 * view.width / view.k);
    base = floor();
    pen.lineWidth = 1;
    pen.strokeStyle = COLOURS.soft;
    pen.beginPath(); rows[0].ground.line.forEach(([x, z]) => pen.lineTo(px(x), pz(z))); pen.stroke();
    for (let r = rows.length - 1; r >= 0; r--) {
      const row = rows[r], up = r ? 5 : 0, fallen = moves() && now > 0, all = fallen ? leans(row, now) : row.ground.tilt;
      const first = fallen ? leader(row, now)[0] : -1, x = r ? row.ground.x : shown;
      all.forEach((lean, i) => {
        const own = i > state.designed - 1 ? COLOURS.soft : i === chosen ? COLOURS.chosen : COLOURS.ink;
        pen.fillStyle = r ? COLOURS.ghost : i < first ? COLOURS.fallen : i === first ? COLOURS.leader : own;
        domino(row, i, x[i], lean, up);
      });
      const finish = px(edge(row));
      pen.strokeStyle = r ? COLOURS.ghost : COLOURS.ink; pen.setLineDash([4, 4]);
      pen.beginPath(); pen.moveTo(finish, pz(row.ground.z.at(-1)) + 6); pen.lineTo(finish, SKY - 8); pen.stroke(); pen.setLineDash([]);
    }
    if (state.stop >= 0) write("▼", px(rows[0].ground.x[state.stop]), pz(rows[0].ground.z[state.stop] + rows[0].height[state.stop]) - 4, COLOURS.leader, "center");
    if (!now && moves()) write("▶", px(shown[0] - rows[0].thickness[0]) - 6, pz(rows[0].ground.z[0] + 0.7 * rows[0].height[0]), COLOURS.leader, "right");
    caption(); map(); pointer();
  }
  function write(text, x, y, colour, align = "left") { pen.fillStyle = colour; pen.textAlign = align; pen.font = "14px system-ui, sans-serif"; pen.fillText(text, x, y); }
  function caption() { // times of the race: running, and frozen at the finish
    const time = (row) => {
      const t = row.arrivals.at(-1);
      return t != null && now >= t ? `${t.toFixed(3)} s` : now >= row.end ? "stops" : `${now.toFixed(2)} s …`;
    };
    const narrow = el.clientWidth < 700;
    if (!moves() || now <= 0) write("Click the first domino to push the row. " + (narrow ? "" :
      "Drag the others (with Shift: and all ahead). Double click: one more; Delete: one less."), 12, 18, COLOURS.ink);
    else {
      write(`yours ${time(rows[0])}`, 12, 18, COLOURS.fallen);
      if (rows[1]) write(`${state.rival} ${time(rows[1])}`, 142, 18, COLOURS.soft);
      if (now >= end()) write(state.verdict, narrow ? 12 : el.clientWidth - 12, narrow ? 38 : 18, COLOURS.ink, narrow ? "left" : "right");
    }
  }
  function map() { // the whole row as a line, the part in view as a box, the wave as a dot
    if (!view.follows) return;
    const y = view.height - 12, x = (p) => LEFT + (p - view.low) * view.fit;
    pen.fillStyle = COLOURS.line; pen.fillRect(x(0), y, edge(rows[0]) * view.fit, 6);
    pen.strokeStyle = COLOURS.ink; pen.strokeRect(x(view.low + shift), y - 4, view.width / view.k * view.fit, 14);
    if (moves() && now > 0) { pen.fillStyle = COLOURS.leader; pen.fillRect(x(wavePosition(rows[0], now)) - 2, y - 4, 4, 14); }
  }
  function pointer() { // on the curve of the local speed
    const span = window.Bokeh?.documents.map((d) => d.get_model_by_name("pointer")).find(Boolean);
    if (span) Object.assign(span, { location: moves() && now > 0 ? wavePosition(rows[0], now) : view.low - 1, visible: moves() && now > 0 });
  }

  // play
  function push() {
    if (!moves()) { wanted = true; send("stop"); return; }
    now = 0; clicked = 0; play(true);
  }
  function play(on) {
    playing = on; last = null;
    if (on && model.sound && window.AudioContext) { audio ??= new AudioContext(); audio.resume(); }
    cancelAnimationFrame(frame);
    if (on) frame = requestAnimationFrame(tick);
  }
  function tick(stamp) {
    if (!playing || !canvas.isConnected) return;
    if (last !== null) now += Math.min(stamp - last, 100) / 1000 * model.pace; // a stall is no leap
    last = stamp;
    sound();
    if (now >= end()) { now = end(); playing = false; }
    draw();
    if (playing) frame = requestAnimationFrame(tick);
  }
  function sound() { // one node for each hit, at its time
    if (!audio || !model.sound) return;
    if (!click) { // a damped sine
      click = audio.createBuffer(1, 0.02 * audio.sampleRate, audio.sampleRate);
      click.getChannelData(0).forEach((_, i, data) => { const t = i / audio.sampleRate; data[i] = 0.5 * Math.sin(2 * Math.PI * 3200 * t) * Math.exp(-t / 0.0012); });
    }
    const hits = rows[0].arrivals;
    for (; clicked + 1 < rows[0].hit && hits[clicked + 1] < now + AHEAD * model.pace; clicked++) {
      const node = audio.createBufferSource();
      node.buffer = click; node.connect(audio.destination);
      node.start(audio.currentTime + Math.max(hits[clicked + 1] - now, 0) / model.pace);
    }
  }
  function rest() { playing = false; now = 0; draw(); }

  // changes by hand
  function find(e) { // index of the domino under the pointer, or -1
    let near = -1, least = Infinity;
    if (Math.abs(e.offsetX - px(shown[0]) + 18) < 18 && e.offsetY > SKY && e.offsetY < view.height - MAP) return 0; // ▶
    for (let i = 0; i < state.designed; i++) {
      const d = rows[0].thickness[i] * view.k, distance = Math.max(Math.abs(e.offsetX - px(shown[i]) + 0.5 * d) - 0.5 * d, 0);
      const above = pz(rows[0].ground.z[i]) - e.offsetY;
      if (distance < least && above > -REACH && above < rows[0].height[i] * view.k + REACH) [near, least] = [i, distance];
    }
    return least <= REACH ? near : -1;
  }
  canvas.addEventListener("pointerdown", (e) => {
    if (grip || !e.isPrimary || e.button || !rows.length) return;
    const i = find(e), onMap = view.follows && e.offsetY > view.height - MAP;
    grip = { i: onMap ? -1 : i, onMap, x: e.clientX, shift, moved: false };
    canvas.setPointerCapture(e.pointerId);
    if (onMap) { playing = false; pan((e.offsetX - LEFT) / view.fit - 0.5 * view.width / view.k); draw(); }
  });
  canvas.addEventListener("pointermove", (e) => {
    if (grip && !e.buttons) release(); // its end was not seen
    if (!grip) { canvas.style.cursor = rows.length ? ["grab", "pointer", "ew-resize"][Math.sign(find(e)) + 1] : ""; return; }
    const by = e.clientX - grip.x;
    if (Math.abs(by) < STILL && !grip.moved) return;
    if (!grip.moved && grip.i > 0) { rest(); chosen = grip.i; }
    grip.moved = true;
    if (grip.onMap) { pan(grip.shift + by / view.fit); draw(); }
    else if (grip.i > 0) send("drag", grip.i, by / view.k, e.shiftKey);
    else { pan(grip.shift - by / view.k); draw(); }
  });
  function release() { if (grip?.moved && grip.i > 0) send("drop"); grip = null; }
  canvas.addEventListener("pointerup", () => {
    if (grip?.i === 0 && !grip.moved) push();
    else if (grip && !grip.moved && !grip.onMap) { chosen = grip.i; draw(); }
    release();
  });
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("dblclick", (e) => {
    if (e.offsetY < SKY || e.offsetY > view.height - (view.follows ? MAP : 0)) return;
    const gap = shown.findIndex((x, i) => i + 1 < state.designed && px(x) <= e.offsetX && e.offsetX < px(shown[i + 1]));
    if (gap >= 0) send("insert", gap);
  });
  const onKey = (e) => { // anywhere on the page but in a control
    const focus = e.composedPath()[0];
    if (!canvas.isConnected) { document.removeEventListener("keydown", onKey); return; }
    if (focus !== canvas && focus !== document.body) return;
    if (e.key === " ") { if (playing || (now > 0 && now < end())) play(!playing); else push(); }
    else if (["Delete", "Backspace"].includes(e.key) && chosen > 0) { send("remove", chosen); chosen = -1; }
    else if (e.key.toLowerCase() === "z" && (e.ctrlKey || e.metaKey)) send("undo", e.shiftKey ? 1 : -1);
    else if (["ArrowLeft", "ArrowRight"].includes(e.key) && rows.length) {
      const by = e.key === "ArrowLeft" ? -1 : 1;
      if (e.altKey || chosen < 1) chosen = Math.min(Math.max(chosen + by, 1), state.designed - 1);
      else { rest(); send("drag", chosen, by * 1e-4, e.shiftKey); send("drop"); }
      draw();
    } else return;
    e.preventDefault();
  };
  document.addEventListener("keydown", onKey);

  // from the server
  function update() {
    const same = rows.length && rows[0].ground.x.length === model.state.rows[0].ground.x.length && !grip && el.clientWidth;
    const from = [...shown], begin = performance.now(), rested = rows.length && !playing && now > 0;
    state = model.state;
    rows = state.rows;
    if (rested || !moves()) rest();
    if (chosen >= state.designed) chosen = -1;
    resize();
    const to = [...rows[0].ground.x];
    (function step(stamp = performance.now()) { // unless newer places have arrived
      if (state !== model.state) return;
      const part = same ? Math.min(Math.max((stamp - begin) / EASE, 0), 1) : 1;
      shown = to.map((x, i) => (part < 1 ? from[i] + (x - from[i]) * part : x));
      draw();
      if (part < 1) requestAnimationFrame(step);
    })();
    if (wanted && moves()) { wanted = false; push(); }
  }
  model.on("state", update);
  const keep = () => history.replaceState(null, "", model.address);
  model.on("address", keep);
  new ResizeObserver(() => { resize(); draw(); }).observe(el);
  if (matchMedia("(pointer: coarse)").matches) send("touch");
  keep(); update();
}
