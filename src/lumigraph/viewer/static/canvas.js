// Pictures on the screen without WebGL: the same pictures, drawn by the browser's 2-D canvas.

import { toneBytes } from "./tone.js";

const MOST_KEPT = 64;

export class CanvasDevice {
  kind = "canvas";

  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { alpha: false });
    this.buffers = new Map();
  }

  fits() { return true; }

  forget(image) { if (image) this.buffers.delete(image.numbers); }

  show(image, { origin, scale, smooth, ground, clip, turn = 0 }, tone) {
    const buffer = this.buffer(image, tone);
    const { context, canvas } = this, byte = (x) => Math.round(255 * x);
    context.save();
    if (clip) {
      context.beginPath();
      context.rect(clip[0], clip[1], clip[2] - clip[0], clip[3] - clip[1]);
      context.clip();
    } else {
      context.fillStyle = `rgb(${(ground ?? [0, 0, 0]).map(byte).join(" ")})`;
      context.fillRect(0, 0, canvas.width, canvas.height);
    }
    context.imageSmoothingEnabled = smooth || scale[0] < 1;
    context.imageSmoothingQuality = "low";
    context.translate(...origin);
    context.rotate((turn * Math.PI) / 2);
    context.drawImage(buffer, -scale[0] / 2, -scale[1] / 2, image.nx * scale[0], image.ny * scale[1]);
    context.restore();
  }

  /** The image's colours in a canvas of its own size; those of a focal stack are kept. */
  buffer(image, tone) {
    const key = JSON.stringify(tone);
    if (this.key !== key || this.buffers.size > MOST_KEPT) this.buffers.clear();
    this.key = key;
    if (!this.buffers.has(image.numbers)) {
      const buffer = document.createElement("canvas");
      Object.assign(buffer, { width: image.nx, height: image.ny });
      buffer.getContext("2d").putImageData(new ImageData(this.pixels(image, tone), image.nx, image.ny), 0, 0);
      this.buffers.set(image.numbers, buffer);
    }
    return this.buffers.get(image.numbers);
  }

  pixels(image, tone) {
    return toneBytes(image.numbers, image.channels, tone);
  }

  finish() {
    this.context.getImageData(0, 0, 1, 1);
  }
}
