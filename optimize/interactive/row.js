// Row of dominoes on a canvas: it is dragged, pushed and heard here, without the server.
// motion.js, which is loaded before it, computes the leans. Times in s, lengths in m, screen in pixels.
const LEFT = 48, RIGHT = 12, SKY = 52, FOOT = 12, MAP = 26; // margins; those at the sides are the plots'
const SMALLEST = 26, REACH = 9, STILL = 4; // height of a domino in view; distances of the pointer
const AHEAD = 0.1; // [s] in which clicks are scheduled
const COLOURS = { ink: "#1d2126", soft: "#5c636d", line: "#c9ced4", fallen: "#0b6e99", leader: "#d55e00",
  ghost: "#b4bac2", chosen: "#e69f00" };

export function render({ model, el }) {
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  canvas.tabIndex = 0;
  canvas.style.cssText = "display:block;width:100%;touch-action:pan-y;cursor:grab;outline-offset:-2px";
  canvas.setAttribute("role", "application");
  canvas.setAttribute("aria-label", "Row of dominoes. Space pushes the first one. Drag a domino to move it.");
  el.append(canvas);
  let state = {}, rows = [], own, view = {}, shift = 0; // own: first of the rows
  let now = 0, playing = false, wanted = false, last = null, clicked = 0; // `wanted`: push when motion arrives
  let grip = null, chosen = -1, frame = 0, audio = null, click = null;
  const send = (name, ...values) => model.send_msg([name, ...values]);
  const moves = () => rows.every((row) => row.falls);
  const runs = () => moves() && now > 0;
  const end = () => Math.max(...rows.map((row) => row.end));

  // chooses the scale; a row too long for the width is followed, with a map of the whole below it
  function resize() {
    if (!el.clientWidth) return;
    const { low, high, bottom, top } = state.extent, heights = [...own.height].sort((a, b) => a - b);
    const width = el.clientWidth - LEFT - RIGHT, fit = width / (high - low), ratio = devicePixelRatio || 1;
    const k = Math.min(Math.max(fit, SMALLEST / heights[heights.length >> 1]), (0.45 * innerHeight - SKY) / (top - bottom));
    const follows = k > 1.02 * fit, foot = FOOT + (follows ? MAP : 0);
    const height = Math.max(0.2 * innerHeight, SKY + k * (top - bottom) + foot);
    view = { k, fit, follows, height, width, low, high, bottom, ratio, floor: height - foot };
    canvas.style.height = height + "px";
    canvas.width = Math.round(el.clientWidth * ratio);
    canvas.height = Math.round(height * ratio);
    pan(shift);
  }
  function pan(to) {
    shift = view.follows ? Math.min(Math.max(to, 0), view.high - view.low - view.width / view.k) : 0;
    draw();
  }
  const px = (x) => LEFT + (x - view.low - shift) * view.k;
  const pz = (z) => view.floor - (z - view.bottom) * view.k;

  function domino(row, i, lean, up) {
    const h = row.height[i] * view.k, d = row.thickness[i] * view.k, s = Math.sin(lean), c = Math.cos(lean);
    const u = px(row.ground.x[i]), v = pz(row.ground.z[i]) - up;
    if (u < -2 * h || u - d > el.clientWidth + 2 * h) return;
    pen.beginPath();
    for (const [a, b] of [[0, 0], [h, 0], [h, d], [0, d]]) pen.lineTo(u + a * s - b * c, v - a * c - b * s);
    pen.closePath(); pen.fill();
  }
  function draw() {
    pen.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    pen.clearRect(0, 0, el.clientWidth, view.height);
    pen.strokeStyle = COLOURS.soft;
    pen.beginPath(); own.ground.line.forEach(([x, z]) => pen.lineTo(px(x), pz(z))); pen.stroke();
    for (const row of [...rows].reverse()) {
      const ghost = row !== own, first = runs() ? leader(row, now)[0] : -1;
      (runs() ? leans(row, now) : row.ground.tilt).forEach((lean, i) => {
        const standing = i >= state.designed ? COLOURS.soft : i === chosen ? COLOURS.chosen : COLOURS.ink;
        pen.fillStyle = ghost ? COLOURS.ghost : i < first ? COLOURS.fallen : i === first ? COLOURS.leader : standing;
        domino(row, i, lean, ghost ? 5 : 0);
      });
      const finish = px(row.ground.x.at(-1));
      pen.strokeStyle = ghost ? COLOURS.ghost : COLOURS.ink; pen.setLineDash([4, 4]);
      pen.beginPath(); pen.moveTo(finish, pz(row.ground.z.at(-1)) + 6); pen.lineTo(finish, SKY - 8); pen.stroke(); pen.setLineDash([]);
    }
    const { x, z } = own.ground, top = (i) => pz(z[i] + own.height[i]) - 4;
    if (state.stop >= 0) write("▼", px(x[state.stop]), top(state.stop), COLOURS.leader, "center");
    if (!now) write("▶", px(-own.thickness[0]) - 6, top(0) + 20, COLOURS.leader, "right");
    caption(); map(); pointer();
  }
  function write(text, x, y, colour, align = "left") {
    pen.fillStyle = colour; pen.textAlign = align; pen.font = "14px system-ui, sans-serif";
    pen.fillText(text, x, y, el.clientWidth - 24);
  }
  function caption() { // times of the race: running, and frozen at the finish
    const time = (row) => {
      const t = row.arrivals.at(-1);
      return t != null && now >= t ? `${t.toFixed(3)} s` : now >= row.end ? "stops" : `${now.toFixed(2)} s …`;
    };
    write(runs() ? `yours ${time(own)}` : "Click the first domino to push the row.", 12, 18, COLOURS.ink);
    if (runs() && rows[1]) write(`${state.other} ${time(rows[1])}`, 142, 18, COLOURS.soft);
    const hint = "Drag the others (with Shift: and all ahead). Double click: one more; Delete: one less.";
    write(!runs() ? (el.clientWidth < 700 ? "" : hint) : now >= end() ? state.verdict : "", 12, 38, runs() ? COLOURS.ink : COLOURS.soft);
  }
  function map() { // the whole row as a line, the part in view as a box, the wave as a dot
    if (!view.follows) return;
    const y = view.height - 12, x = (p) => LEFT + (p - view.low) * view.fit;
    pen.fillStyle = COLOURS.line; pen.fillRect(x(0), y, own.ground.x.at(-1) * view.fit, 6);
    pen.strokeStyle = COLOURS.ink; pen.strokeRect(x(view.low + shift), y - 4, view.width / view.k * view.fit, 14);
    if (runs()) { pen.fillStyle = COLOURS.leader; pen.fillRect(x(wavePosition(own, now)) - 2, y - 4, 4, 14); }
  }
  function pointer() { // on the curve of the local speed
    const span = window.Bokeh?.documents.map((d) => d.get_model_by_name("pointer")).find(Boolean);
    if (span) Object.assign(span, { location: runs() ? wavePosition(own, now) : view.low - 1, visible: runs() });
  }

  // play
  function push() {
    wanted = !moves();
    if (wanted) return send("push");
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
    if (last !== null) now = Math.min(now + Math.min(stamp - last, 100) / 1000 * model.pace, end()); // a stall is no leap
    last = stamp;
    sound();
    pan(wavePosition(own, now) - view.low - 0.6 * view.width / view.k);
    playing = now < end();
    if (playing) frame = requestAnimationFrame(tick);
  }
  function sound() { // one node for each hit, at its time
    if (!audio || !model.sound) return;
    if (!click) { // a damped sine
      click = audio.createBuffer(1, 0.02 * audio.sampleRate, audio.sampleRate);
      click.getChannelData(0).forEach((_, i, data) => { const t = i / audio.sampleRate; data[i] = 0.5 * Math.sin(2 * Math.PI * 3200 * t) * Math.exp(-t / 0.0012); });
    }
    for (; clicked + 1 < own.hit && own.arrivals[clicked + 1] < now + AHEAD * model.pace; clicked++) {
      const node = audio.createBufferSource();
      node.buffer = click; node.connect(audio.destination);
      node.start(audio.currentTime + Math.max(own.arrivals[clicked + 1] - now, 0) / model.pace);
    }
  }

  // changes by hand
  function find(e) { // index of the domino under the pointer, or -1
    const { x, z } = own.ground;
    let near = -1, least = REACH;
    if (Math.abs(e.offsetX - px(0) + 18) < 18 && e.offsetY > SKY && e.offsetY < view.floor) return 0; // ▶
    for (let i = 0; i < state.designed; i++) {
      const d = own.thickness[i] * view.k, distance = Math.max(Math.abs(e.offsetX - px(x[i]) + 0.5 * d) - 0.5 * d, 0);
      const above = pz(z[i]) - e.offsetY;
      if (distance < least && above > -REACH && above < own.height[i] * view.k + REACH) [near, least] = [i, distance];
    }
    return near;
  }
  canvas.addEventListener("pointerdown", (e) => {
    if (grip || !e.isPrimary || e.button) return;
    const onMap = view.follows && e.offsetY > view.floor + FOOT;
    if (onMap) { playing = false; pan((e.offsetX - LEFT) / view.fit - 0.5 * view.width / view.k); }
    grip = { i: onMap ? -1 : find(e), scale: onMap ? view.fit : -view.k, x: e.clientX, shift, moved: false };
    canvas.setPointerCapture(e.pointerId);
  });
  canvas.addEventListener("pointermove", (e) => {
    if (grip && !e.buttons) release(); // its end was not seen
    if (!grip) { canvas.style.cursor = ["grab", "pointer", "ew-resize"][Math.sign(find(e)) + 1]; return; }
    const by = e.clientX - grip.x;
    if (Math.abs(by) < STILL && !grip.moved) return;
    grip.moved = true;
    if (grip.i < 1) return pan(grip.shift + by / grip.scale);
    chosen = grip.i; playing = false; now = 0;
    send("drag", grip.i, by / view.k, e.shiftKey);
  });
  function release() {
    if (grip?.moved && grip.i > 0) send("commit");
    grip = null;
  }
  canvas.addEventListener("pointerup", () => {
    if (grip?.i === 0 && !grip.moved) push();
    else if (grip && !grip.moved) { chosen = grip.i; draw(); }
    release();
  });
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("dblclick", (e) => {
    const x = own.ground.x, gap = x.findIndex((p, i) => i + 1 < state.designed && px(p) <= e.offsetX && e.offsetX < px(x[i + 1]));
    if (gap >= 0 && e.offsetY > SKY && e.offsetY < view.floor + FOOT) send("insert", gap);
  });
  document.addEventListener("keydown", (e) => { // anywhere on the page but in a control
    if (!canvas.isConnected || ![canvas, document.body].includes(e.composedPath()[0])) return;
    if (e.key === " ") playing || (runs() && now < end()) ? play(!playing) : push();
    else if (["Delete", "Backspace"].includes(e.key) && chosen > 0) { send("remove", chosen); chosen = -1; }
    else return;
    e.preventDefault();
  });

  // from the server
  function update() {
    state = model.state; rows = state.rows; own = rows[0];
    if (!playing || !moves()) { playing = false; now = 0; }
    if (chosen >= state.designed) chosen = -1;
    resize();
    if (wanted && moves()) push();
  }
  const keep = () => history.replaceState(null, "", model.address);
  model.on("state", update);
  model.on("address", keep);
  new ResizeObserver(resize).observe(el);
  window.addEventListener("resize", resize); // also of the height
  if (matchMedia("(pointer: coarse)").matches) send("touch");
  keep(); update();
}
