// What is drawn over a picture: lattice, pointer lines, the last click, a scale bar.

import { turned } from "./turning.js";

const KINDS = ["#ff5a36", "#2fd27a", "#47a3ff"];

/** Prepares a canvas over the stage, in CSS pixels. */
export function clearOverlay(canvas, ratio) {
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, canvas.width / ratio, canvas.height / ratio);
  return context;
}

/** Outlines of lenslets on the picture, coloured by kind, with their centres where they are large enough. */
export function drawLattice(context, lattice, { toScreen, scale, width, height, bounds, turn, picture: [ny, nx] }) {
  const [[y0, x0], [y1, x1]] = lattice.basis, [oy, ox] = lattice.origin, area = y1 * x0 - y0 * x1;
  const radius = (lattice.pitch * scale) / 2;
  if (radius < 2.5) return false;
  const inverse = (y, x) => [((y - oy) * x0 - (x - ox) * y0) / area, ((x - ox) * y1 - (y - oy) * x1) / area];
  const corners = [[bounds.top, bounds.left], [bounds.top, bounds.right], [bounds.bottom, bounds.left], [bounds.bottom, bounds.right]]
    .map(([y, x]) => inverse(y, x));
  const range = (k) => [Math.floor(Math.min(...corners.map((c) => c[k]))) - 1, Math.ceil(Math.max(...corners.map((c) => c[k]))) + 1];
  const [i0, i1] = range(0), [j0, j1] = range(1), cell = outline(lattice, scale * (lattice.kinds > 1 ? 0.94 : 1)).map((step) => turned(step, turn));
  context.lineWidth = 1.25;
  const paths = Array.from({ length: lattice.kinds }, () => new Path2D());
  if (lattice.centers) lattice.centers.forEach(([y, x], k) => add(toScreen(y, x), lattice.kindOf[k]));
  else for (let i = i0; i <= i1; i++) for (let j = j0; j <= j1; j++) {
    add(toScreen(oy + i * y1 + j * y0, ox + i * x1 + j * x0), (((j - i) % lattice.kinds) + lattice.kinds) % lattice.kinds);
  }
  const [left, top] = toScreen(-0.5, -0.5), [right, bottom] = toScreen(ny - 0.5, nx - 0.5);
  context.save();
  context.beginPath(); context.rect(left, top, right - left, bottom - top); context.clip();
  paths.forEach((path, kind) => { context.strokeStyle = KINDS[kind]; context.stroke(path); });
  context.restore();
  return true;

  function add([x, y], kind) {
    if (x < -radius || y < -radius || x > width + radius || y > height + radius) return;
    const path = paths[kind];
    cell.forEach(([dx, dy], k) => (k ? path.lineTo(x + dx, y + dy) : path.moveTo(x + dx, y + dy)));
    path.closePath();
    if (radius > 9) { path.moveTo(x - 3, y); path.lineTo(x + 3, y); path.moveTo(x, y - 3); path.lineTo(x, y + 3); }
  }
}

/** Corners of a lenslet's cell around its centre [screen px]. */
function outline({ basis: [[y0, x0], [y1, x1]], layout }, scale) {
  if (layout !== "hex") return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => [((a * x0 + b * x1) / 2) * scale, ((a * y0 + b * y1) / 2) * scale]);
  const steps = [[1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]].map(([j, i]) => [j * x0 + i * x1, j * y0 + i * y1]);
  return steps.map(([x, y], k) => [((x + steps[(k + 1) % 6][0]) / 3) * scale, ((y + steps[(k + 1) % 6][1]) / 3) * scale]);
}

export function drawCross(context, [x, y], { width, height }, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.setLineDash([5, 4]);
  context.beginPath();
  context.moveTo(0, y); context.lineTo(width, y);
  context.moveTo(x, 0); context.lineTo(x, height);
  context.stroke();
  context.setLineDash([]);
}

export function drawMark(context, [x, y]) {
  for (const [colour, width] of [["rgb(0 0 0 / .6)", 4], ["#ffffff", 2]]) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.beginPath();
    for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      context.moveTo(x + 11 * a, y + 5 * b); context.lineTo(x + 11 * a, y + 11 * b); context.lineTo(x + 5 * a, y + 11 * b);
    }
    context.stroke();
  }
}

/** A round length that fits, with its unit. */
export function drawScaleBar(context, metresPerPixel, { width, height }) {
  const most = Math.min(160, width / 3) * metresPerPixel, power = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].map((n) => n * power).find((n) => n <= most) ?? power, pixels = length / metresPerPixel;
  const x = width - pixels - 20, y = height - 18;
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  context.fillStyle = "rgb(0 0 0 / .6)";
  context.beginPath(); context.roundRect(x - 10, y - 22, pixels + 20, 32, 6); context.fill();
  context.fillStyle = "#ffffff";
  context.fillRect(x, y - 1, pixels, 3);
  context.fillText(lengthText(length), x + pixels / 2, y - 7);
}

/** A length [m] for people; in the unit that suits another one. */
export function lengthText(metres, digits = 4, like = metres) {
  if (Math.abs(metres) < 1e-12) return "0 µm";
  const size = Math.abs(like);
  const [unit, value] = size >= 1 ? ["m", 1] : size >= 1e-3 ? ["mm", 1e3] : size >= 1e-6 ? ["µm", 1e6] : ["nm", 1e9];
  return `${Number((metres * value).toPrecision(digits))} ${unit}`;
}

/** Depth from the focused plane [m] of a refocus factor, from the table of a camera; null beyond infinity. */
export function metresOf({ metres: [alphas, depths] }, alpha) {
  const k = Math.max(1, Math.min(alphas.length - 1, alphas.findIndex((a) => a >= alpha))), part = (alpha - alphas[k - 1]) / (alphas[k] - alphas[k - 1]);
  return alphas.length < 2 || alpha < alphas[0] || alpha > alphas.at(-1) ? null : depths[k - 1] + part * (depths[k] - depths[k - 1]);
}

/** Decimals that tell values apart that span `span`, at a hundredth of it; `least` for a wide span or none. */
export function decimals(span, least) {
  return span > 0 ? Math.min(9, Math.max(least, 2 - Math.ceil(Math.log10(span)))) : least;
}

/**
 * A depth as its map counts it: in metres where the camera is known, as a shift per view where that is all that has a meaning.
 * `span`, that of the map's values, gives it as many digits as small ranges need.
 */
export function depthText(about, value, digits = 3, span = 0) {
  const { unit, metres, shift } = about, depth = metres ? metresOf(about, value) : null;
  if (metres) return depth === null ? "beyond infinity" : signed(depth, lengthText);
  if (shift) return signed((1 - value) * shift.per, (x) => `${x.toFixed(decimals(span * Math.abs(shift.per), 2))} ${shift.word} per view`);
  return unit === "m" ? lengthText(value) : `${value.toFixed(decimals(span, digits))} ${unit}`.trim();
}

/** A number with its sign in front. */
export function signed(value, text) {
  return `${value > 0 ? "+" : value < 0 ? "−" : ""}${text(Math.abs(value))}`;
}

/** An error of a depth as its map counts it, with the digits that an error has. */
function errorText(about, value, error) {
  if (about.shift || !about.metres) return `${Number((error * (about.shift?.per ?? 1)).toPrecision(2))} ${about.shift ? "" : about.unit}`.trim();
  const ends = [-1, 1].map((sign) => metresOf(about, value + sign * error));
  return ends.includes(null) ? "?" : lengthText(Math.abs(ends[1] - ends[0]) / 2, 2, metresOf(about, value));
}

/** What a place of a depth map says: value, the error to expect, confidence. */
export function depthTexts(about, { value, error, confidence }, span = 0) {
  const label = about.metres ? "depth" : about.shift ? "disparity" : about.label === "Focus α′" ? "α′" : about.label.toLowerCase();
  const spread = error === null ? "" : ` ± ${errorText(about, value, error)}`;
  return [`${label} ${depthText(about, value, 4, span)}${spread}`, `confidence ${confidence.toFixed(2)}`];
}
