// Pictures on the screen without WebGL: the same pictures, drawn by the browser's 2-D canvas.

import { toneBytes } from "./tone.js";

export class CanvasDevice {
  kind = "canvas";

  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.buffer = document.createElement("canvas");
  }

  fits() { return true; }

  forget() {}

  show(image, { origin, scale, smooth, ground }, tone) {
    this.prepare(image, tone);
    const { context, canvas } = this, byte = (x) => Math.round(255 * x);
    context.fillStyle = `rgb(${(ground ?? [0, 0, 0]).map(byte).join(" ")})`;
    context.fillRect(0, 0, canvas.width, canvas.height);
    context.imageSmoothingEnabled = smooth || scale[0] < 1;
    context.imageSmoothingQuality = "medium";
    const [left, top] = origin.map((o, k) => o - scale[k] / 2);
    context.drawImage(this.buffer, left, top, image.nx * scale[0], image.ny * scale[1]);
  }

  /** The image's colours in a canvas of its own size; kept while neither changes. */
  prepare(image, tone) {
    const key = JSON.stringify(tone);
    if (this.shown === image.numbers && this.key === key) return;
    Object.assign(this.buffer, { width: image.nx, height: image.ny });
    const data = new ImageData(this.pixels(image, tone), image.nx, image.ny);
    this.buffer.getContext("2d").putImageData(data, 0, 0);
    Object.assign(this, { shown: image.numbers, key });
  }

  pixels(image, tone) {
    return toneBytes(image.numbers, image.channels, tone);
  }

  finish() {
    this.context.getImageData(0, 0, 1, 1);
  }
}
