"use strict";
// Motion of a toppling layout from its data (`motion_data` of domino_env/view/comparison.py), for the
// report and the studio.

// index of the leader at time t [s], and its lean [rad]
function leader(entry, t) {
  let n = 0;
  while (n + 1 < entry.hit && entry.arrivals[n + 1] <= t) n++;
  const from = entry.arrivals[n], to = n + 1 < entry.hit ? entry.arrivals[n + 1] : entry.end;
  const samples = entry.falls[n], last = samples.length - 1;
  const x = to > from ? Math.min(Math.max((t - from) / (to - from), 0), 1) * last : 0;
  const i = Math.min(Math.floor(x), last - 1);
  return [n, samples[i] + (samples[i + 1] - samples[i]) * (x - i)];
}

// leans of all dominoes from the vertical [rad], as in domino_env/physics/motion.py: a contact is
// first at the tip, then the front face rests on the rear edge, until it separates
function leans(entry, t) {
  const { tilt, steps } = entry.ground, all = [...tilt];
  const [n, angle] = leader(entry, t);
  let lean = all[n] = angle;
  for (let i = n - 1; i >= 0; i--) {
    const h = entry.height[i], d = entry.thickness[i + 1] / h, p = entry.spacing[i] / h + d, e = steps[i] / h;
    const r = Math.hypot(p, e), slant = Math.atan2(e, p), stand = tilt[i + 1];
    const separation = Math.acos(Math.min(Math.max((r * r + d * d - 1) / (2 * d * r), -1), 1)) - slant;
    const turn = Math.min(lean - stand, separation), gap = r * Math.cos(turn + slant) - d;
    if (gap < 0) lean = Math.atan2(p - d * Math.cos(turn), e + d * Math.sin(turn));
    else lean = turn + Math.asin(Math.min(gap, 1));
    all[i] = lean += stand;
  }
  return all;
}

// x or z of the wave [m] at time t [s], interpolated between the pivots of two hits
function wavePosition(entry, t, coordinates = entry.ground.x) {
  const [n] = leader(entry, t), next = entry.arrivals[n + 1];
  if (next == null) return coordinates[n];
  const fraction = Math.min(Math.max((t - entry.arrivals[n]) / (next - entry.arrivals[n]), 0), 1);
  return coordinates[n] + fraction * (coordinates[n + 1] - coordinates[n]);
}
