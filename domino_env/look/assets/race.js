"use strict";
// The race: leans of all dominoes from the leader's, by the contacts of the model, drawn on a canvas.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const rows = data.rows;
  const end = Math.max(...rows.map((r) => r.end));
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colour = (k) => css("--c" + (k % 4));
  let now = 0, playing = false, last = null;

  $("who").textContent = data.headline.who;
  $("why").textContent = data.headline.why;

  // who leads at time t, and its lean
  function leader(row, t) {
    let n = 0;
    while (n + 1 < row.hit && row.arrivals[n + 1] <= t) n++;
    const from = row.arrivals[n], to = n + 1 < row.hit ? row.arrivals[n + 1] : row.end;
    const looks = row.falls[n], last = looks.length - 1;
    const x = to > from ? Math.min(Math.max((t - from) / (to - from), 0), 1) * last : 0;
    const i = Math.min(Math.floor(x), last - 1);
    return [n, looks[i] + (looks[i + 1] - looks[i]) * (x - i)];
  }

  // every lean [rad]; contacts as in domino_env/motion.py: tip, then front face on rear edge, then lost
  function leans(row, t) {
    const all = new Array(row.thickness.length).fill(0);
    const [n, angle] = leader(row, t);
    all[n] = angle;
    let s = Math.sin(angle), c = Math.cos(angle);
    for (let i = n - 1; i >= 0; i--) {
      const gap = row.spacing[i] / row.height[i], d = row.thickness[i + 1] / row.height[i], p = gap + d;
      const lowest = 1 - (1 - gap * gap) / (2 * p * d);
      if (c < lowest) { c = lowest; s = Math.sqrt(Math.max(1 - c * c, 0)); }
      if (c < d / p) {
        const r = Math.sqrt(gap * gap + 2 * p * d * (1 - c));
        [s, c] = [(gap + d * (1 - c)) / r, d * s / r];
      } else {
        const sine = Math.min(Math.max(gap - p * (1 - c), -1), 1), cosine = Math.sqrt(1 - sine * sine);
        [s, c] = [s * cosine + c * sine, c * cosine - s * sine];
      }
      all[i] = Math.atan2(s, c);
    }
    return all;
  }

  const canvas = $("race"), pen = canvas.getContext("2d");
  let view = { k: 1, lane: 100, width: 100, left: 10 };
  const longest = Math.max(...rows.map((r) => r.positions[r.positions.length - 1]));
  const tallest = Math.max(...rows.map((r) => Math.max(...r.height)));

  function resize() {
    const width = canvas.clientWidth, ratio = window.devicePixelRatio || 1;
    const left = 12 + 6, k = (width - 2 * left) / (longest + 1.15 * tallest + 0.01);
    const lane = Math.max(tallest * k, 14) + 46;
    view = { k, lane, width, left };
    canvas.style.height = lane * rows.length + 8 + "px";
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round((lane * rows.length + 8) * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  function corners(row, i, lean, floor) {
    const { k, left } = view, x = left + (row.positions[i] + row.thickness[0]) * k;
    const ux = Math.sin(lean) * row.height[i] * k, uy = -Math.cos(lean) * row.height[i] * k;
    const bx = -Math.cos(lean) * row.thickness[i] * k, by = -Math.sin(lean) * row.thickness[i] * k;
    return [[x, floor], [x + ux, floor + uy], [x + ux + bx, floor + uy + by], [x + bx, floor + by]];
  }

  function draw() {
    pen.clearRect(0, 0, view.width, canvas.height);
    const best = Math.max(...rows.map((r) => r.mean_speed));
    rows.forEach((row, k) => {
      const floor = (k + 1) * view.lane - 6, all = leans(row, now), [front] = leader(row, now);
      const done = row.mean_speed > 0 && now >= row.arrivals[row.arrivals.length - 1];
      pen.strokeStyle = css("--line");
      pen.beginPath(); pen.moveTo(0, floor); pen.lineTo(view.width, floor); pen.stroke();
      all.forEach((lean, i) => {
        const c = corners(row, i, lean, floor);
        pen.fillStyle = i === front && !done ? css("--front") : i <= front ? colour(k) : css("--stand");
        pen.beginPath(); c.forEach(([x, y], j) => (j ? pen.lineTo(x, y) : pen.moveTo(x, y)));
        pen.closePath(); pen.fill();
      });
      const clock = row.arrivals[front];
      pen.fillStyle = css("--ink"); pen.font = "600 14px system-ui, sans-serif"; pen.textAlign = "left";
      pen.fillText(row.name, 12, k * view.lane + 22);
      pen.textAlign = "right"; pen.font = "14px system-ui, sans-serif";
      let said = `${front + 1} of ${all.length}`;
      if (done) said = `${row.mean_speed.toFixed(4)} m/s` + (row.mean_speed === best && rows.length > 1 ? "  ★ fastest" : "");
      else if (now > row.end || (front + 1 === row.hit && now >= row.end)) said = row.outcome;
      else if (front > 0) said += `   ${(row.positions[front] / clock).toFixed(3)} m/s so far`;
      pen.fillText(said, view.width - 12, k * view.lane + 22);
    });
    $("clock").textContent = `${(now * 1000).toFixed(0)} ms`;
    $("scrub").value = String(Math.round((now / end) * 1000));
    $("scrub").setAttribute("aria-valuetext", $("clock").textContent);
  }

  function go(t) { now = Math.min(Math.max(t, 0), end); draw(); }
  function play(on) {
    if (on && now >= end) now = 0;
    playing = on; last = null;
    $("play").textContent = on ? "Pause" : "Play";
    if (on) requestAnimationFrame(tick);
  }
  function tick(stamp) {
    if (!playing) return;
    if (last !== null) go(now + (stamp - last) / 1000 / Number($("slow").value));
    last = stamp;
    if (now >= end) play(false); else requestAnimationFrame(tick);
  }

  $("play").addEventListener("click", () => play(!playing));
  $("scrub").addEventListener("input", (e) => { play(false); go((Number(e.target.value) / 1000) * end); });
  document.addEventListener("keydown", (e) => {
    if (["SELECT", "BUTTON", "INPUT", "SUMMARY"].includes(e.target.tagName)) return;
    const moves = { ArrowLeft: now - end / 200, ArrowRight: now + end / 200, Home: 0, End: end };
    if (e.key === " ") play(!playing);
    else if (e.key in moves) { play(false); go(moves[e.key]); }
    else return;
    e.preventDefault();
  });

  canvas.addEventListener("pointermove", (e) => {
    const k = Math.floor(e.offsetY / view.lane), row = rows[k], tip = $("tip");
    if (!row) { tip.hidden = true; return; }
    const all = leans(row, now), floor = (k + 1) * view.lane - 6;
    let near = 0, least = Infinity;
    all.forEach((lean, i) => {
      const c = corners(row, i, lean, floor);
      const x = c.reduce((a, q) => a + q[0], 0) / 4, y = c.reduce((a, q) => a + q[1], 0) / 4;
      const far = Math.hypot(x - e.offsetX, (y - e.offsetY) / 2);
      if (far < least) { least = far; near = i; }
    });
    if (least > 30) { tip.hidden = true; return; }
    const mm = (x) => (x == null ? "–" : (x * 1000).toFixed(2) + " mm");
    tip.textContent = `${row.name}, domino ${near}\ngap in front ${mm(row.spacing[near])}\nthickness ${mm(row.thickness[near])}\n` +
      (row.arrivals[near] == null ? "never hit" : `hit at ${(row.arrivals[near] * 1000).toFixed(2)} ms`) +
      (near && row.speed[near - 1] ? `\nlocal speed ${row.speed[near - 1].toFixed(3)} m/s` : "");
    tip.hidden = false;
    tip.style.left = Math.min(e.offsetX + 14, view.width - 190) + "px";
    tip.style.top = e.offsetY + 14 + "px";
  });
  canvas.addEventListener("pointerleave", () => ($("tip").hidden = true));

  // the table
  const head = ["", "mean speed", "last hit", "length", "dominoes", "friction", "push", "ended"];
  const table = $("table"), top = table.createTHead().insertRow();
  head.forEach((name) => { const th = document.createElement("th"); th.textContent = name; th.scope = "col"; top.append(th); });
  const body = table.createTBody();
  rows.forEach((row, k) => {
    const line = body.insertRow(), t = row.arrivals[row.arrivals.length - 1];
    const cells = [row.name, row.mean_speed ? row.mean_speed.toFixed(5) + " m/s" : "–", t == null ? "never" : (t * 1000).toFixed(2) + " ms",
      row.positions[row.positions.length - 1].toFixed(4) + " m", row.thickness.length, row.friction, row.push.toFixed(2) + " rad/s", row.outcome];
    cells.forEach((text, j) => {
      const cell = line.insertCell();
      if (!j) { const dot = document.createElement("span"); dot.className = "swatch"; dot.style.background = `var(--c${k % 4})`; cell.append(dot); }
      cell.append(String(text));
    });
    const note = document.createElement("li");
    note.textContent = `${row.name}: ${row.explanation} Relative error of the times below ${row.error.toExponential(0)}; ` +
      `${row.flushes} flushes, the largest takes ${(row.flush_loss * 100).toFixed(2)} % of the front's speed.`;
    $("notes").append(note);
  });

  // charts
  let charts = [];
  const dashes = [[], [7, 4], [2, 3], [9, 3, 2, 3]];
  const axis = () => ({ stroke: css("--soft"), grid: { stroke: css("--line"), width: 0.5 }, ticks: { stroke: css("--line") } });
  function chart(id, x, series, label) {
    const box = $(id);
    box.textContent = "";
    const plot = new uPlot({
      width: Math.max(box.clientWidth, 260), height: 240, scales: { x: { time: false } },
      axes: [{ ...axis(), label, labelSize: 20, labelFont: "12px system-ui", font: "12px system-ui" }, { ...axis(), font: "12px system-ui" }],
      series: [{ label }, ...series.map((s, k) => ({ label: s.name, stroke: colour(s.colour ?? k), width: 2, dash: dashes[k % 4], points: { show: false }, paths: s.steps ? uPlot.paths.stepped({ align: 1 }) : undefined, value: (u, v) => (v == null ? "–" : v.toPrecision(4)) }))],
    }, [x, ...series.map((s) => s.values)], box);
    box.setAttribute("role", "img");
    box.setAttribute("aria-label", series.map((s) => { const v = s.values.filter((q) => q != null); return `${s.name}: from ${v.length ? Math.min(...v).toPrecision(3) : "–"} to ${v.length ? Math.max(...v).toPrecision(3) : "–"}`; }).join("; "));
    charts.push(plot);
  }
  // several curves, each with its own x, on the union of all
  function joined(curves) {
    const x = [...new Set(curves.flatMap((c) => c.x))].sort((a, b) => a - b);
    return [x, curves.map((c) => {
      let i = 0;
      return x.map((t) => {
        if (!c.x.length || t < c.x[0] || t > c.x[c.x.length - 1]) return null;
        while (i + 2 < c.x.length && c.x[i + 1] <= t) i++;
        if (c.x.length === 1) return c.y[0];
        const w = c.hold ? (t >= c.x[i + 1] ? 1 : 0) : (t - c.x[i]) / (c.x[i + 1] - c.x[i]);
        return c.y[i] + w * (c.y[i + 1] - c.y[i]);
      });
    })];
  }
  function drawCharts() {
    charts.forEach((c) => c.destroy());
    charts = [];
    const most = Math.max(...rows.map((r) => r.spacing.length)), numbers = [...Array(most).keys()];
    const padded = (v, f) => numbers.map((i) => (v[i] == null ? null : v[i] * f));
    chart("gaps", numbers, rows.map((r) => ({ name: r.name, values: padded(r.spacing, 1000) })), "domino");
    chart("speeds", numbers.map((i) => i + 1), rows.map((r) => ({ name: r.name, values: padded(r.speed, 1) })), "domino");
    const [t, kinetic] = joined(rows.map((r) => ({ x: r.energy.time, y: r.energy.kinetic })));
    chart("kinetic", t, rows.map((r, k) => ({ name: r.name, values: kinetic[k].map((v) => (v == null ? null : v * 1000)) })), "time [s]");
    const e = rows[0].energy, milli = (v) => v.map((q) => q * 1000);
    $("budgetname").textContent = `Where the energy goes: ${rows[0].name} [mJ]`;
    chart("budget", e.time, [{ name: "given by gravity", values: milli(e.released) }, { name: "kinetic", values: milli(e.kinetic) },
      { name: "lost to hits", values: milli(e.hits) }, { name: "lost to friction, flushes", values: milli(e.rubbed) }], "time [s]");
    const searched = rows.filter((r) => r.trace && r.trace[0].length);
    if (searched.length) {
      $("searchbox").hidden = false;
      const [n, best] = joined(searched.map((r) => ({ x: r.trace[0], y: r.trace[1], hold: true })));
      chart("search", n, searched.map((r, k) => ({ name: r.name, values: best[k].map((v) => (v != null && v < 0 ? null : v)), steps: true })), "evaluations");
    }
  }
  const checked = rows.filter((r) => r.verification);
  if (checked.length) {
    $("verifybox").hidden = false;
    $("verify").textContent = checked.map((r) => `${r.name}, rigid-body engine ${r.verification.engine}: ${r.verification.verdict}`).join(" ");
  }

  function all() { resize(); draw(); drawCharts(); }
  window.addEventListener("resize", all);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", all);
  window.race = { rows, end, leans, leader, go, play, now: () => now, playing: () => playing };
  all();
})();
