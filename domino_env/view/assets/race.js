"use strict";
// The race: leans of all dominoes from the leader's, by the contacts of the model, drawn on a canvas.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const rows = data.rows;
  const end = Math.max(...rows.map((r) => r.end));
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colour = (k) => css("--c" + (k % 5));
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

  // where pivots stand and how the ground slopes: flat but over hills
  for (const row of rows) {
    const zeros = row.positions.map(() => 0), flat = { x: row.positions, z: zeros, tilt: zeros, steps: zeros };
    row.hills ??= { ...flat, ground: [[-row.thickness[0], 0], [row.positions[row.positions.length - 1], 0]] };
    row.lowest = Math.min(...row.hills.ground.map(([, z]) => z));
    row.relief = Math.max(...row.hills.ground.map(([, z]) => z)) - row.lowest;
  }

  // every lean from the vertical [rad]; contacts as in domino_env/physics/motion.py, each seen upright
  // from the stand of the domino ahead: tip, then front face on rear edge, then lost
  function leans(row, t) {
    const { tilt, steps } = row.hills, all = [...tilt];
    const [n, angle] = leader(row, t);
    let lean = all[n] = angle;
    for (let i = n - 1; i >= 0; i--) {
      const h = row.height[i], d = row.thickness[i + 1] / h, p = row.spacing[i] / h + d, e = steps[i] / h;
      const reach = Math.hypot(p, e), slant = Math.atan2(e, p), stand = tilt[i + 1];
      const lost = Math.acos(Math.min(Math.max((reach * reach + d * d - 1) / (2 * d * reach), -1), 1)) - slant;
      const turn = Math.min(lean - stand, lost), gap = reach * Math.cos(turn + slant) - d;
      if (gap < 0) lean = Math.atan2(p - d * Math.cos(turn), e + d * Math.sin(turn));
      else lean = turn + Math.asin(Math.min(gap, 1));
      all[i] = lean += stand;
    }
    return all;
  }

  const canvas = $("race"), pen = canvas.getContext("2d");
  let view = { k: 1, lane: 100, width: 100, left: 10 };
  const longest = Math.max(...rows.map((r) => r.hills.x[r.hills.x.length - 1]));
  const hills = Math.max(...rows.map((r) => r.relief));
  const heights = rows.flatMap((r) => r.height).sort((a, b) => a - b);
  const tallest = heights[heights.length - 1], usual = heights[heights.length >> 1];

  // A row too long for the screen is shown larger and followed, with a map of the whole under it.
  function resize() {
    const width = canvas.clientWidth, ratio = window.devicePixelRatio || 1, left = 18;
    const reach = longest + 1.15 * tallest + 0.01, fit = (width - 2 * left) / reach;
    const k = Math.max(fit, Math.min(28 / usual, 160 / tallest));
    const follows = k > 1.05 * fit, head = width < 560 ? 46 : 30;
    // hills too high are followed as well
    const room = Math.min(hills * (follows ? k : fit), 260);
    const lane = head + Math.max(tallest * (follows ? k : fit), 14) + room + (follows ? 22 : 14);
    view = { k: follows ? k : fit, fit, follows, lane, head, width, left, room, shift: 0 };
    canvas.style.height = lane * rows.length + "px";
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(lane * rows.length * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  // where the front of the wave is [m]: x or z, moving on evenly between two hits
  function reached(row, t, along = row.hills.x) {
    const [n] = leader(row, t), next = row.arrivals[n + 1];
    if (next == null) return along[n];
    const share = Math.min(Math.max((t - row.arrivals[n]) / (next - row.arrivals[n]), 0), 1);
    return along[n] + share * (along[n + 1] - along[n]);
  }

  // where on the screen the height of the first pivot is
  function floorOf(k) {
    const row = rows[k], room = view.room / view.k, z = reached(row, now, row.hills.z);
    const lowest = Math.max(row.lowest, Math.min(z - 0.5 * room, row.lowest + row.relief - room));
    return (k + 1) * view.lane - (view.follows ? 16 : 8) + lowest * view.k;
  }

  function corners(row, i, lean, floor) {
    const { k, left, shift } = view, x = left - shift + (row.hills.x[i] + row.thickness[0]) * k;
    floor -= row.hills.z[i] * k;
    const ux = Math.sin(lean) * row.height[i] * k, uy = -Math.cos(lean) * row.height[i] * k;
    const bx = -Math.cos(lean) * row.thickness[i] * k, by = -Math.sin(lean) * row.thickness[i] * k;
    return [[x, floor], [x + ux, floor + uy], [x + ux + bx, floor + uy + by], [x + bx, floor + by]];
  }

  // the line under a row, straight on beyond its ends
  function ground(row, floor) {
    const { k, left, shift } = view, { ground: line, tilt } = row.hills, far = 2 * view.width;
    const on = line.map(([x, z]) => [left - shift + (x + row.thickness[0]) * k, floor - z * k]);
    const [[x, y], [u, v]] = [on[0], on[on.length - 1]];
    return [[x - far, y - far * Math.tan(tilt[0])], ...on, [u + far, v + far * Math.tan(tilt[tilt.length - 1])]];
  }

  function draw() {
    pen.clearRect(0, 0, view.width, canvas.height);
    if (view.follows) {
      const fronts = rows.map((r) => reached(r, now)), whole = (longest + 1.15 * tallest + 0.01) * view.k;
      const middle = 0.5 * (Math.min(...fronts) + Math.max(...fronts)) * view.k;
      view.shift = Math.min(Math.max(middle - 0.55 * view.width, 0), whole - view.width + 2 * view.left);
    }
    rows.forEach((row, k) => {
      const floor = floorOf(k), all = leans(row, now), [front] = leader(row, now);
      const done = row.mean_speed > 0 && now >= row.arrivals[row.arrivals.length - 1];
      pen.strokeStyle = css("--line"); pen.lineWidth = 1;
      pen.beginPath(); ground(row, floor).forEach(([x, y]) => pen.lineTo(x, y)); pen.stroke();
      all.forEach((lean, i) => {
        const c = corners(row, i, lean, floor);
        if (c.every(([x]) => x < 0) || c.every(([x]) => x > view.width)) return;
        pen.fillStyle = i === front && !done ? css("--front") : i <= front ? colour(k) : css("--stand");
        pen.beginPath(); c.forEach(([x, y], j) => (j ? pen.lineTo(x, y) : pen.moveTo(x, y)));
        pen.closePath(); pen.fill();
      });
      if (view.follows) map(row, k);
      const top = k * view.lane;
      pen.fillStyle = colour(k); pen.fillRect(12, top + 11, 11, 11);
      pen.fillStyle = css("--ink"); pen.font = "600 14px system-ui, sans-serif"; pen.textAlign = "left";
      pen.fillText(row.name, 29, top + 21);
      pen.font = "14px system-ui, sans-serif";
      const narrow = view.width < 560;
      if (!narrow) pen.textAlign = "right";
      pen.fillText(state(row, k, front, done), narrow ? 29 : view.width - 12, top + (narrow ? 39 : 21));
    });
    $("clock").textContent = `${(now * 1000).toFixed(0)} ms`;
    $("scrub").value = String(Math.round((now / end) * 1000));
    $("scrub").setAttribute("aria-valuetext", $("clock").textContent);
  }

  // what a row has come to, in a few words
  function state(row, k, front, done) {
    if (done || (now === 0 && row.mean_speed > 0)) {
      return `${row.mean_speed.toFixed(4)} m/s` + (k === data.winner ? "  ★ winner" : "");
    }
    if (now >= row.end) return row.outcome;
    const told = `${front + 1} of ${row.thickness.length}`;
    return front > 0 ? `${told}   ${(row.positions[front] / row.arrivals[front]).toFixed(3)} m/s so far` : told;
  }

  // the whole row as a line, the part shown as a box on it, and how far the wave is
  function map(row, k) {
    const y = (k + 1) * view.lane - 8, scale = view.fit, from = view.left;
    pen.fillStyle = css("--line");
    pen.fillRect(from, y, row.hills.x[row.hills.x.length - 1] * scale, 4);
    pen.fillStyle = colour(k);
    pen.fillRect(from, y, reached(row, now) * scale, 4);
    pen.strokeStyle = css("--soft");
    pen.strokeRect(from + (view.shift / view.k) * scale, y - 2, ((view.width - 2 * view.left) / view.k) * scale, 8);
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

  function point(e) {
    const k = Math.floor(e.offsetY / view.lane), row = rows[k], tip = $("tip");
    if (!row) { tip.hidden = true; return; }
    const all = leans(row, now), floor = floorOf(k);
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
    tip.style.left = Math.max(Math.min(e.offsetX + 14, view.width - 200), 0) + "px";
    tip.style.top = e.offsetY + 14 + "px";
  }
  canvas.addEventListener("pointermove", point);
  canvas.addEventListener("pointerdown", point);
  canvas.addEventListener("pointerleave", () => ($("tip").hidden = true));

  // the table
  const best = data.winner == null ? 0 : rows[data.winner].mean_speed;
  const scored = rows.some((r) => r.worth && !r.worth.endsWith("m/s"));
  const head = ["", ...(scored ? ["result"] : []), "mean speed", "against winner", "last hit", "length", "dominoes", "friction", "push", "ended"];
  const table = $("table"), top = table.createTHead().insertRow();
  head.forEach((name) => { const th = document.createElement("th"); th.textContent = name; th.scope = "col"; top.append(th); });
  const body = table.createTBody();
  rows.forEach((row, k) => {
    const line = body.insertRow(), t = row.arrivals[row.arrivals.length - 1];
    const behind = !best || !row.mean_speed ? "–" : k === data.winner ? "winner" : (100 * (row.mean_speed / best - 1)).toFixed(2) + " %";
    const cells = [row.name, ...(scored ? [row.worth ?? "–"] : []), row.mean_speed ? row.mean_speed.toFixed(5) + " m/s" : "–", behind, t == null ? "never" : (t * 1000).toFixed(2) + " ms",
      row.positions[row.positions.length - 1].toFixed(4) + " m", row.thickness.length, row.friction, row.push.toFixed(2) + " rad/s", row.outcome];
    cells.forEach((text, j) => {
      const cell = line.insertCell();
      if (!j) { const dot = document.createElement("span"); dot.className = "swatch"; dot.style.background = `var(--c${k % 5})`; cell.append(dot); }
      cell.append(String(text));
    });
    const note = document.createElement("li");
    const lost = row.flush_loss < 5e-5 ? "less than 0.01" : (row.flush_loss * 100).toFixed(2);
    const flushes = !row.flushes ? "" : row.flushes === 1 ? ` One flush takes ${lost} % of the front's speed.`
      : ` ${row.flushes} flushes, the largest takes ${lost} % of the front's speed.`;
    note.textContent = `${row.name}: ${row.explanation} Relative error of the times below ${row.error.toExponential(0)}.${flushes}`;
    $("notes").append(note);
  });

  // charts
  let charts = [];
  const dashes = [[], [7, 4], [2, 3], [9, 3, 2, 3], [14, 4]];
  const axis = () => ({ stroke: css("--soft"), grid: { stroke: css("--line"), width: 0.5 }, ticks: { stroke: css("--line") } });
  const short = (v) => (Math.abs(v) >= 1e6 ? +(v / 1e6).toFixed(2) + " M" : Math.abs(v) >= 1e4 ? +(v / 1e3).toFixed(2) + " k" : String(+v.toPrecision(6)));
  // a piece of the line itself
  function swatch(k) {
    const line = `<svg xmlns="http://www.w3.org/2000/svg" width="34" height="8"><path d="M0 4H34" stroke="${colour(k)}" stroke-width="2.5" stroke-dasharray="${dashes[k % 5].join(" ")}"/></svg>`;
    return `url("data:image/svg+xml,${encodeURIComponent(line)}") no-repeat left center`;
  }
  function chart(id, x, series, label, logarithmic = false) {
    const box = $(id);
    box.textContent = "";
    const plot = new uPlot({
      width: Math.max(box.clientWidth, 240), height: 240, scales: { x: { time: false, ...(logarithmic ? { distr: 3, log: 10 } : {}) } },
      axes: [{ ...axis(), label, labelSize: 20, labelFont: "12px system-ui", font: "12px system-ui", values: (u, ticks) => ticks.map((v) => (v == null ? "" : short(v))) }, { ...axis(), font: "12px system-ui" }],
      legend: { markers: { width: 0, fill: (u, i) => swatch(series[i - 1].colour ?? i - 1) } },
      series: [{ label, value: (u, v) => (v == null ? "" : String(+v.toPrecision(4))) },
        ...series.map((s, k) => ({ label: s.name, stroke: colour(s.colour ?? k), width: 2, dash: dashes[(s.colour ?? k) % 5], points: { show: false }, paths: s.steps ? uPlot.paths.stepped({ align: 1 }) : undefined, value: (u, v) => (v == null ? "" : v.toPrecision(4)) }))],
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
    const [t, kinetic] = joined(rows.map((r) => ({ x: r.kinetic[0], y: r.kinetic[1] })));
    chart("kinetic", t, rows.map((r, k) => ({ name: r.name, values: kinetic[k].map((v) => (v == null ? null : v * 1000)) })), "time [s]");
    const e = rows[0].energy, milli = (v) => v.map((q) => q * 1000);
    $("budgetname").textContent = `Where the energy goes: ${rows[0].name} [mJ]`;
    chart("budget", e.time, [{ name: "given by gravity", values: milli(e.released) }, { name: "kinetic", values: milli(e.kinetic) },
      { name: "lost to hits", values: milli(e.hits) }, { name: "lost to friction", values: milli(e.friction) },
      ...(rows[0].flushes ? [{ name: "lost to flushes", values: milli(e.flushes) }] : [])], "time [s]");
    curves("search", "Search: best score so far", (r) => r.trace, true, "seconds of search");
    curves("learning", "Learning: score of the agent's row as it trains", (r) => r.learning, false, "dominoes placed");
    const side = rows.flatMap((r, k) => {
      if (!r.verification || !r.verification.model) return [];
      const over = (times) => numbers.map((i) => (times[i + 1] == null || r.verification.model[i + 1] == null ? null : 100 * (times[i + 1] / r.verification.model[i + 1] - 1)));
      return r.verification.times.map(([name, times], j) => ({ name: `${r.name}, ${name}`, values: over(times), colour: k + 2 * j }));
    });
    $("checkedbox").hidden = !side.length;
    if (side.length) chart("checked", numbers.map((i) => i + 1), side, "domino");
  }
  // a best-so-far (in steps) or a learning curve of every row that has one
  function curves(id, name, of, steps, label) {
    const found = rows.map((r, k) => ({ r, k, c: of(r) })).filter(({ c }) => c && c[0].length);
    $(id + "box").hidden = !found.length;
    if (!found.length) return;
    const [x, y] = joined(found.map(({ c }) => ({ x: c[0], y: c[1], hold: steps })));
    const unit = found[0].r.unit;
    $(id + "name").textContent = name + (unit ? ` [${unit}]` : "");
    // below zero are rows that died: how far they came is no speed to draw beside the others
    chart(id, x, found.map(({ r, k }, j) => ({ name: r.name, colour: k, steps, values: y[j].map((v) => (v != null && v < 0 ? null : v)) })), label, steps && x[0] > 0 && x[x.length - 1] > 30 * x[0]);
  }
  const checked = rows.filter((r) => r.verification);
  if (checked.length) {
    $("verifybox").hidden = false;
    const share = (v) => (v == null ? "never" : (v > 0 ? "+" : "") + (100 * v).toFixed(3) + " %");
    checked.forEach((r) => {
      const v = r.verification, line = document.createElement("li");
      const last = v.last.map(([name, value]) => `${name} ${share(value)}`).join(", ");
      line.textContent = `${r.name}: ${v.verdict} Last hit against ours: ${last} (${v.judge}).`;
      $("verify").append(line);
    });
  }

  // all numbers, for those who would rather read, or cannot see the canvas; filled when opened
  $("numbers").addEventListener("toggle", () => {
    const box = $("each");
    if (box.childElementCount) return;
    rows.forEach((row) => {
      const table = document.createElement("table");
      table.createCaption().textContent = row.name;
      const top = table.createTHead().insertRow();
      ["domino", "gap [mm]", "thickness [mm]", "hit at [ms]", "local speed [m/s]"].forEach((name) => { const th = document.createElement("th"); th.scope = "col"; th.textContent = name; top.append(th); });
      const body = table.createTBody(), fixed = (v, f, n) => (v == null ? "–" : (v * f).toFixed(n));
      row.thickness.forEach((d, i) => {
        const line = body.insertRow();
        [i, fixed(row.spacing[i], 1000, 2), fixed(d, 1000, 2), fixed(row.arrivals[i], 1000, 2), fixed(i ? row.speed[i - 1] : null, 1, 3)].forEach((text) => { line.insertCell().textContent = text; });
      });
      box.append(table);
    });
  });

  function all() { resize(); draw(); drawCharts(); }
  window.addEventListener("resize", all);
  // paper is white and narrow whatever the screen is
  const onPaper = (on) => () => { document.documentElement.classList.toggle("paper", on); all(); };
  window.addEventListener("beforeprint", onPaper(true));
  window.addEventListener("afterprint", onPaper(false));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", all);
  window.race = { rows, end, leans, leader, go, play, now: () => now, playing: () => playing, view: () => view };
  all();
})();
