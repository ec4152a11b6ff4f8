// Three sections of a volume through one place, on one scale: xy, beside it yz, below it xz.

import { turned } from "./turning.js";

const GAP = 6, MOST_SIDE = 2048; // pixels between the sections; of all of them across

/**
 * How the sections of a volume (z, y, x) lie in one picture: {pixel [m], size [rows, columns], panels}. A panel has its name,
 * the axes that go down and across, its corner and its size.
 */
export function layoutOf(shape, spacing) {
  const steps = spacing.map((d) => d || spacing[2]), sides = shape.map((n, k) => n * steps[k]);
  const pixel = Math.max(Math.min(...steps), (Math.max(sides[1], sides[2]) + sides[0]) / (MOST_SIDE - GAP));
  const [deep, tall, wide] = sides.map((side) => Math.max(1, Math.round(side / pixel)));
  const panels = [
    { name: "xy", axes: [1, 2], corner: [0, 0], size: [tall, wide] },
    { name: "yz", axes: [1, 0], corner: [0, wide + GAP], size: [tall, deep] },
    { name: "xz", axes: [0, 2], corner: [tall + GAP, 0], size: [deep, wide] },
  ];
  return { pixel, shape, size: [tall + GAP + deep, wide + GAP + deep], panels };
}

/** Samples that the pixels along an axis lie between, and how far: [first, second, part]; without smoothing the nearest. */
function between(count, pixels, smooth) {
  return Array.from({ length: pixels }, (_, k) => {
    const at = ((k + 0.5) * count) / pixels - 0.5, low = Math.floor(at), within = (n) => Math.min(count - 1, Math.max(0, n));
    return smooth ? [within(low), within(low + 1), at - low] : [within(Math.round(at)), within(Math.round(at)), 0];
  });
}

/** The picture's numbers, of the volume's (z, y, x, c); what lies between the sections has the least. */
export function sectionNumbers(numbers, channels, { shape, size, panels }, cross, smooth) {
  const out = new numbers.constructor(size[0] * size[1] * channels), strides = [shape[1] * shape[2], shape[2], 1].map((n) => n * channels);
  for (const { axes: [down, across], corner, size: [rows, columns] } of panels) {
    const fixed = [0, 1, 2].find((k) => k !== down && k !== across), start = cross[fixed] * strides[fixed];
    const tops = between(shape[down], rows, smooth), lefts = between(shape[across], columns, smooth);
    tops.forEach(([y0, y1, fy], r) => {
      const [above, below] = [start + y0 * strides[down], start + y1 * strides[down]];
      let at = ((corner[0] + r) * size[1] + corner[1]) * channels;
      for (const [x0, x1, fx] of lefts) {
        const [left, right] = [x0 * strides[across], x1 * strides[across]];
        for (let c = 0; c < channels; c++) {
          const upper = numbers[above + left + c] * (1 - fx) + numbers[above + right + c] * fx;
          const lower = numbers[below + left + c] * (1 - fx) + numbers[below + right + c] * fx;
          out[at++] = Math.round(upper * (1 - fy) + lower * fy);
        }
      }
    });
  }
  return out;
}

/** The section that a place of the picture lies in; null between them. */
export function panelAt({ panels }, [y, x]) {
  return panels.find(({ corner, size }) => [y, x].every((at, k) => at >= corner[k] - 0.5 && at < corner[k] + size[k] - 0.5)) ?? null;
}

/** Samples (z, y, x) at a place of a section, the third from where the sections cross; the nearest of the section beyond its edge. */
export function samplesAt({ shape }, { axes, corner, size }, place, cross) {
  const found = [...cross];
  axes.forEach((axis, k) => {
    const at = Math.floor(((place[k] - corner[k] + 0.5) * shape[axis]) / size[k]);
    found[axis] = Math.min(shape[axis] - 1, Math.max(0, at));
  });
  return found;
}

/** Draws the names of the sections and where they cross; `place` turns (y, x) of the picture into a place of the context. */
export function drawSections(context, { shape, size, panels }, cross, turn, place, { ground, line }) {
  const area = (top, left, bottom, right) => [[top, left], [top, right], [bottom, right], [bottom, left]].map(([y, x]) => place(y - 0.5, x - 0.5));
  const [xy] = panels, [tall, wide] = xy.size, [rows, columns] = size;
  context.fillStyle = ground;
  for (const corners of [area(tall, 0, tall + GAP, columns), area(0, wide, rows, wide + GAP), area(tall, wide, rows, columns)]) {
    context.beginPath(); corners.forEach(([x, y], k) => context[k ? "lineTo" : "moveTo"](x, y)); context.fill();
  }
  Object.assign(context, { strokeStyle: line, lineWidth: 1, font: "600 12px system-ui, sans-serif", textAlign: "left" });
  context.setLineDash([5, 4]);
  context.beginPath();
  for (const { axes, corner, size: sides } of panels) axes.forEach((axis, k) => {
    const at = corner[k] + ((cross[axis] + 0.5) * sides[k]) / shape[axis] - 0.5, ends = [corner[1 - k] - 0.5, corner[1 - k] + sides[1 - k] - 0.5];
    ends.forEach((end, n) => context[n ? "lineTo" : "moveTo"](...(k ? place(end, at) : place(at, end))));
  });
  context.stroke();
  context.setLineDash([]);
  for (const { name, corner: [top, left], size: [high, across] } of panels) {
    const corners = area(top, left, top + high, left + across), [x, y] = [0, 1].map((k) => Math.min(...corners.map((c) => c[k])) + 4);
    const words = turned([1, 0], turn)[0] ? name : [...name].reverse().join("");
    context.fillStyle = "rgb(0 0 0 / .6)";
    context.beginPath(); context.roundRect(x, y, context.measureText(words).width + 10, 18, 4); context.fill();
    context.fillStyle = "#ffffff";
    context.fillText(words, x + 5, y + 13);
  }
}
