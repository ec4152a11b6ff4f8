// A length and a region on a picture: what they say, and how they are drawn over it.

import { lengthText } from "./overlay.js";

export const TOOLS = ["ruler", "region"];

/** Length of a line [y, x, y, x] in samples, and where the samples are known in metres (`unit` across). */
export function rulerText([y0, x0, y1, x1], unit, aspect, { word, factor }) {
  const samples = `${(factor * Math.hypot(y1 - y0, x1 - x0)).toFixed(1)} ${word}`;
  return unit ? `${lengthText(unit * Math.hypot((y1 - y0) * aspect, x1 - x0))} (${samples})` : samples;
}

/** Rows and columns [first, last] of a region in a picture of so many; null where it lies outside. */
export function samplesOf([y0, x0, y1, x1], [ny, nx]) {
  const range = (a, b, n) => [Math.max(0, Math.round(Math.min(a, b))), Math.min(n - 1, Math.round(Math.max(a, b)))];
  const rows = range(y0, y1, ny), columns = range(x0, x1, nx);
  return rows[0] <= rows[1] && columns[0] <= columns[1] ? { rows, columns } : null;
}

/** Mean, standard deviation and range of numbers. */
export function regionText(values) {
  if (!values.length) return "nothing known";
  let sum = 0, low = Infinity, high = -Infinity, square = 0;
  for (const x of values) { sum += x; if (x < low) low = x; if (x > high) high = x; }
  const mean = sum / values.length, short = (x) => String(Number(x.toPrecision(4)));
  for (const x of values) square += (x - mean) ** 2;
  return `mean ${short(mean)}, deviation ${short(Math.sqrt(square / values.length))}, ${short(low)} to ${short(high)}`;
}

/** Draws both; `place` turns (y, x) of the picture into a place of the context. */
export function drawMeasures(context, { ruler, region }, place, unit, aspect, samples) {
  if (region) {
    const [y0, x0, y1, x1] = region, corners = [[y0, x0], [y0, x1], [y1, x1], [y1, x0]].map(([y, x]) => place(y, x));
    stroked(context, () => { corners.forEach(([x, y], k) => context[k ? "lineTo" : "moveTo"](x, y)); context.closePath(); });
  }
  if (!ruler) return;
  const ends = [place(ruler[0], ruler[1]), place(ruler[2], ruler[3])], [[x0, y0], [x1, y1]] = ends, long = Math.hypot(x1 - x0, y1 - y0) || 1;
  const across = [(-6 * (y1 - y0)) / long, (6 * (x1 - x0)) / long];
  stroked(context, () => {
    context.moveTo(x0, y0); context.lineTo(x1, y1);
    for (const [x, y] of ends) { context.moveTo(x - across[0], y - across[1]); context.lineTo(x + across[0], y + across[1]); }
  });
  const words = rulerText(ruler, unit, aspect, samples);
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  const wide = context.measureText(words).width / 2 + 6, { width, height } = context.canvas, ratio = context.getTransform().a;
  const x = Math.min(width / ratio - wide, Math.max(wide, (x0 + x1) / 2)), y = Math.min(height / ratio - 6, Math.max(22, (y0 + y1) / 2 - 10));
  context.fillStyle = "rgb(0 0 0 / .6)";
  context.beginPath(); context.roundRect(x - wide, y - 14, 2 * wide, 20, 5); context.fill();
  context.fillStyle = "#ffffff";
  context.fillText(words, x, y);
}

/** A white line on a dark one. */
function stroked(context, path) {
  for (const [colour, width] of [["rgb(0 0 0 / .6)", 4], ["#ffffff", 2]]) {
    Object.assign(context, { strokeStyle: colour, lineWidth: width });
    context.beginPath(); path(); context.stroke();
  }
}
