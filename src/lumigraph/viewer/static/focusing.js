// Where to focus so that a clicked thing is sharp.

import { viewShifts } from "./aperture.js";

const MOST_VIEWS = 169, MOST_PATCH = 7, STEPS = 65;

/** Refocus factor at which the views agree best around (t, s): least variance over the views, by a parabola. */
export function sharpestAlpha(views, numbers, [t, s]) {
  const [low, high] = views.focus, alphas = Array.from({ length: STEPS }, (_, k) => low + ((high - low) * k) / (STEPS - 1));
  const reach = Math.min(MOST_PATCH, Math.max(1, Math.round(Math.min(views.shape[2], views.shape[3]) / 12)));
  const seen = someViews(views);
  const costs = alphas.map((alpha) => disagreement(views, numbers, seen, [t, s, reach], alpha));
  return vertex(alphas, costs.map((cost) => -cost));
}

/** Up to 13 × 13 lit views, evenly spread. */
function someViews(views) {
  const [nv, nu] = views.shape, step = Math.max(1, Math.ceil(Math.sqrt((nv * nu) / MOST_VIEWS)));
  const found = [];
  for (let v = 0; v < nv; v += step) for (let u = 0; u < nu; u += step) if (views.lit[v * nu + u] === "1") found.push([v, u]);
  return found;
}

/** Variance over the views, summed over the patch. Places that a view does not show do not count for it. */
function disagreement(views, numbers, seen, [t, s, reach], alpha) {
  const [, nu, nt, ns] = views.shape, channels = views.channels, size = nt * ns * channels;
  const down = viewShifts(views, alpha, 0), right = viewShifts(views, alpha, 1);
  const side = 2 * reach + 1, count = side * side;
  const sum = new Float64Array(count), square = new Float64Array(count), met = new Float64Array(count);
  for (const [v, u] of seen) {
    const base = (v * nu + u) * size, y0 = t - reach + down.first + v * down.step, x0 = s - reach + right.first + u * right.step;
    const yf = y0 - Math.floor(y0), xf = x0 - Math.floor(x0);
    const w = [(1 - yf) * (1 - xf), (1 - yf) * xf, yf * (1 - xf), yf * xf];
    for (let j = 0; j < side; j++) {
      const y = Math.floor(y0) + j;
      if (y < 0 || y + 1 >= nt) continue;
      for (let i = 0; i < side; i++) {
        const x = Math.floor(x0) + i;
        if (x < 0 || x + 1 >= ns) continue;
        const a = base + (y * ns + x) * channels + (channels === 3 ? 1 : 0), b = a + ns * channels; // green, or grey
        const value = w[0] * numbers[a] + w[1] * numbers[a + channels] + w[2] * numbers[b] + w[3] * numbers[b + channels];
        const k = j * side + i;
        sum[k] += value; square[k] += value * value; met[k] += 1;
      }
    }
  }
  let total = 0, places = 0;
  for (let k = 0; k < count; k++) {
    if (met[k] < seen.length / 2) continue;
    total += square[k] / met[k] - (sum[k] / met[k]) ** 2;
    places += 1;
  }
  return places ? total / places : Infinity;
}

/** Which plane of a focal stack has the highest contrast around (y, x): variance over squared mean. */
export function sharpestPlane(stack, [y, x], reach = 6) {
  const { nx, ny, channels, numbers, count } = stack, size = nx * ny * channels;
  const contrasts = Array.from({ length: count }, (_, k) => {
    let sum = 0, square = 0, n = 0;
    for (let j = Math.max(0, y - reach); j <= Math.min(ny - 1, y + reach); j++) {
      for (let i = Math.max(0, x - reach); i <= Math.min(nx - 1, x + reach); i++) {
        const at = k * size + (j * nx + i) * channels;
        const value = channels === 3 ? (numbers[at] + numbers[at + 1] + numbers[at + 2]) / 3 : numbers[at];
        sum += value; square += value * value; n += 1;
      }
    }
    return (square / n - (sum / n) ** 2) / Math.max((sum / n) ** 2, 1e-9);
  });
  return vertex(stack.positions, contrasts);
}

/** Where the highest of values lies: vertex of the parabola through it and its neighbours. */
function vertex(places, values) {
  let top = 0;
  for (let k = 1; k < values.length; k++) if (values[k] > values[top]) top = k;
  if (top === 0 || top === values.length - 1 || !values.every(Number.isFinite)) return places[top];
  const [below, at, above] = [values[top - 1], values[top], values[top + 1]];
  const bend = below - 2 * at + above, move = bend < 0 ? (below - above) / (2 * bend) : 0;
  return places[top] + move * (places[top + (move > 0 ? 1 : -1)] - places[top]) * Math.sign(move || 1);
}
