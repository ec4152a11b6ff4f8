// A quilt for light-field displays: views from left to right in one picture, the first at the bottom left.

import { freedom } from "./aperture.js";
import { toneOf } from "./tone.js";

const COLUMNS = 8, ROWS = 6, MOST = 4096; // pixels across the quilt at most

/** Whether there are views beside each other. */
export function canQuilt(model) {
  return Boolean(model.refocuser && model.complete && model.views.shape[1] > 1);
}

/** The quilt of a pane and what its name ends with, as the displays read it: columns, rows, and width over height of a view. */
export function quilt({ model, device }, state) {
  const count = COLUMNS * ROWS, [rows, [low, high]] = freedom(model.views, 0.001), middle = (rows[0] + rows[1]) / 2;
  const sheet = document.createElement("canvas"), one = document.createElement("canvas"), context = sheet.getContext("2d");
  let aspect = 1;
  for (let k = 0; k < count; k++) {
    const own = { ...state, aperture: 0.001, view: [middle, low + ((high - low) * k) / (count - 1)] }, image = model.image(own, device, true);
    if (k === 0) {
      aspect = image.nx / (image.ny * image.aspect);
      const width = Math.min(image.nx, Math.floor(MOST / COLUMNS), Math.floor((MOST / ROWS) * aspect));
      Object.assign(one, { width: image.nx, height: image.ny });
      Object.assign(sheet, { width: width * COLUMNS, height: Math.round(width / aspect) * ROWS });
    }
    one.getContext("2d").putImageData(new ImageData(device.pixels(image, toneOf(state, image)), image.nx, image.ny), 0, 0);
    const [width, height] = [sheet.width / COLUMNS, sheet.height / ROWS];
    context.drawImage(one, (k % COLUMNS) * width, (ROWS - 1 - Math.floor(k / COLUMNS)) * height, width, height);
  }
  return { sheet, ending: `_qs${COLUMNS}x${ROWS}a${Number(aspect.toFixed(3))}` };
}
