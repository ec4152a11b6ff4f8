// Pictures as files: in their own size, with what was measured and a scale bar.

import { drawMeasures } from "./measures.js";
import { drawScaleBar } from "./overlay.js";
import { canQuilt, quilt } from "./quilt.js";

const LEAST_BAR = 240; // pixels across a saved picture that shows a scale bar

/** Name of the first file, without its ending. */
export function nameOf(app) {
  return app.main.model.about.name.replace(/\.[^.]*$/, "");
}

function fileName(app) {
  const { state } = app, what = { picture: state.sharp ? "all-in-focus" : `focus-${state.focus.toFixed(4)}`, raw: "raw", depth: "depth", volume: state.mode === "volume" && state.projection === "plane" ? `plane-${app.main.model.cross(state)[0] + 1}` : state.projection }[state.mode];
  return `${nameOf(app)}-${what}.png`;
}

/** One pane's picture in a canvas, with square pixels, turned as it is shown. */
function partCanvas({ width, height, data, aspect, unit, place, samples, over }, state) {
  const one = document.createElement("canvas"), sheet = document.createElement("canvas"), odd = state.turn % 2;
  Object.assign(one, { width, height });
  one.getContext("2d").putImageData(new ImageData(data, width, height), 0, 0);
  const tall = Math.max(1, Math.round(height * aspect)), context = sheet.getContext("2d");
  [sheet.width, sheet.height] = odd ? [tall, width] : [width, tall];
  context.translate(...[[0, 0], [tall, 0], [width, tall], [0, width]][state.turn]);
  context.rotate((state.turn * Math.PI) / 2);
  context.imageSmoothingEnabled = tall !== height;
  context.drawImage(one, 0, 0, width, tall);
  const matrix = context.getTransform();
  context.resetTransform();
  const where = (y, x) => {
    const [row, column] = place(y, x), { x: left, y: top } = matrix.transformPoint({ x: column + 0.5, y: (row + 0.5) * aspect });
    return [left, top];
  };
  over?.(context, where);
  drawMeasures(context, state, where, unit && unit * place.step, aspect, samples);
  if (unit && sheet.width >= LEAST_BAR) drawScaleBar(context, unit, sheet);
  return sheet;
}

/** Every pane's picture side by side; the first's of what is finer, where that is given. */
export function pictureCanvas(app, state = app.state, finest = undefined) {
  const parts = app.panes.map((pane, k) => pane.pixels(state, k ? undefined : finest)).filter(Boolean).map((part) => partCanvas(part, state));
  if (parts.length === 1) return parts[0];
  const sheet = document.createElement("canvas");
  sheet.width = parts.reduce((sum, { width }) => sum + width, 0);
  sheet.height = Math.max(...parts.map(({ height }) => height));
  let left = 0;
  for (const part of parts) { sheet.getContext("2d").drawImage(part, left, 0); left += part.width; }
  return sheet;
}

export async function savePicture(app) {
  await app.settled();
  await saveCanvas(app, pictureCanvas(app), fileName(app));
}

export async function saveQuilt(app) {
  if (!canQuilt(app.main.model)) { app.tell("A quilt needs views beside each other, and WebGL 2."); return; }
  const { sheet, ending } = quilt(app.main, app.state);
  await saveCanvas(app, sheet, `${nameOf(app)}${ending}.png`);
}

async function saveCanvas(app, canvas, name) {
  saveBlob(app, await new Promise((done) => canvas.toBlob(done, "image/png")), name);
}

export function saveBlob(app, blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  app.tell(`Saved ${link.download}`);
}
