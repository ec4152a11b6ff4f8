// Epipolar-plane images through a place: (u, s) along its row, (v, t) along its column.

import { alphaAt, middleView, planeOf, viewShifts } from "./aperture.js";
import { toneBytes } from "./tone.js";

/** Numbers of the EPI through (t, s): along "s" (nu × ns) or along "t" (nt × nv). */
export function epiNumbers(views, numbers, [t, s], along, middle) {
  const [nv, nu, nt, ns] = views.shape, channels = views.channels, at = (v, u, y, x) => (((v * nu + u) * nt + y) * ns + x) * channels;
  const [ny, nx] = along === "s" ? [nu, ns] : [nt, nv], out = new numbers.constructor(ny * nx * channels);
  for (let j = 0; j < ny; j++) for (let i = 0; i < nx; i++) {
    const from = along === "s" ? at(middle[0], j, t, i) : at(i, middle[1], j, s);
    for (let c = 0; c < channels; c++) out[(j * nx + i) * channels + c] = numbers[from + c];
  }
  return { nx, ny, numbers: out };
}

/** Draws both EPIs beside the picture, on its own zoom and turned with it, with a line at the slope that is in focus. */
export function drawEpis({ bottom, right }, model, state, place, { origin, scale, turn, ratio, tone, colour }) {
  const { views } = model, [nv, nu, nt, ns] = views.shape;
  const point = [Math.min(nt - 1, Math.max(0, Math.round(place[0]))), Math.min(ns - 1, Math.max(0, Math.round(place[1])))];
  const middle = middleView(views, state.aperture, state.view).map(Math.round);
  for (const [canvas, across] of [[bottom, true], [right, false]]) {
    const along = across === (turn % 2 === 0) ? "s" : "t", way = across ? [1, -1, -1, 1][turn] : [1, 1, -1, -1][turn];
    const box = canvas.getBoundingClientRect();
    canvas.width = Math.round(box.width * ratio); canvas.height = Math.round(box.height * ratio);
    const context = canvas.getContext("2d"), image = epiNumbers(views, views.numbers, point, along, middle);
    const small = document.createElement("canvas");
    small.width = image.nx; small.height = image.ny;
    small.getContext("2d").putImageData(new ImageData(toneBytes(image.numbers, views.channels, tone), image.nx, image.ny), 0, 0);
    context.imageSmoothingEnabled = false;
    const count = along === "s" ? nu : nv, thick = across ? canvas.height : canvas.width;
    const step = way * scale[along === "s" ? 0 : 1], start = origin[across ? 0 : 1], view = thick / count, edge = start - step / 2;
    if (along === "s") context.setTransform(...(across ? [step, 0, 0, view, edge, 0] : [0, step, view, 0, 0, edge]));
    else context.setTransform(...(across ? [0, view, step, 0, edge, 0] : [view, 0, 0, step, 0, edge]));
    context.drawImage(small, 0, 0);
    context.resetTransform();
    const shift = viewShifts(views, alphaAt(planeOf(views, state.focus, state.tilt), point), along === "s" ? 1 : 0), base = along === "s" ? point[1] : point[0];
    const line = [0, count - 1].map((k) => [start + (base + shift.first + k * shift.step) * step, (k + 0.5) * view]);
    context.strokeStyle = colour;
    context.lineWidth = 1.5 * ratio;
    context.beginPath();
    line.forEach(([a, b], end) => context[end ? "lineTo" : "moveTo"](...(across ? [a, b] : [b, a])));
    context.stroke();
  }
}
