"use strict";
// Report page: texts, tables, charts, and an animation on a canvas. The lean of each domino is
// computed from that of the leader by the contacts of the model.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const $ = (id) => document.getElementById(id);
  const compared = data.compared;
  const end = Math.max(...compared.map((entry) => entry.end));
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colour = (k) => css("--c" + (k % 5));
  let now = 0, playing = false, lastStamp = null; // [s] shown instant; [ms] of the last frame

  $("winner").textContent = data.headline.winner;
  $("results").textContent = data.headline.results;

  // lowest ground [m], and height of the highest above it [m]
  for (const entry of compared) {
    entry.lowest = Math.min(...entry.ground.line.map(([, z]) => z));
    entry.relief = Math.max(...entry.ground.line.map(([, z]) => z)) - entry.lowest;
  }

  const canvas = $("comparison"), pen = canvas.getContext("2d");
  // pixels per metre k; in pixels: height of the strip of each layout, width of all, margin at the left;
  // see resize
  let view = { k: 1, strip: 100, width: 100, left: 10 };
  const longest = Math.max(...compared.map((entry) => entry.ground.x[entry.ground.x.length - 1]));
  const relief = Math.max(...compared.map((entry) => entry.relief));
  const heights = compared.flatMap((entry) => entry.height).sort((a, b) => a - b);
  const tallest = heights[heights.length - 1], median = heights[heights.length >> 1];
  const reach = longest + 1.15 * tallest + 0.01; // [m] to the tip of the last domino when it lies

  // A layout too long for the screen is drawn larger and followed, with a map of the whole under it.
  function resize() {
    const width = canvas.clientWidth, ratio = window.devicePixelRatio || 1, left = 18;
    const fit = (width - 2 * left) / reach; // pixels per metre at which all layouts fit
    // dominoes are at least 28 pixels high, if no domino is then higher than 160
    const k = Math.max(fit, Math.min(28 / median, 160 / tallest));
    const follows = k > 1.05 * fit, head = width < 560 ? 46 : 30;
    // if the relief is higher than this, the picture follows it as well
    const room = Math.min(relief * (follows ? k : fit), 260);
    const strip = head + Math.max(tallest * (follows ? k : fit), 14) + room + (follows ? 22 : 14);
    view = { k: follows ? k : fit, fit, follows, strip, head, width, left, room, shift: 0 };
    canvas.style.height = strip * compared.length + "px";
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(strip * compared.length * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  // y of the first pivot of layout k on the canvas [px]
  function floorOf(k) {
    const entry = compared[k], room = view.room / view.k, z = wavePosition(entry, now, entry.ground.z);
    const lowest = Math.max(entry.lowest, Math.min(z - 0.5 * room, entry.lowest + entry.relief - room));
    return (k + 1) * view.strip - (view.follows ? 16 : 8) + lowest * view.k;
  }

  // corners of domino i on the canvas [px]
  function corners(entry, i, lean, floor) {
    const { k, left, shift } = view, x = left - shift + (entry.ground.x[i] + entry.thickness[0]) * k;
    floor -= entry.ground.z[i] * k;
    const ux = Math.sin(lean) * entry.height[i] * k, uy = -Math.cos(lean) * entry.height[i] * k;
    const bx = -Math.cos(lean) * entry.thickness[i] * k, by = -Math.sin(lean) * entry.thickness[i] * k;
    return [[x, floor], [x + ux, floor + uy], [x + ux + bx, floor + uy + by], [x + bx, floor + by]];
  }

  // points of the ground on the canvas [px], straight beyond the ends of the layout
  function groundLine(entry, floor) {
    const { k, left, shift } = view, { line, tilt } = entry.ground, beyond = 2 * view.width;
    const points = line.map(([x, z]) => [left - shift + (x + entry.thickness[0]) * k, floor - z * k]);
    const [[x, y], [u, v]] = [points[0], points[points.length - 1]];
    return [[x - beyond, y - beyond * Math.tan(tilt[0])], ...points, [u + beyond, v + beyond * Math.tan(tilt[tilt.length - 1])]];
  }

  // draws a dashed line at the last pivot
  function drawFinish(entry, floor) {
    const n = entry.ground.x.length - 1, y = floor - entry.ground.z[n] * view.k;
    const x = view.left - view.shift + (entry.ground.x[n] + entry.thickness[0]) * view.k;
    pen.strokeStyle = css("--ink"); pen.setLineDash([4, 4]);
    pen.beginPath(); pen.moveTo(x, y - 1.15 * tallest * view.k); pen.lineTo(x, y + 4); pen.stroke();
    pen.setLineDash([]);
  }

  function draw() {
    pen.clearRect(0, 0, view.width, canvas.height);
    if (view.follows) {
      const waves = compared.map((entry) => wavePosition(entry, now));
      const middle = 0.5 * (Math.min(...waves) + Math.max(...waves)) * view.k;
      view.shift = Math.min(Math.max(middle - 0.55 * view.width, 0), reach * view.k - view.width + 2 * view.left);
    }
    compared.forEach((entry, k) => {
      const floor = floorOf(k), all = leans(entry, now), [leading] = leader(entry, now);
      const done = entry.mean_speed > 0 && now >= entry.arrivals[entry.arrivals.length - 1];
      pen.strokeStyle = css("--line"); pen.lineWidth = 1;
      pen.beginPath(); groundLine(entry, floor).forEach(([x, y]) => pen.lineTo(x, y)); pen.stroke();
      all.forEach((lean, i) => {
        const c = corners(entry, i, lean, floor);
        if (c.every(([x]) => x < 0) || c.every(([x]) => x > view.width)) return;
        pen.fillStyle = i === leading && !done ? css("--leader") : i <= leading ? colour(k) : css("--standing");
        pen.beginPath(); c.forEach(([x, y], j) => (j ? pen.lineTo(x, y) : pen.moveTo(x, y)));
        pen.closePath(); pen.fill();
      });
      drawFinish(entry, floor);
      if (view.follows) drawMap(entry, k);
      const top = k * view.strip;
      pen.fillStyle = colour(k); pen.fillRect(12, top + 11, 11, 11);
      pen.fillStyle = css("--ink"); pen.font = "600 14px system-ui, sans-serif"; pen.textAlign = "left";
      pen.fillText(entry.name, 29, top + 21);
      pen.font = "14px system-ui, sans-serif";
      const narrow = view.width < 560;
      if (!narrow) pen.textAlign = "right";
      pen.fillText(statusText(entry, k, leading, done), narrow ? 29 : view.width - 12, top + (narrow ? 39 : 21));
    });
    $("clock").textContent = `${(now * 1000).toFixed(0)} ms`;
    $("scrub").value = String(Math.round((now / end) * 1000));
    $("scrub").setAttribute("aria-valuetext", $("clock").textContent);
  }

  // result of a wave that is done or not begun, else how far it has come
  function statusText(entry, k, leading, done) {
    if (done || (now === 0 && entry.mean_speed > 0)) {
      const length = `${(1000 * entry.positions[entry.positions.length - 1]).toFixed(0)} mm`;
      const time = done ? ` in ${entry.arrivals[entry.arrivals.length - 1].toFixed(3)} s` : "";
      return `${length}${time}, ${entry.mean_speed.toFixed(4)} m/s` + (k === data.best ? "  ★ best" : "");
    }
    if (now >= entry.end) return entry.outcome;
    const count = `${leading + 1} of ${entry.thickness.length} hit`;
    return leading > 0 ? `${count}   ${(entry.positions[leading] / entry.arrivals[leading]).toFixed(3)} m/s so far` : count;
  }

  // draws the whole layout as a line, the part in view as a box on it, and the place of the wave
  function drawMap(entry, k) {
    const y = (k + 1) * view.strip - 8, scale = view.fit, from = view.left;
    pen.fillStyle = css("--line");
    pen.fillRect(from, y, entry.ground.x[entry.ground.x.length - 1] * scale, 4);
    pen.fillStyle = colour(k);
    pen.fillRect(from, y, wavePosition(entry, now) * scale, 4);
    pen.strokeStyle = css("--soft");
    pen.strokeRect(from + (view.shift / view.k) * scale, y - 2, ((view.width - 2 * view.left) / view.k) * scale, 8);
  }

  function go(t) { now = Math.min(Math.max(t, 0), end); draw(); }
  function play(on) {
    if (on && now >= end) now = 0;
    playing = on; lastStamp = null;
    $("play").textContent = on ? "Pause" : "Play";
    if (on) requestAnimationFrame(tick);
  }
  function tick(stamp) {
    if (!playing) return;
    if (lastStamp !== null) go(now + (stamp - lastStamp) / 1000 / Number($("slow").value));
    lastStamp = stamp;
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

  // shows the numbers of the domino nearest to the pointer, if it is within 30 pixels
  function showNearest(e) {
    const k = Math.floor(e.offsetY / view.strip), entry = compared[k], tip = $("tip");
    if (!entry) { tip.hidden = true; return; }
    const all = leans(entry, now), floor = floorOf(k);
    let near = 0, least = Infinity;
    all.forEach((lean, i) => {
      const c = corners(entry, i, lean, floor);
      const x = c.reduce((a, q) => a + q[0], 0) / 4, y = c.reduce((a, q) => a + q[1], 0) / 4;
      const distance = Math.hypot(x - e.offsetX, (y - e.offsetY) / 2);
      if (distance < least) { least = distance; near = i; }
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
  canvas.addEventListener("pointermove", showNearest);
  canvas.addEventListener("pointerdown", showNearest);
  canvas.addEventListener("pointerleave", () => ($("tip").hidden = true));

  // the table
  const signed = (x) => {
    const rounded = Math.round(1e4 * x) / 100 + 0; // + 0: no negative zero
    return (rounded > 0 ? "+" : "") + rounded.toFixed(2) + " %";
  };
  // gains are over the last layout that completes, the uniform baseline if there is a scene
  const base = compared.findLast((entry) => entry.mean_speed > 0);
  const gains = base && compared.length > 1 && compared.every((entry) => entry.quantity.startsWith("score"));
  // scores that are not speeds have a column of their texts
  const scored = compared.some((entry) => entry.score_text && !entry.score_text.endsWith("m/s"));
  const head = ["layout", ...(scored ? ["result"] : []), "mean speed", ...(gains ? [`gain over ${base.name}`] : []), "last hit", "length", "dominoes", "friction", "push", "outcome"];
  const table = $("table"), top = table.createTHead().insertRow();
  head.forEach((name) => { const th = document.createElement("th"); th.textContent = name; th.scope = "col"; top.append(th); });
  const body = table.createTBody();
  compared.forEach((entry, k) => {
    const line = body.insertRow(), t = entry.arrivals[entry.arrivals.length - 1];
    const gain = !entry.mean_speed ? "–" : entry === base ? "0" : signed(entry.mean_speed / base.mean_speed - 1);
    const cells = [entry.name, ...(scored ? [entry.score_text ?? "–"] : []), entry.mean_speed ? entry.mean_speed.toFixed(5) + " m/s" : "–", ...(gains ? [gain] : []), t == null ? "never" : (t * 1000).toFixed(2) + " ms",
      entry.positions[entry.positions.length - 1].toFixed(4) + " m", entry.thickness.length, entry.friction, entry.push.toFixed(2) + " rad/s", entry.outcome];
    cells.forEach((text, j) => {
      const cell = line.insertCell();
      if (!j) { const dot = document.createElement("span"); dot.className = "swatch"; dot.style.background = `var(--c${k % 5})`; cell.append(dot); }
      cell.append(String(text));
    });
    const note = document.createElement("li");
    const lost = entry.flush_loss < 5e-5 ? "less than 0.01" : (entry.flush_loss * 100).toFixed(2);
    const flushes = !entry.flushes ? "" : entry.flushes === 1 ? ` There is one face impact, in which two faces come to lie on each other; the leading domino loses ${lost} % of its speed.`
      : ` There are ${entry.flushes} face impacts, in which two faces come to lie on each other; in the largest the leading domino loses ${lost} % of its speed.`;
    note.textContent = `${entry.name}: ${entry.explanation} The estimated relative error of the times is ${entry.error.toExponential(0)}.${flushes}`;
    $("notes").append(note);
  });

  // charts
  let charts = [];
  const dashes = [[], [7, 4], [2, 3], [9, 3, 2, 3], [14, 4]];
  const axis = () => ({ stroke: css("--soft"), grid: { stroke: css("--line"), width: 0.5 }, ticks: { stroke: css("--line") } });
  const short = (v) => (Math.abs(v) >= 1e6 ? +(v / 1e6).toFixed(2) + " M" : Math.abs(v) >= 1e4 ? +(v / 1e3).toFixed(2) + " k" : String(+v.toPrecision(6)));
  // a piece of curve k for the legend
  function swatch(k) {
    const line = `<svg xmlns="http://www.w3.org/2000/svg" width="34" height="8"><path d="M0 4H34" stroke="${colour(k)}" stroke-width="2.5" stroke-dasharray="${dashes[k % 5].join(" ")}"/></svg>`;
    return `url("data:image/svg+xml,${encodeURIComponent(line)}") no-repeat left center`;
  }
  // draws series over x in the box `id`; label: of the x axis; logarithmic, upright: x, y is logarithmic
  function chart(id, x, series, label, logarithmic = false, upright = false) {
    const box = $(id);
    box.textContent = "";
    const plot = new uPlot({
      width: Math.max(box.clientWidth, 240), height: 240, scales: { x: { time: false, ...(logarithmic ? { distr: 3, log: 10 } : {}) }, y: upright ? { distr: 3, log: 10 } : {} },
      axes: [{ ...axis(), label, labelSize: 20, labelFont: "12px system-ui", font: "12px system-ui", values: (u, ticks) => ticks.map((v) => (v == null ? "" : short(v))) }, { ...axis(), font: "12px system-ui", ...(upright ? { size: 76, values: (u, ticks) => ticks.map((v) => (v == null ? "" : short(v))) } : {}) }],
      legend: { markers: { width: 0, fill: (u, i) => swatch(series[i - 1].colour ?? i - 1) } },
      series: [{ label, value: (u, v) => (v == null ? "" : String(+v.toPrecision(4))) },
        ...series.map((s, k) => ({ label: s.name, stroke: colour(s.colour ?? k), width: 2, dash: dashes[(s.colour ?? k) % 5], points: { show: false }, paths: s.steps ? uPlot.paths.stepped({ align: 1 }) : undefined, value: (u, v) => (v == null ? "" : v.toPrecision(4)) }))],
    }, [x, ...series.map((s) => s.values)], box);
    box.setAttribute("role", "img");
    box.setAttribute("aria-label", series.map((s) => { const v = s.values.filter((q) => q != null); return `${s.name}: from ${v.length ? Math.min(...v).toPrecision(3) : "–"} to ${v.length ? Math.max(...v).toPrecision(3) : "–"}`; }).join("; "));
    charts.push(plot);
  }
  // curves with different x on the union of all x; with `hold` y is constant from x to x, else interpolated
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
    const most = Math.max(...compared.map((entry) => entry.spacing.length)), numbers = [...Array(most).keys()];
    const padded = (v, f) => numbers.map((i) => (v[i] == null ? null : v[i] * f));
    chart("gaps", numbers, compared.map((entry) => ({ name: entry.name, values: padded(entry.spacing, 1000) })), "domino");
    chart("speeds", numbers.map((i) => i + 1), compared.map((entry) => ({ name: entry.name, values: padded(entry.speed, 1) })), "domino");
    const [t, kinetic] = joined(compared.map((entry) => ({ x: entry.kinetic[0], y: entry.kinetic[1] })));
    chart("kinetic", t, compared.map((entry, k) => ({ name: entry.name, values: kinetic[k].map((v) => (v == null ? null : v * 1000)) })), "time [s]");
    const e = compared[0].energy, milli = (v) => v.map((q) => q * 1000);
    $("energyname").textContent = `Energy balance: ${compared[0].name} [mJ]`;
    chart("energy", e.time, [{ name: "released by gravity", values: milli(e.released) }, { name: "kinetic", values: milli(e.kinetic) },
      { name: "lost in hits", values: milli(e.hits) }, { name: "lost to friction", values: milli(e.friction) },
      ...(compared[0].flushes ? [{ name: "lost in face impacts", values: milli(e.flushes) }] : [])], "time [s]");
    drawRuns("search", "Best layout of the search", (entry) => entry.trace, true, "seconds of search");
    drawRuns("learning", "Policy in training", (entry) => entry.learning, false, "dominoes placed");
  }
  // returns true if values differ by more than a factor of 20
  function wide(values) {
    const known = values.filter((v) => v != null);
    return Math.max(...known) > 20 * Math.min(...known);
  }
  // draws the curve that `curveOf` returns for each layout that has one; the best score so far is a step function
  function drawRuns(id, name, curveOf, steps, label) {
    const runs = compared.map((entry, k) => ({ entry, k, curve: curveOf(entry) })).filter(({ curve }) => curve && curve[0].length);
    $(id + "box").hidden = !runs.length;
    if (!runs.length) return;
    const [x, y] = joined(runs.map(({ curve }) => ({ x: curve[0], y: curve[1], hold: steps })));
    const quantity = runs[0].entry.quantity;
    $(id + "name").textContent = `${name}: ${quantity}`;
    // scores below zero are of waves that stop; they are left out
    chart(id, x, runs.map(({ entry, k }, j) => ({ name: entry.name, colour: k, steps, values: y[j].map((v) => (v != null && v < 0 ? null : v)) })), label, steps && x[0] > 0 && x[x.length - 1] > 30 * x[0],
      !quantity.startsWith("score") && wide(y.flat()));
  }
  const verified = compared.filter((entry) => entry.verification);
  if (verified.length) {
    $("verifybox").hidden = false;
    const percent = (v) => (v == null ? "never hit" : (v > 0 ? "+" : "") + (100 * v).toFixed(3) + " %");
    verified.forEach((entry) => {
      const v = entry.verification, line = document.createElement("li");
      const last = v.last.map(([name, value]) => `${name} ${percent(value)}`).join(", ");
      line.textContent = `${entry.name}: ${v.verdict} Time of the last hit relative to the model: ${last} (${v.simulator}).`;
      $("verify").append(line);
    });
  }

  // tables of all dominoes, filled when they are opened
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

  function refresh() { resize(); draw(); drawCharts(); }
  window.addEventListener("resize", refresh);
  // a printed page is white and narrow on any screen
  const onPaper = (on) => () => { document.documentElement.classList.toggle("paper", on); refresh(); };
  window.addEventListener("beforeprint", onPaper(true));
  window.addEventListener("afterprint", onPaper(false));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", refresh);
  window.comparison = { compared, end, leans, leader, go, play, now: () => now, playing: () => playing, view: () => view };
  refresh();
})();
