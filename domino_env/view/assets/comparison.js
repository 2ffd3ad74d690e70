"use strict";
// Animation: leans of all dominoes from the leader's, by the contacts of the model, drawn on a canvas.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const compared = data.compared;
  const end = Math.max(...compared.map((r) => r.end));
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colour = (k) => css("--c" + (k % 5));
  let now = 0, playing = false, last = null;

  $("winner").textContent = data.headline.winner;
  $("results").textContent = data.headline.results;

  // leader at time t and its lean
  function leader(entry, t) {
    let n = 0;
    while (n + 1 < entry.hit && entry.arrivals[n + 1] <= t) n++;
    const from = entry.arrivals[n], to = n + 1 < entry.hit ? entry.arrivals[n + 1] : entry.end;
    const looks = entry.falls[n], last = looks.length - 1;
    const x = to > from ? Math.min(Math.max((t - from) / (to - from), 0), 1) * last : 0;
    const i = Math.min(Math.floor(x), last - 1);
    return [n, looks[i] + (looks[i + 1] - looks[i]) * (x - i)];
  }

  // heights of the ground
  for (const entry of compared) {
    entry.lowest = Math.min(...entry.ground.line.map(([, z]) => z));
    entry.relief = Math.max(...entry.ground.line.map(([, z]) => z)) - entry.lowest;
  }

  // every lean from the vertical [rad]; contacts as in domino_env/physics/motion.py, each seen
  // from the ground of the domino ahead: tip, then front face on rear edge, then separated
  function leans(entry, t) {
    const { tilt, steps } = entry.ground, all = [...tilt];
    const [n, angle] = leader(entry, t);
    let lean = all[n] = angle;
    for (let i = n - 1; i >= 0; i--) {
      const h = entry.height[i], d = entry.thickness[i + 1] / h, p = entry.spacing[i] / h + d, e = steps[i] / h;
      const reach = Math.hypot(p, e), slant = Math.atan2(e, p), stand = tilt[i + 1];
      const lost = Math.acos(Math.min(Math.max((reach * reach + d * d - 1) / (2 * d * reach), -1), 1)) - slant;
      const turn = Math.min(lean - stand, lost), gap = reach * Math.cos(turn + slant) - d;
      if (gap < 0) lean = Math.atan2(p - d * Math.cos(turn), e + d * Math.sin(turn));
      else lean = turn + Math.asin(Math.min(gap, 1));
      all[i] = lean += stand;
    }
    return all;
  }

  const canvas = $("comparison"), pen = canvas.getContext("2d");
  let view = { k: 1, lane: 100, width: 100, left: 10 };
  const longest = Math.max(...compared.map((r) => r.ground.x[r.ground.x.length - 1]));
  const relief = Math.max(...compared.map((r) => r.relief));
  const heights = compared.flatMap((r) => r.height).sort((a, b) => a - b);
  const tallest = heights[heights.length - 1], usual = heights[heights.length >> 1];

  // A layout too long for the screen is drawn larger and followed, with a map of the whole under it.
  function resize() {
    const width = canvas.clientWidth, ratio = window.devicePixelRatio || 1, left = 18;
    const reach = longest + 1.15 * tallest + 0.01, fit = (width - 2 * left) / reach;
    const k = Math.max(fit, Math.min(28 / usual, 160 / tallest));
    const follows = k > 1.05 * fit, head = width < 560 ? 46 : 30;
    // a relief too high is followed as well
    const room = Math.min(relief * (follows ? k : fit), 260);
    const lane = head + Math.max(tallest * (follows ? k : fit), 14) + room + (follows ? 22 : 14);
    view = { k: follows ? k : fit, fit, follows, lane, head, width, left, room, shift: 0 };
    canvas.style.height = lane * compared.length + "px";
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(lane * compared.length * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  // place of the leader [m], x or z, interpolated between two hits
  function reached(entry, t, along = entry.ground.x) {
    const [n] = leader(entry, t), next = entry.arrivals[n + 1];
    if (next == null) return along[n];
    const share = Math.min(Math.max((t - entry.arrivals[n]) / (next - entry.arrivals[n]), 0), 1);
    return along[n] + share * (along[n + 1] - along[n]);
  }

  // height of the first pivot on the screen
  function floorOf(k) {
    const entry = compared[k], room = view.room / view.k, z = reached(entry, now, entry.ground.z);
    const lowest = Math.max(entry.lowest, Math.min(z - 0.5 * room, entry.lowest + entry.relief - room));
    return (k + 1) * view.lane - (view.follows ? 16 : 8) + lowest * view.k;
  }

  function corners(entry, i, lean, floor) {
    const { k, left, shift } = view, x = left - shift + (entry.ground.x[i] + entry.thickness[0]) * k;
    floor -= entry.ground.z[i] * k;
    const ux = Math.sin(lean) * entry.height[i] * k, uy = -Math.cos(lean) * entry.height[i] * k;
    const bx = -Math.cos(lean) * entry.thickness[i] * k, by = -Math.sin(lean) * entry.thickness[i] * k;
    return [[x, floor], [x + ux, floor + uy], [x + ux + bx, floor + uy + by], [x + bx, floor + by]];
  }

  // the line under a layout, straight beyond its ends
  function groundLine(entry, floor) {
    const { k, left, shift } = view, { line, tilt } = entry.ground, far = 2 * view.width;
    const on = line.map(([x, z]) => [left - shift + (x + entry.thickness[0]) * k, floor - z * k]);
    const [[x, y], [u, v]] = [on[0], on[on.length - 1]];
    return [[x - far, y - far * Math.tan(tilt[0])], ...on, [u + far, v + far * Math.tan(tilt[tilt.length - 1])]];
  }

  // a dashed line at the last pivot, with the length of the layout
  function finish(entry, floor) {
    const n = entry.ground.x.length - 1, y = floor - entry.ground.z[n] * view.k;
    const x = view.left - view.shift + (entry.ground.x[n] + entry.thickness[0]) * view.k;
    pen.strokeStyle = css("--ink"); pen.setLineDash([4, 4]);
    pen.beginPath(); pen.moveTo(x, y - 1.15 * tallest * view.k); pen.lineTo(x, y + 4); pen.stroke();
    pen.setLineDash([]);
  }

  function draw() {
    pen.clearRect(0, 0, view.width, canvas.height);
    if (view.follows) {
      const fronts = compared.map((r) => reached(r, now)), whole = (longest + 1.15 * tallest + 0.01) * view.k;
      const middle = 0.5 * (Math.min(...fronts) + Math.max(...fronts)) * view.k;
      view.shift = Math.min(Math.max(middle - 0.55 * view.width, 0), whole - view.width + 2 * view.left);
    }
    compared.forEach((entry, k) => {
      const floor = floorOf(k), all = leans(entry, now), [front] = leader(entry, now);
      const done = entry.mean_speed > 0 && now >= entry.arrivals[entry.arrivals.length - 1];
      pen.strokeStyle = css("--line"); pen.lineWidth = 1;
      pen.beginPath(); groundLine(entry, floor).forEach(([x, y]) => pen.lineTo(x, y)); pen.stroke();
      all.forEach((lean, i) => {
        const c = corners(entry, i, lean, floor);
        if (c.every(([x]) => x < 0) || c.every(([x]) => x > view.width)) return;
        pen.fillStyle = i === front && !done ? css("--front") : i <= front ? colour(k) : css("--stand");
        pen.beginPath(); c.forEach(([x, y], j) => (j ? pen.lineTo(x, y) : pen.moveTo(x, y)));
        pen.closePath(); pen.fill();
      });
      finish(entry, floor);
      if (view.follows) map(entry, k);
      const top = k * view.lane;
      pen.fillStyle = colour(k); pen.fillRect(12, top + 11, 11, 11);
      pen.fillStyle = css("--ink"); pen.font = "600 14px system-ui, sans-serif"; pen.textAlign = "left";
      pen.fillText(entry.name, 29, top + 21);
      pen.font = "14px system-ui, sans-serif";
      const narrow = view.width < 560;
      if (!narrow) pen.textAlign = "right";
      pen.fillText(state(entry, k, front, done), narrow ? 29 : view.width - 12, top + (narrow ? 39 : 21));
    });
    $("clock").textContent = `${(now * 1000).toFixed(0)} ms`;
    $("scrub").value = String(Math.round((now / end) * 1000));
    $("scrub").setAttribute("aria-valuetext", $("clock").textContent);
  }

  // state of a wave in a few words
  function state(entry, k, front, done) {
    if (done || (now === 0 && entry.mean_speed > 0)) {
      const length = `${(1000 * entry.positions[entry.positions.length - 1]).toFixed(0)} mm`;
      const time = done ? ` in ${entry.arrivals[entry.arrivals.length - 1].toFixed(3)} s` : "";
      return `${length}${time}, ${entry.mean_speed.toFixed(4)} m/s` + (k === data.best ? "  ★ best" : "");
    }
    if (now >= entry.end) return entry.outcome;
    const count = `${front + 1} of ${entry.thickness.length}`;
    return front > 0 ? `${count}   ${(entry.positions[front] / entry.arrivals[front]).toFixed(3)} m/s so far` : count;
  }

  // the whole layout as a line, the part in view as a box on it, and the place of the wave
  function map(entry, k) {
    const y = (k + 1) * view.lane - 8, scale = view.fit, from = view.left;
    pen.fillStyle = css("--line");
    pen.fillRect(from, y, entry.ground.x[entry.ground.x.length - 1] * scale, 4);
    pen.fillStyle = colour(k);
    pen.fillRect(from, y, reached(entry, now) * scale, 4);
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
    const k = Math.floor(e.offsetY / view.lane), entry = compared[k], tip = $("tip");
    if (!entry) { tip.hidden = true; return; }
    const all = leans(entry, now), floor = floorOf(k);
    let near = 0, least = Infinity;
    all.forEach((lean, i) => {
      const c = corners(entry, i, lean, floor);
      const x = c.reduce((a, q) => a + q[0], 0) / 4, y = c.reduce((a, q) => a + q[1], 0) / 4;
      const far = Math.hypot(x - e.offsetX, (y - e.offsetY) / 2);
      if (far < least) { least = far; near = i; }
    });
    if (least > 30) { tip.hidden = true; return; }
    const mm = (x) => (x == null ? "–" : (x * 1000).toFixed(2) + " mm");
    tip.textContent = `${entry.name}, domino ${near}\ngap in front ${mm(entry.spacing[near])}\nthickness ${mm(entry.thickness[near])}\n` +
      (entry.arrivals[near] == null ? "never hit" : `hit at ${(entry.arrivals[near] * 1000).toFixed(2)} ms`) +
      (near && entry.speed[near - 1] ? `\nlocal speed ${entry.speed[near - 1].toFixed(3)} m/s` : "");
    tip.hidden = false;
    tip.style.left = Math.max(Math.min(e.offsetX + 14, view.width - 200), 0) + "px";
    tip.style.top = e.offsetY + 14 + "px";
  }
  canvas.addEventListener("pointermove", point);
  canvas.addEventListener("pointerdown", point);
  canvas.addEventListener("pointerleave", () => ($("tip").hidden = true));

  // the table
  const signed = (part) => (part > 0 ? "+" : "") + (100 * part).toFixed(2) + " %";
  // the last layout that completes, which is the uniform baseline of a scene, is the base of the headline too
  const base = compared.findLast((r) => r.mean_speed > 0);
  const scored = compared.some((r) => r.score_text && !r.score_text.endsWith("m/s"));
  const head = ["", ...(scored ? ["result"] : []), "mean speed", ...(base && compared.length > 1 ? [`gain over ${base.name}`] : []), "last hit", "length", "dominoes", "friction", "push", "ended"];
  const table = $("table"), top = table.createTHead().insertRow();
  head.forEach((name) => { const th = document.createElement("th"); th.textContent = name; th.scope = "col"; top.append(th); });
  const body = table.createTBody();
  compared.forEach((entry, k) => {
    const line = body.insertRow(), t = entry.arrivals[entry.arrivals.length - 1];
    const gain = !entry.mean_speed ? "–" : entry === base ? "0" : signed(entry.mean_speed / base.mean_speed - 1);
    const cells = [entry.name, ...(scored ? [entry.score_text ?? "–"] : []), entry.mean_speed ? entry.mean_speed.toFixed(5) + " m/s" : "–", ...(base && compared.length > 1 ? [gain] : []), t == null ? "never" : (t * 1000).toFixed(2) + " ms",
      entry.positions[entry.positions.length - 1].toFixed(4) + " m", entry.thickness.length, entry.friction, entry.push.toFixed(2) + " rad/s", entry.outcome];
    cells.forEach((text, j) => {
      const cell = line.insertCell();
      if (!j) { const dot = document.createElement("span"); dot.className = "swatch"; dot.style.background = `var(--c${k % 5})`; cell.append(dot); }
      cell.append(String(text));
    });
    const note = document.createElement("li");
    const lost = entry.flush_loss < 5e-5 ? "less than 0.01" : (entry.flush_loss * 100).toFixed(2);
    const flushes = !entry.flushes ? "" : entry.flushes === 1 ? ` Once two faces come to lie on each other (a face impact), which takes ${lost} % of the leading domino's speed.`
      : ` In ${entry.flushes} face impacts two faces come to lie on each other; the largest takes ${lost} % of the leading domino's speed.`;
    note.textContent = `${entry.name}: ${entry.explanation} Relative error of the times below ${entry.error.toExponential(0)}.${flushes}`;
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
    const most = Math.max(...compared.map((r) => r.spacing.length)), numbers = [...Array(most).keys()];
    const padded = (v, f) => numbers.map((i) => (v[i] == null ? null : v[i] * f));
    chart("gaps", numbers, compared.map((r) => ({ name: r.name, values: padded(r.spacing, 1000) })), "domino");
    chart("speeds", numbers.map((i) => i + 1), compared.map((r) => ({ name: r.name, values: padded(r.speed, 1) })), "domino");
    const [t, kinetic] = joined(compared.map((r) => ({ x: r.kinetic[0], y: r.kinetic[1] })));
    chart("kinetic", t, compared.map((r, k) => ({ name: r.name, values: kinetic[k].map((v) => (v == null ? null : v * 1000)) })), "time [s]");
    const e = compared[0].energy, milli = (v) => v.map((q) => q * 1000);
    $("budgetname").textContent = `Where the energy goes: ${compared[0].name} [mJ]`;
    chart("budget", e.time, [{ name: "given by gravity", values: milli(e.released) }, { name: "kinetic", values: milli(e.kinetic) },
      { name: "lost to hits", values: milli(e.hits) }, { name: "lost to friction", values: milli(e.friction) },
      ...(compared[0].flushes ? [{ name: "lost in face impacts", values: milli(e.flushes) }] : [])], "time [s]");
    curves("search", "Search: best score so far", (r) => r.trace, true, "seconds of search");
    curves("learning", "Learning: score of the agent's layout during training", (r) => r.learning, false, "dominoes placed");
  }
  // a best-so-far (in steps) or a learning curve of every layout that has one
  function curves(id, name, of, steps, label) {
    const found = compared.map((r, k) => ({ r, k, c: of(r) })).filter(({ c }) => c && c[0].length);
    $(id + "box").hidden = !found.length;
    if (!found.length) return;
    const [x, y] = joined(found.map(({ c }) => ({ x: c[0], y: c[1], hold: steps })));
    const unit = found[0].r.unit;
    $(id + "name").textContent = name + (unit ? ` [${unit}]` : "");
    // scores below zero belong to waves that stopped and are not speeds
    chart(id, x, found.map(({ r, k }, j) => ({ name: r.name, colour: k, steps, values: y[j].map((v) => (v != null && v < 0 ? null : v)) })), label, steps && x[0] > 0 && x[x.length - 1] > 30 * x[0]);
  }
  const checked = compared.filter((r) => r.verification);
  if (checked.length) {
    $("verifybox").hidden = false;
    const share = (v) => (v == null ? "never" : (v > 0 ? "+" : "") + (100 * v).toFixed(3) + " %");
    checked.forEach((r) => {
      const v = r.verification, line = document.createElement("li");
      const last = v.last.map(([name, value]) => `${name} ${share(value)}`).join(", ");
      line.textContent = `${r.name}: ${v.verdict} Last hit against ours: ${last} (${v.simulator}).`;
      $("verify").append(line);
    });
  }

  // all numbers as tables, filled when opened
  $("numbers").addEventListener("toggle", () => {
    const box = $("each");
    if (box.childElementCount) return;
    compared.forEach((entry) => {
      const table = document.createElement("table");
      table.createCaption().textContent = entry.name;
      const top = table.createTHead().insertRow();
      ["domino", "gap [mm]", "thickness [mm]", "hit at [ms]", "local speed [m/s]"].forEach((name) => { const th = document.createElement("th"); th.scope = "col"; th.textContent = name; top.append(th); });
      const body = table.createTBody(), fixed = (v, f, n) => (v == null ? "–" : (v * f).toFixed(n));
      entry.thickness.forEach((d, i) => {
        const line = body.insertRow();
        [i, fixed(entry.spacing[i], 1000, 2), fixed(d, 1000, 2), fixed(entry.arrivals[i], 1000, 2), fixed(i ? entry.speed[i - 1] : null, 1, 3)].forEach((text) => { line.insertCell().textContent = text; });
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
  window.comparison = { compared, end, leans, leader, go, play, now: () => now, playing: () => playing, view: () => view };
  all();
})();
