// Curves on canvases: values along the row with points that can be dragged, and curves of runs.

import { LEFT, RIGHT, colour } from "./row.js";

const TOP = 22, BOTTOM = 20, HEIGHT = 170; // [px] title, numbers of the axis, whole curve
const GRIP = 22, TIP = 12; // [px] distances of finger and pointer from a point

// round numbers between two values, some five or six
function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((k) => k * power >= rough) * power, values = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high * (1 + 1e-12); k++) values.push(k * step);
  return values.map((v) => Number(v.toPrecision(12)));
}

/** Range of some values with a margin. */
export function rangeOf(values, least = Infinity) {
  const finite = values.filter(Number.isFinite), low = Math.min(least, ...finite), high = Math.max(...finite);
  if (!finite.length) return [0, 1];
  const margin = 0.08 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low - margin, high + margin];
}

/**
 * Curves in a canvas that is appended to `box`.
 * @param {HTMLElement} box
 * @param {string} label for screen readers
 * @param {object} [act] for points that can be dragged: `drag(index, value)`, `commit()`; and `unit` of the values
 * @returns {object} `draw({title, x: [low, high], y: [low, high], series, axis, write})`, `write` having the
 *   functions that write numbers of both axes, a series being
 *   `{x, y, colour, points, loose, dash}` with the name of a colour of page.css, `loose` for points without a line;
 *   `point(position)` marks a position, null for none
 */
export function createCurves(box, label, act) {
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", label);
  box.append(canvas);
  let shown, grip = null, hover = -1, marked = null, width = 0;
  const px = (x) => LEFT + ((x - shown.x[0]) / (shown.x[1] - shown.x[0])) * (width - LEFT - RIGHT);
  const py = (y) => HEIGHT - BOTTOM - ((y - shown.y[0]) / (shown.y[1] - shown.y[0])) * (HEIGHT - TOP - BOTTOM);

  function draw(given) {
    shown = given ?? shown;
    if (hover >= (shown?.series[0]?.x.length ?? 0)) hover = -1; // the row is shorter than before
    width = canvas.clientWidth;
    if (!shown || !width) return;
    const ratio = devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(HEIGHT * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.font = "12px system-ui, sans-serif";
    axes();
    pen.save();
    pen.beginPath(); pen.rect(LEFT - 6, TOP - 6, width - LEFT - RIGHT + 12, HEIGHT - TOP - BOTTOM + 12); pen.clip();
    for (const series of [...shown.series].reverse()) line(series);
    if (marked !== null) { pen.strokeStyle = colour("leader"); pen.beginPath(); pen.moveTo(px(marked), TOP); pen.lineTo(px(marked), HEIGHT - BOTTOM); pen.stroke(); }
    pen.restore();
    tip();
  }
  function axes() {
    const right = width - RIGHT, foot = HEIGHT - BOTTOM;
    pen.fillStyle = colour("ink"); pen.textAlign = "left"; pen.textBaseline = "alphabetic";
    pen.fillText(shown.title, LEFT, 13, right - LEFT);
    pen.fillStyle = colour("soft"); pen.strokeStyle = colour("grid"); pen.lineWidth = 1;
    pen.textAlign = "right"; pen.textBaseline = "middle";
    const [across, up] = shown.write ?? [String, String];
    for (const v of ticks(...shown.y, 4)) stroke([[LEFT, py(v)], [right, py(v)]], up(v), LEFT - 6, py(v));
    pen.textAlign = "center"; pen.textBaseline = "top";
    const places = ticks(...shown.x, Math.max(width / 120, 2));
    for (const v of places) stroke([[px(v), TOP], [px(v), foot]], v === places.at(-1) ? `${across(v)} ${shown.axis ?? ""}` : across(v), px(v), foot + 5);
    pen.strokeStyle = colour("soft");
    stroke([[LEFT, TOP], [LEFT, foot], [right, foot]], "", 0, 0);
  }
  function stroke(points, text, x, y) {
    pen.beginPath(); points.forEach((p) => pen.lineTo(...p)); pen.stroke();
    pen.fillText(text, x, y);
  }
  function line({ x, y, colour: name, points, loose, dash = [] }) {
    pen.strokeStyle = pen.fillStyle = colour(name);
    pen.lineWidth = 1.5; pen.setLineDash(dash); pen.beginPath();
    for (let i = 0, pen_ = false; i < x.length; i++) { // a value that is not finite leaves a hole
      if (!Number.isFinite(y[i])) { pen_ = false; continue; }
      if (pen_) pen.lineTo(px(x[i]), py(y[i])); else pen.moveTo(px(x[i]), py(y[i]));
      pen_ = true;
    }
    if (!loose) pen.stroke();
    pen.setLineDash([]);
    const radius = points && x.length < 400 ? 4 : points ? 1.5 : 0;
    if (!radius) return;
    pen.beginPath();
    for (let i = 0; i < x.length; i++) {
      if (radius < 2) { pen.fillRect(px(x[i]) - radius, py(y[i]) - radius, 2 * radius, 2 * radius); continue; } // many: faster
      pen.moveTo(px(x[i]), py(y[i])); pen.arc(px(x[i]), py(y[i]), radius, 0, 7);
    }
    pen.fill();
    if (hover >= 0) { pen.fillStyle = colour("leader"); pen.beginPath(); pen.arc(px(x[hover]), py(y[hover]), radius + 1, 0, 7); pen.fill(); }
  }
  function tip() {
    if (hover < 0 || !shown.series[0].points) return;
    const { x, y } = shown.series[0], text = `${hover}: ${y[hover].toFixed(3)} ${act.unit}`, half = pen.measureText(text).width / 2 + 4;
    const at = Math.min(Math.max(px(x[hover]), LEFT + half), width - RIGHT - half), up = py(y[hover]) < TOP + 24 ? 18 : -14;
    pen.fillStyle = colour("paper"); pen.fillRect(at - half, py(y[hover]) + up - 8, 2 * half, 16);
    pen.fillStyle = colour("ink"); pen.textAlign = "center"; pen.textBaseline = "middle";
    pen.fillText(text, at, py(y[hover]) + up);
  }

  // nearest point along the row, if the pointer is at most `reach` above or below it, else -1
  function find(e, reach) {
    const { x, y } = shown.series[0];
    let near = 0;
    for (let i = 1; i < x.length; i++) if (Math.abs(px(x[i]) - e.offsetX) < Math.abs(px(x[near]) - e.offsetX)) near = i;
    return x.length && Math.hypot(px(x[near]) - e.offsetX, py(y[near]) - e.offsetY) < reach ? near : -1;
  }
  if (act?.drag) {
    canvas.addEventListener("touchstart", (e) => { // a swipe that does not begin at a point scrolls
      const box = canvas.getBoundingClientRect(), [t] = e.touches;
      if (find({ offsetX: t.clientX - box.left, offsetY: t.clientY - box.top }, GRIP) >= 0) e.preventDefault();
    }, { passive: false });
    canvas.addEventListener("pointerdown", (e) => {
      const i = find(e, e.pointerType === "touch" ? GRIP : TIP);
      if (i < 0 || !e.isPrimary || e.button) return;
      grip = { i, offset: py(shown.series[0].y[i]) - e.offsetY };
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      if (grip) {
        const y = e.offsetY + grip.offset;
        act.drag(grip.i, shown.y[0] + ((HEIGHT - BOTTOM - y) / (HEIGHT - TOP - BOTTOM)) * (shown.y[1] - shown.y[0]));
      }
      const near = grip ? grip.i : find(e, TIP);
      canvas.style.cursor = near < 0 ? "default" : "ns-resize";
      if (near !== hover) { hover = near; draw(); }
    });
    const release = () => {
      if (grip) { grip = null; act.commit(); }
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointerleave", () => { if (!grip && hover >= 0) { hover = -1; draw(); } });
  }
  new ResizeObserver(() => draw()).observe(box);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => draw());
  return { draw, canvas, point(position) { if (position !== marked) { marked = position; draw(); } }, place: (i) => [px(shown.series[0].x[i]), py(shown.series[0].y[i])] };
}
