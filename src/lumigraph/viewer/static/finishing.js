// A picture with less noise, and sharper where it is in focus: two passes of the graphics processor over what is shown.

import { alphaAt, planeOf, viewWeights } from "./aperture.js";
import { DENOISE, SHARPEN } from "./shaders.js";

const BLUR = 1; // lenslets across which a place may be blurred and still counts as in focus
const MOST_TRIED = 40000; // samples of a view that say how noisy it is
const WIDTH = 4; // standard deviations of the noise that may be averaged away at 100 %

/** Standard deviation of the noise of one view [stored numbers]: lower quartile of what Immerkær's mask leaves, since edges have the upper ones. */
export function noiseOf(views) {
  const [nv, nu, nt, ns] = views.shape, { channels, numbers } = views, start = (Math.floor(nv / 2) * nu + Math.floor(nu / 2)) * nt * ns * channels;
  if (nt < 3 || ns < 3) return 0;
  const at = (y, x) => numbers[start + (y * ns + x) * channels + (channels === 3 ? 1 : 0)], every = Math.max(1, Math.ceil(((nt - 2) * (ns - 2)) / MOST_TRIED)), found = [];
  for (let k = 0; k < (nt - 2) * (ns - 2); k += every) {
    const y = 1 + Math.floor(k / (ns - 2)), x = 1 + (k % (ns - 2));
    const corners = at(y - 1, x - 1) + at(y - 1, x + 1) + at(y + 1, x - 1) + at(y + 1, x + 1), sides = at(y - 1, x) + at(y + 1, x) + at(y, x - 1) + at(y, x + 1);
    found.push(Math.abs(corners - 2 * sides + 4 * at(y, x)));
  }
  return Float64Array.from(found).sort()[Math.floor(found.length / 4)] / 0.3186 / 6;
}

/** How much each place of a map of depths (ny, nx) is in focus, 0 to 1: by the blur of a point there, 0 where the depth is not known. */
export function inFocus({ views, arrays: { depth, confidence } }, state) {
  const [ny, nx] = depth.shape, plane = planeOf(views, state.focus, state.tilt), found = new Float32Array(ny * nx);
  const across = Math.max(...[0, 1].map((k) => (views.shape[k] * views.aperture.pitch[k] * state.aperture) / views.lenslets.pitch[k]));
  for (let y = 0, i = 0; y < ny; y++) for (let x = 0; x < nx; x++, i++) {
    const off = state.sharp ? 0 : depth.offset + depth.scale * depth.numbers[i] - alphaAt(plane, [y, x]);
    found[i] = confidence.numbers[i] < 255 * state.trust ? 0 : Math.exp(-0.5 * ((off * across) / BLUR) ** 2);
  }
  return found;
}

export class Finisher {
  constructor(device) {
    Object.assign(this, { device, key: "" });
  }

  /** The image finished as the settings say; `factor`: lenslets for one of its samples, from the place `origin`. */
  finish(image, model, state, { origin = [0, 0], factor = 1 / image.detail } = {}) {
    const map = state.sharpen > 0 && model.about.depth ? this.focusMap(model, state) : null;
    const { views } = model, noise = state.denoise * WIDTH * this.noise(views, state) / image.scale;
    if (!map && !(noise > 0)) return image;
    const { focus, tilt, aperture, view, shape, detail, sharp, sharpen, denoise } = state;
    const key = JSON.stringify([focus, tilt, aperture, view, shape, detail, sharp, sharpen, denoise, state.trust, origin, factor, image.nx, image.ny, image.position, image.stamp, Boolean(map)]);
    const source = image.texture ?? image.numbers;
    if (key !== this.key || source !== this.source) {
      Object.assign(this, { key, source, drawn: this.drawing(image, { map, sharpen, noise, origin, factor, size: views.shape.slice(2) }) });
    }
    return { ...image, texture: this.drawn, numbers: undefined };
  }

  /** Noise that is left in the mean of the views that count [values]. */
  noise(views, state) {
    views.noise ??= noiseOf(views) * views.scale;
    let sum = 0, square = 0;
    for (const w of viewWeights(views, state)) { sum += w; square += w * w; }
    return (views.noise * Math.sqrt(square)) / Math.max(sum, 1e-9);
  }

  focusMap(model, state) {
    if (!model.need("depth") || !model.need("confidence")) return null;
    const key = JSON.stringify([state.focus, state.tilt, state.aperture, state.sharp, state.trust]);
    if (key !== this.mapKey) {
      const { gl } = this.device, [ny, nx] = model.arrays.depth.shape;
      if (this.map) gl.deleteTexture(this.map);
      this.map = this.device.texture(gl.TEXTURE_2D);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, nx, ny, 0, gl.RED, gl.FLOAT, inFocus(model, state));
      this.mapKey = key;
    }
    return this.map;
  }

  /** Two passes at most; a sample of the kernels lies a quarter of a lenslet or one pixel from the next. */
  drawing(image, { map, sharpen, noise, origin, factor, size }) {
    const { device } = this, { nx, ny } = image, stride = Math.max(1, Math.round(0.25 / factor));
    if (this.width !== nx || this.height !== ny) {
      for (const texture of this.targets ?? []) device.gl.deleteTexture(texture);
      Object.assign(this, { width: nx, height: ny, targets: [device.floats(nx, ny), device.floats(nx, ny)] });
    }
    const whole = !image.texture;
    let from = device.textureOf(image), kind = whole;
    const pass = (name, shader, target, more) => {
      device.draw(device.program(`${name}${kind ? "-whole" : ""}`, shader(kind)), [nx, ny], target, (at, gl) => {
        device.bind(0, kind ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D, from, at.source);
        gl.uniform2i(at.size, nx, ny);
        gl.uniform1i(at.stride, stride);
        more(at, gl);
      });
      [from, kind] = [target, false];
    };
    if (noise > 0) pass("denoise", DENOISE, this.targets[0], (at, gl) => { gl.uniform1f(at.width, noise); gl.uniform1f(at.channels, image.channels); });
    if (map) pass("sharpen", SHARPEN, this.targets[1], (at, gl) => {
      device.bind(1, gl.TEXTURE_2D, map, at.focus);
      gl.uniform2i(at.grid, size[1], size[0]);
      gl.uniform2f(at.origin, origin[1], origin[0]);
      gl.uniform1f(at.factor, factor);
      gl.uniform1f(at.amount, sharpen);
    });
    return from;
  }
}
