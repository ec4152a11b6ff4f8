// Which views count, and how much: a window of the aperture, as lumigraph.reduce_aperture cuts it, moved.

/** Rounds half to even, as Python does. */
function roundEven(x) {
  const low = Math.floor(x), rest = x - low;
  return rest < 0.5 || (rest === 0.5 && low % 2 === 0) ? low : low + 1;
}

/** Views kept along each axis (v, u). */
export function keptViews(views, fraction) {
  return views.shape.slice(0, 2).map((n) => Math.max(1, roundEven(n * fraction)));
}

/** How far the middle (v, u) of the window can move: [[low, high], [low, high]] in views. */
export function freedom(views, fraction) {
  return keptViews(views, fraction).map((kept, axis) => {
    const n = views.shape[axis], first = Math.floor(n / 2) - Math.floor(kept / 2);
    const middle = Math.floor(n / 2);
    return [middle - first, middle + n - kept - first];
  });
}

/** The window's middle (v, u), inside what the fraction allows; the aperture's own middle for null. */
export function middleView(views, fraction, view) {
  return freedom(views, fraction).map(([low, high], axis) =>
    view === null ? Math.floor(views.shape[axis] / 2) : Math.min(high, Math.max(low, view[axis])));
}

/**
 * Weights (v, u): those of the kept views, shared linearly between neighbours where the middle is between.
 * One view alone is the nearest as it was recorded: a mean of two would show every edge twice that is not in focus.
 */
export function viewWeights(views, { aperture, shape, view }) {
  const [nv, nu] = views.shape, kept = keptViews(views, aperture), middle = middleView(views, aperture, view);
  const weights = new Float32Array(nv * nu);
  const alone = kept.every((n) => n === 1), start = middle.map((m, axis) => (alone ? Math.round(m) : m - Math.floor(kept[axis] / 2)));
  const whole = start.map(Math.floor), rest = start.map((s, axis) => s - whole[axis]);
  for (let j = 0; j < kept[0]; j++) for (let i = 0; i < kept[1]; i++) {
    const y = (j - (kept[0] - 1) / 2) / (kept[0] / 2), x = (i - (kept[1] - 1) / 2) / (kept[1] / 2);
    if (shape === "round" && y * y + x * x > 1) continue;
    for (const [dv, wv] of [[0, 1 - rest[0]], [1, rest[0]]]) for (const [du, wu] of [[0, 1 - rest[1]], [1, rest[1]]]) {
      const v = whole[0] + j + dv, u = whole[1] + i + du;
      if (wv * wu > 0 && v >= 0 && v < nv && u >= 0 && u < nu && views.lit[v * nu + u] === "1") {
        weights[v * nu + u] += wv * wu;
      }
    }
  }
  return weights;
}

/** Whether one view is kept: then nothing else shows what lies beyond its edge. */
export function isAlone(views, { aperture }) {
  return keptViews(views, aperture).every((n) => n === 1);
}

/** Refocus factor in the first sample of a picture, and its growth from sample to sample (down, across): it is linear where the plane that is sharp leans. */
export function planeOf(views, focus, tilt = [0, 0]) {
  const most = tiltLimits(views), kept = tilt.map((t, k) => Math.min(most[k], Math.max(-most[k], t)));
  return { corner: focus - (kept[0] + kept[1]) / 2, slope: kept.map((t, k) => t / Math.max(views.shape[2 + k] - 1, 1)) };
}

export function alphaAt({ corner, slope }, [y, x]) {
  return corner + slope[0] * y + slope[1] * x;
}

/** Refocus factors in the corners of a picture of samples (ny, nx). */
export function cornersOf(plane, [ny, nx]) {
  return [0, ny - 1].flatMap((y) => [0, nx - 1].map((x) => alphaAt(plane, [y, x])));
}

/** The same plane in a part of the picture whose samples are `factor` of the picture's. */
export function planeFrom(plane, origin, factor) {
  return { corner: alphaAt(plane, origin), slope: plane.slope.map((s) => s * factor) };
}

/** The most that the plane may lean (down, across): twice what the focus spans, which a floor takes, and less than what folds the outermost views. */
export function tiltLimits(views) {
  const [low, high] = views.focus;
  return [0, 1].map((k) => {
    const { first, step } = viewShifts(views, 0, k), n = views.shape[2 + k], most = Math.max(Math.abs(first), Math.abs(first + (views.shape[k] - 1) * step));
    return n > 1 ? Math.min(2 * (high - low), (0.9 * (n - 1)) / Math.max(most, 1e-9)) : 0;
  });
}

/** How far each view is moved along an axis (0: t, 1: s) to focus on alpha: first view's, and the step [lenslets]. */
export function viewShifts(views, alpha, axis) {
  const { pitch, center, shape } = views.aperture, lenslet = views.lenslets.pitch[axis];
  const step = (pitch[axis] * (1 - alpha)) / lenslet;
  return { first: (center[axis] * (1 - alpha)) / lenslet - Math.floor(shape[axis] / 2) * step, step };
}
