// What is finer than the pictures that the page has: tiles of what is seen, fetched when somebody looks there.

import { cornersOf, planeFrom, viewShifts } from "./aperture.js";
import { Refocuser } from "./refocus.js";
import { loadArray } from "./source.js";

const BUDGET = 192 << 20; // bytes of graphics memory for the pictures of one window
const AT_ONCE = 8; // requests
const BLOCK = 64; // samples in which the part that is drawn grows, so that small movements need nothing new
const SLICE = 100; // ms of drawing, after which the page answers again

/** Tiles of pictures in steps of 1, 2, 4, ... samples; places are in samples of the coarsest. */
export class Finer {
  constructor(path, { shape: [, ny, nx], coarsest, tile, pack }, bytes, changed) {
    Object.assign(this, { path, size: [ny, nx], coarsest, tile, pack, bytes, changed, window: null });
  }

  /** The finest window of these pictures (ascending indices) around what is seen that memory, and drawing `most` samples, allow; null where the coarsest does. */
  plan({ low, high, scale }, pictures, { margin = [0, 0], extra = 0, most = Infinity, whole = false } = {}) {
    let step = this.coarsest;
    while (step > 1 && this.coarsest / step < scale) step /= 2;
    for (; step < this.coarsest; step *= 2) {
      const tiles = low.map((_, k) => {
        const last = Math.ceil(Math.ceil(this.size[k] / step) / this.tile) - 1, tileOf = (place) => Math.floor((place * this.coarsest) / step / this.tile);
        return [Math.max(0, tileOf(low[k] - margin[k])), Math.min(last, tileOf(high[k] + margin[k]))];
      });
      if (tiles.some(([first, last]) => first > last)) return null;
      const sides = tiles.map(([first, last], k) => Math.min((last + 1) * this.tile, Math.ceil(this.size[k] / step)) - first * this.tile);
      const drawn = sides.map((side, k) => (whole ? side : Math.min(side, ((high[k] - low[k] + 2 * margin[k]) * this.coarsest) / step + 2 * BLOCK)));
      const area = sides[0] * sides[1], samples = drawn[0] * drawn[1] * pictures.length;
      if (area * (pictures.length * this.bytes + extra) <= BUDGET && samples <= most) return { step, tiles, sides, pictures, samples };
    }
    return null;
  }

  /** Whether a window shows all that a plan asks for. */
  covers(plan, window = this.window) {
    return Boolean(window) && window.step <= plan.step && plan.pictures.every((index) => window.kept.has(index)) && plan.tiles.every(([first, last], k) => {
      const [low, high] = window.span(this.tile, k), side = this.tile * plan.step;
      return low <= first * side && high >= Math.min((last + 1) * side, this.size[k]);
    });
  }

  /** Loads what a plan asks for, first in coarser steps; `begin` makes the window that takes the tiles. */
  want(plan, begin) {
    if (this.covers(plan) || (this.loading && this.covers(plan, this.loading))) return;
    const now = this.window && plan.pictures.every((index) => this.window.kept.has(index)) ? this.window.step : this.coarsest;
    const step = Math.max(plan.step, now / 4), times = step / plan.step;
    const sides = plan.sides.map((side) => Math.ceil(side / times)), tiles = plan.tiles.map(([first, last]) => [Math.floor(first / times), Math.floor(last / times)]);
    const grown = tiles.map(([first, last], k) => Math.min((last + 1) * this.tile, Math.ceil(this.size[k] / step)) - first * this.tile);
    this.stop?.abort();
    this.stop = new AbortController();
    this.load(times > 1 ? { ...plan, step, tiles, sides: grown } : { ...plan, sides }, begin, this.stop.signal);
  }

  /** A window that no tile has come into yet. */
  empty({ step, tiles, sides, pictures, ...rest }, begin) {
    return Object.assign(begin({ step, tiles, sides, pictures, ...rest }), { step, tiles, sides, kept: new Set(pictures), span });
  }

  async load(plan, begin, signal) {
    const window = (this.loading = this.empty(plan, begin));
    try {
      await this.fill(window, plan, signal);
      this.window?.release();
      this.window = window;
      this.error = "";
    } catch (error) {
      window.release();
      if (!signal.aborted) this.error = error.message;
    }
    if (this.loading === window) this.loading = null;
    if (!this.error) this.changed();
  }

  /** Fetches the files of a window, some at a time, the middle first. */
  async fill(window, { step, tiles: [[top, bottom], [left, right]] }, signal) {
    const packs = [...new Set([...window.kept].map((index) => Math.floor(index / this.pack)))], files = [];
    for (let j = top; j <= bottom; j++) for (let i = left; i <= right; i++) for (const pack of packs) files.push([j, i, pack]);
    const one = async () => {
      for (let file = files.shift(); file && !signal.aborted; file = files.shift()) await this.file(window, step, file, signal);
    };
    await Promise.all(Array.from({ length: AT_ONCE }, one));
    signal.throwIfAborted();
  }

  async file(window, step, [j, i, pack], signal) {
    const corner = [j - window.tiles[0][0], i - window.tiles[1][0]].map((k) => k * this.tile);
    for (const masks of window.masked ? [false, true] : [false]) {
      const { shape: [count, ny, nx], numbers, bits, scale, offset } = await loadArray(`${this.path}/${masks ? "valid-" : ""}${step}/${j}-${i}/${pack}`, signal);
      if (signal.aborted) return;
      const size = numbers.length / count;
      if (!masks) window.coded?.({ bits, scale, offset });
      for (let k = 0; k < count; k++) {
        const index = pack * this.pack + k;
        if (window.kept.has(index)) window.add(index, corner, [ny, nx], numbers.subarray(k * size, (k + 1) * size), masks);
      }
    }
  }

  /** The part of a window, in its own samples from its first, that shows what is seen, in blocks: {start, end}. */
  part({ step, tiles, sides }, { low, high }) {
    const sample = (place, k) => (place * this.coarsest) / step - tiles[k][0] * this.tile;
    return {
      start: low.map((place, k) => Math.max(0, BLOCK * Math.floor((sample(place, k) - 2) / BLOCK))),
      end: high.map((place, k) => Math.min(sides[k], BLOCK * Math.ceil((sample(place, k) + 3) / BLOCK))),
    };
  }

  /** Where the window stands and what of it is exact, in samples of the coarsest: {origin, factor, low, high}. */
  place({ step, tiles, sides }, margin = [0, 0], part = { start: [0, 0], end: sides }) {
    const factor = step / this.coarsest, start = tiles.map(([first]) => first * this.tile * factor), end = start.map((s, k) => s + (sides[k] - 1) * factor);
    const whole = this.size.map((n, k) => end[k] / factor >= Math.ceil(n / step) - 1.5);
    return {
      origin: start, factor,
      low: start.map((s, k) => Math.max(s > 0 ? s + margin[k] : -factor / 2, s + (part.start[k] - 0.5) * factor)),
      high: end.map((e, k) => Math.min(whole[k] ? e + factor / 2 : e - margin[k], start[k] + (part.end[k] - 0.5) * factor)),
    };
  }
}

/** First and last sample of the whole picture along an axis. */
function span(tile, k) {
  const start = this.tiles[k][0] * tile;
  return [start * this.step, (start + this.sides[k]) * this.step];
}

/** Views of a window, refocused by the graphics processor. */
export class ViewsWindow {
  constructor(device, views, { sides, step, pictures, rect, tiles }, coarsest, tile) {
    const [v0, v1, u0, u1] = rect, shape = [v1 - v0 + 1, u1 - u0 + 1], { aperture, lenslets } = views;
    const middle = (k) => [v0, u0][k] + Math.floor(shape[k] / 2) - Math.floor(views.shape[k] / 2);
    Object.assign(this, { rect, pictures, masked: views.masked, kind: views, origin: tiles.map(([first]) => (first * tile * step) / coarsest) });
    this.views = {
      ...views, shape: [...shape, ...sides], factor: step / coarsest,
      aperture: { ...aperture, center: aperture.center.map((c, k) => c + middle(k) * aperture.pitch[k]) },
      lenslets: { ...lenslets, pitch: lenslets.pitch.map((p) => (p * step) / coarsest) },
    };
    this.device = device;
  }

  coded(coding) {
    if (this.refocuser) return;
    Object.assign(this.views, coding);
    this.refocuser = new Refocuser(this.device, this.views);
  }

  add(index, corner, size, numbers, masks) {
    const [v0, , u0] = this.rect, nu = this.kind.shape[1], at = (Math.floor(index / nu) - v0) * this.views.shape[1] + (index % nu) - u0;
    this.refocuser.addPart(at, corner, size, numbers, masks ? this.refocuser.mask : this.refocuser.array);
  }

  /** The picture focused on a plane with the weights of all views, in a part; null while `patient` drawing goes on from frame to frame. */
  picture(plane, weights, alone, { part, patient = false } = {}) {
    const [v0, v1, u0, u1] = this.rect, nu = this.kind.shape[1], own = new Float32Array((v1 - v0 + 1) * (u1 - u0 + 1));
    for (let v = v0, k = 0; v <= v1; v++) for (let u = u0; u <= u1; u++, k++) own[k] = weights[v * nu + u];
    const key = JSON.stringify([plane, alone, part, ...own]);
    if (key !== this.key) {
      this.work?.return();
      Object.assign(this, { key, work: this.refocuser.drawing(planeFrom(plane, this.origin, this.views.factor), own, 1, alone, part), took: 0 });
    }
    if (this.work) this.draw(patient ? SLICE : Infinity);
    return this.work ? null : { white: this.kind.white, scale: this.views.scale, offset: this.views.offset, bits: this.views.bits, stamp: key, ...this.drawn };
  }

  /** Goes on with what is being drawn, for some time [ms]. */
  draw(longest) {
    const start = performance.now();
    while (this.work && performance.now() - start < longest) {
      const { done, value } = this.work.next();
      if (done) [this.drawn, this.work] = [value, null];
      this.device.finish();
    }
    this.took += performance.now() - start;
  }

  release() {
    this.work?.return();
    this.refocuser?.release();
  }
}

/** One plane of a window, as numbers. */
export class PlaneWindow {
  constructor(device, { sides }, channels, white) {
    Object.assign(this, { device, sides, channels, white });
  }

  coded(coding) {
    const [ny, nx] = this.sides;
    this.image ??= { nx, ny, channels: this.channels, white: this.white, ...coding, numbers: new (coding.bits === 8 ? Uint8Array : Uint16Array)(ny * nx * this.channels) };
  }

  add(_, [top, left], [ny, nx], numbers) {
    const across = this.sides[1] * this.channels, row = nx * this.channels;
    for (let y = 0; y < ny; y++) this.image.numbers.set(numbers.subarray(y * row, (y + 1) * row), (top + y) * across + left * this.channels);
  }

  release() {
    this.device.forget(this.image);
  }
}

/** Views that count, the rectangle of the aperture that they fill, and how far they move at most [samples of the coarsest]. */
export function used(views, weights, plane) {
  const [nv, nu] = views.shape, rect = [nv, -1, nu, -1];
  weights.forEach((weight, k) => {
    if (weight <= 0) return;
    const v = Math.floor(k / nu), u = k % nu;
    rect[0] = Math.min(rect[0], v); rect[1] = Math.max(rect[1], v); rect[2] = Math.min(rect[2], u); rect[3] = Math.max(rect[3], u);
  });
  const pictures = [];
  for (let v = rect[0]; v <= rect[1]; v++) for (let u = rect[2]; u <= rect[3]; u++) pictures.push(v * nu + u);
  const margin = [0, 1].map((axis) => {
    const { first, step } = viewShifts(views, 0, axis), most = Math.max(...cornersOf(plane, views.shape.slice(2)).map((alpha) => Math.abs(1 - alpha)));
    return most * Math.max(...rect.slice(2 * axis, 2 * axis + 2).map((k) => Math.abs(first + k * step))) + 2;
  });
  return { rect, pictures, margin };
}
