// One exhibit: its arrays as they come, and the image that the settings ask for.

import { isAlone, middleView, planeOf, viewWeights } from "./aperture.js";
import { Finisher } from "./finishing.js";
import { Finer, PlaneWindow, used, ViewsWindow } from "./finer.js";
import { RayCaster, RAYS } from "./rays.js";
import { Refocuser } from "./refocus.js";
import { layoutOf, sectionNumbers } from "./sections.js";
import { loadArray } from "./source.js";
import { cachedMap } from "./tone.js";

const PATIENCE = 1500, LONGEST = 15000; // ms that a finer picture may take at rest: at once, and from frame to frame
export const WIDEST = 1920; // pixels across a film
const SLOW = 45; // ms for one refocused picture, above which a focal stack is shown while the focus moves

export class Model {
  constructor(number, about, changed) {
    Object.assign(this, { number, about, changed, arrays: {}, finer: {}, wanted: new Set(), errors: {}, turns: true, slow: false, complete: false });
    this.views = about.views ? { ...about.views } : null;
    if (about.views && !about.views.metric && about.depth && !about.depth.metres) about.depth.shift = this.shift();
    for (const what of ["views", "volume"]) if (about[what]?.finer) this.finer[what] = new Finer(`${number}/${what}-tiles`, about[what].finer, bytesOf(about, what), changed);
  }

  /** Samples of the file for one of the pictures that the page has from the start. */
  get factor() {
    return (this.finer.views ?? this.finer.volume)?.coarsest ?? 1;
  }

  /** The shift from view to view [samples of the file] for a refocus factor of 0, and what those samples are. */
  shift() {
    const { aperture, lenslets } = this.about.views, coarsest = this.about.views.finer?.coarsest ?? 1;
    return { per: (coarsest * aperture.pitch[1]) / lenslets.pitch[1], word: this.about.raw ? "lenslets" : "px" };
  }

  /** What the samples of a mode's picture are, lenslets of a decoded raw image or pixels, and how many of the file one stands for. */
  samples(state) {
    const { mode } = state, lenslets = this.views && (this.about.raw || this.views.metric) && (mode === "picture" || mode === "depth");
    const grown = this.showsSections(state) && this.layout ? this.layout.pixel / this.about.volume.spacing[2] : 1;
    return { word: lenslets ? "lenslets" : "px", factor: this.factor * grown };
  }

  get modes() {
    const { views, stack, raw, depth, volume } = this.about;
    return { picture: Boolean(views || stack), raw: Boolean(raw), depth: Boolean(depth), volume: Boolean(volume) };
  }

  /** Range of the focus: of the views, or of a stack. */
  get focus() {
    const { views, stack } = this.about;
    return views?.focus ?? (stack ? [stack.positions[0], stack.positions.at(-1)] : [0, 1]);
  }

  get startFocus() {
    return this.views?.start ?? this.about.stack?.positions[Math.floor(this.about.stack.positions.length / 2)] ?? 1;
  }

  /** An array when it is there; null, and asked for, when not yet. */
  need(name) {
    if (this.arrays[name] || this.wanted.has(name)) return this.arrays[name] ?? null;
    this.wanted.add(name);
    loadArray(`${this.number}/${name}`)
      .then((array) => { this.arrays[name] = array; })
      .catch((error) => { this.errors[name] = error.message; })
      .finally(this.changed);
    return null;
  }

  /** The picture that a written page opens with, if it has one. */
  async loadPoster() {
    if (this.views?.poster) this.arrays.poster = await loadArray(`${this.number}/poster`);
  }

  /** The poster, where it is what the settings ask for and the views are not there yet. */
  poster(state) {
    const { views, arrays: { poster } } = this, whole = state.aperture === 1 && state.shape === "square" && !state.tilt.some(Boolean) && !state.denoise;
    if (!poster || !whole || state.focus !== views.start || (state.detail ?? views.detail) !== views.detail) return null;
    const [, ny, nx] = poster.shape;
    return this.seen({ nx, ny, ...coding(poster), numbers: poster.numbers, detail: views.detail, early: true });
  }

  /** Loads the views: the middle one first, so that there is a picture at once. */
  async loadViews(device, exported) {
    const { views } = this, [nv, nu, nt, ns] = views.shape, size = nt * ns * views.channels;
    const chunks = exported ? [[0, nv * nu]] : views.chunks;
    const ask = (k) => loadArray(exported ? `${this.number}/views` : `${this.number}/views/${k}`);
    let next = ask(0);
    for (let k = 0; k < chunks.length; k++) {
      const part = await next, [first, count] = chunks[k];
      if (k + 1 < chunks.length) next = ask(k + 1);
      if (!views.numbers) this.beginViews(part, nv * nu * size, device);
      views.numbers.set(part.numbers, first * size);
      this.refocuser?.add(first, count, part.numbers);
      if (k === 0) this.changed();
    }
    if (views.masked && this.refocuser) {
      this.refocuser.add(0, nv * nu, (await loadArray(`${this.number}/valid`)).numbers, this.refocuser.mask);
    }
    this.complete = true;
    if (this.refocuser) this.measure(device);
    this.changed();
  }

  beginViews(part, length, device) {
    const { views } = this;
    Object.assign(views, { bits: part.bits, scale: part.scale, offset: part.offset, numbers: new part.numbers.constructor(length) });
    if (device.kind !== "webgl") return;
    try { this.refocuser = new Refocuser(device, views); } catch (error) { this.errors.webgl = error.message; }
  }

  /** Whether this machine refocuses in time: first one row of the aperture (shaders are compiled late), all of it where that leaves a doubt. */
  measure(device) {
    const { shape: [nv, nu], detail } = this.views, weights = new Float32Array(nv * nu).fill(1, 0, nu);
    const time = () => {
      const start = performance.now();
      this.refocuser.picture(planeOf(this.views, 1 + 1e-3), weights, detail);
      device.finish();
      return performance.now() - start;
    };
    time();
    this.took = nv * time();
    if (this.took > SLOW && this.took < 10 * SLOW) { weights.fill(1); this.took = time(); }
    this.slow = this.took > SLOW;
    if (this.slow) this.need("stack");
  }

  /**
   * What is finer where somebody looks: {image, origin, factor, low, high}, or null. `seen` is {low, high, scale}: the part of
   * the picture on the screen, and pixels for one of its samples. At rest the next tiles are asked for.
   */
  fine(state, device, seen, settled) {
    const shown = { picture: this.fineViews, volume: this.finePlane }[state.mode]?.call(this, state, device, seen, settled);
    const finer = this.finer[state.mode === "picture" ? "views" : state.mode];
    if (finer?.error) this.errors.tiles = finer.error;
    return shown ?? null;
  }

  /** What a film of these settings can be drawn from that is finer than what the page has; null where nothing is. */
  filmPlan(states) {
    const { views, finer: { views: finer } } = this;
    if (!finer || !this.complete || !this.refocuser || states[0].mode !== "picture" || states[0].renderer === "stack") return null;
    const [nv, nu, nt, ns] = views.shape, all = states.map((state) => used(views, viewWeights(views, state), planeOf(views, state.focus, state.tilt)));
    const rect = [0, 1, 2, 3].map((k) => Math[k % 2 ? "max" : "min"](...all.map((one) => one.rect[k]))), margin = [0, 1].map((k) => Math.max(...all.map((one) => one.margin[k])));
    const pictures = Array.from({ length: nv * nu }, (_, k) => k).filter((k) => k >= rect[0] * nu && k < (rect[1] + 1) * nu && k % nu >= rect[2] && k % nu <= rect[3]);
    const most = (PATIENCE / Math.max(this.took, 1)) * nv * nu * nt * ns * views.detail, seen = { low: [0, 0], high: [nt - 1, ns - 1], scale: WIDEST / ns };
    const plan = finer.plan(seen, pictures, { margin, most, whole: true, extra: 16 * (rect[1] - rect[0] + 2) });
    return plan && { ...plan, rect, margin };
  }

  /** The window of a film's plan, and a function of its settings that gives their finer pictures. */
  async filmWindow(plan, device, signal) {
    const { views, finer: { views: finer } } = this, window = finer.empty(plan, (found) => new ViewsWindow(device, views, found, finer.coarsest, finer.tile));
    try { await finer.fill(window, plan, signal); } catch (error) { window.release(); throw error; }
    const place = finer.place(window, plan.margin);
    return { release: () => window.release(), at: (state) => ({ ...place, image: this.finished(window.picture(planeOf(views, state.focus, state.tilt), viewWeights(views, state), isAlone(views, state)), state, device, true, place) }) };
  }

  fineViews(state, device, seen, settled) {
    const { views, finer: { views: finer } } = this;
    if (!finer || !this.complete || !this.refocuser || state.renderer === "stack") return null;
    const weights = viewWeights(views, state), focused = planeOf(views, state.focus, state.tilt), { rect, pictures, margin } = used(views, weights, focused);
    const [nv, nu, nt, ns] = views.shape;
    const each = Math.max(this.took, 1) / (nv * nu * nt * ns * views.detail), longest = views.masked ? PATIENCE : LONGEST;
    const plan = finer.plan(seen, pictures, { margin, most: longest / each, whole: views.masked, extra: 16 * (rect[1] - rect[0] + 2) });
    if (settled && plan) finer.want({ ...plan, rect }, (found) => new ViewsWindow(device, views, { ...found, rect }, finer.coarsest, finer.tile));
    const { window } = finer;
    if (!plan || !window || !pictures.every((index) => window.kept.has(index)) || (!settled && (this.slow || window.took > SLOW))) return null;
    const part = finer.part(window, seen), image = window.picture(focused, weights, isAlone(views, state), { part, patient: plan.samples * each > PATIENCE });
    if (!image) this.changed();
    const place = finer.place(window, margin, views.masked ? undefined : part);
    return image && { ...place, image: this.finished(image, state, device, settled, place) };
  }

  finePlane(state, device, seen, settled) {
    const { finer: { volume: finer }, about: { volume } } = this, array = this.arrays.volume;
    if (!finer || !array || state.projection !== "plane") return null;
    const [k] = this.cross(state), plan = finer.plan(seen, [k]);
    if (settled && plan) finer.want(plan, (found) => new PlaneWindow(device, found, array.shape[3] ?? 1, volume.white));
    return plan && finer.window?.kept.has(k) ? { ...finer.place(finer.window), image: finer.window.image } : null;
  }

  /** A picture of views with less noise and sharper where in focus, as the settings say; `where` its samples lie. */
  finished(image, state, device, settled, where = undefined) {
    const wanted = state.mode === "picture" && this.views && this.complete && (state.sharpen || state.denoise);
    if (!image || !wanted || device?.kind !== "webgl" || (this.slow && !settled)) return image;
    const finisher = (this.finishers ??= {})[where ? "part" : "whole"] ??= new Finisher(device);
    return finisher.finish(image, this, state, where);
  }

  /** What to show: {nx, ny, channels, numbers or texture, ... , base: [ny, nx], detail, aspect}; null if not yet. */
  image(state, device, settled) {
    if (!this.modes[state.mode]) return null;
    return { picture: this.picture, raw: this.rawImage, depth: this.depthImage, volume: this.volumeImage }[state.mode]
      .call(this, state, device, settled);
  }

  picture(state, device, settled) {
    return this.finished(this.unfinished(state, device, settled), state, device, settled);
  }

  unfinished(state, device, settled) {
    const { views } = this, sharp = state.sharp && views ? this.need("sharp") : null;
    if (sharp) return this.seen({ nx: views.shape[3], ny: views.shape[2], ...coding(sharp), numbers: sharp.numbers, exact: true });
    if (!views) return this.plane(state.focus);
    const poster = this.complete ? null : this.poster(state);
    if (poster || !views.numbers) return poster;
    const forced = state.renderer === "stack", whole = state.aperture === 1;
    if (this.complete && this.refocuser && !forced && (settled || !this.slow || !whole || !this.arrays.stack)) {
      const weights = viewWeights(views, state), detail = state.detail ?? views.detail;
      return this.seen({ ...this.refocused(state, weights, detail), detail, exact: true });
    }
    if (this.complete && (!this.refocuser || forced || this.slow) && whole) {
      const plane = this.plane(state.focus);
      if (plane) return plane;
    }
    return this.oneView(middleView(views, state.aperture, state.view).map(Math.round));
  }

  /** The refocused picture; drawn afresh only where the last one was another. */
  refocused({ focus, tilt, aperture, shape, view }, weights, detail) {
    const { refocuser, views } = this, key = JSON.stringify([focus, tilt, aperture, shape, view, detail]);
    if (refocuser.key !== key) this.drawn = refocuser.picture(planeOf(views, focus, tilt), weights, detail, isAlone(views, { aperture }));
    refocuser.key = key;
    return this.drawn;
  }

  seen(image) {
    const { views } = this, [pt, ps] = views.lenslets.pitch;
    return {
      white: views.white, scale: views.scale, offset: views.offset, channels: views.channels, bits: views.bits,
      base: views.shape.slice(2), aspect: pt / ps, detail: 1, ...image,
    };
  }

  /** One view as it is. */
  oneView([v, u]) {
    const { views } = this, [, nu, nt, ns] = views.shape, size = nt * ns * views.channels, index = v * nu + u;
    if (!this.complete) this.single ??= views.numbers.slice(index * size, (index + 1) * size);
    else if (this.singleIndex !== index) { this.single = views.numbers.slice(index * size, (index + 1) * size); this.singleIndex = index; }
    return this.seen({ nx: ns, ny: nt, numbers: this.single });
  }

  /** The plane of the focal stack nearest to a focus. */
  plane(focus) {
    const array = this.need("stack"), { stack } = this.about;
    if (!array) return null;
    let k = 0;
    stack.positions.forEach((p, i) => { if (Math.abs(p - focus) < Math.abs(stack.positions[k] - focus)) k = i; });
    const [, ny, nx] = array.shape, channels = array.shape[3] ?? 1, image = slice(array, k, [ny, nx, channels]);
    const own = { white: stack.white, scale: array.scale, offset: array.offset, channels, bits: array.bits, position: stack.positions[k] };
    if (!this.views) return { ...image, ...own, base: [ny, nx], aspect: 1, detail: 1 };
    return this.seen({ ...image, ...own, detail: nx > 1 ? (nx - 1) / Math.max(this.views.shape[3] - 1, 1) : 1 });
  }

  rawImage() {
    const array = this.need("raw");
    if (!array) return null;
    const [ny, nx] = array.shape;
    return { nx, ny, channels: array.shape[2] ?? 1, numbers: array.numbers, ...coding(array), white: this.about.raw.white, base: [ny, nx], aspect: 1, detail: 1, unit: this.about.raw.pitch };
  }

  /** Whether a volume is shown by rays, from any side. */
  spins(state) {
    return this.turns && this.wantsRays(state);
  }

  /** Whether rays are asked for, which need WebGL 2. */
  wantsRays(state) {
    return Boolean(this.about.volume) && RAYS.includes(state.projection);
  }

  showsSections({ mode, projection }) {
    return mode === "volume" && projection === "sections" && Boolean(this.about.volume);
  }

  /** Samples (z, y, x) of the plane that is shown and of the place where sections cross. */
  cross({ plane, cross }) {
    const { depths, grid } = this.about.volume, shape = [depths.length, ...grid.shape];
    return [plane, ...(cross ?? [null, null])].map((at, k) => Math.min(shape[k] - 1, Math.max(0, Math.round(at ?? Math.floor(shape[k] / 2)))));
  }

  /** Where samples (z, y, x) of a volume stand [m]. */
  placeOf([z, y, x]) {
    const { depths, grid: { pitch, center, shape } } = this.about.volume;
    return [depths[z], ...[y, x].map((at, k) => center[k] + (at - Math.floor(shape[k] / 2)) * pitch[k])];
  }

  sections(state, array, device) {
    const { about: { volume } } = this, cross = this.cross(state), channels = array.shape[3] ?? 1, key = [...cross, state.smooth].join();
    this.layout ??= layoutOf(array.shape.slice(0, 3), volume.spacing);
    const { pixel, size: [ny, nx] } = this.layout;
    if (this.sectionsKey !== key) {
      device.forget(this.drawnSections);
      this.sectionsKey = key;
      this.drawnSections = { numbers: sectionNumbers(array.numbers, channels, this.layout, cross, state.smooth) };
    }
    const common = { channels, ...coding(array), white: volume.white, base: [ny, nx], aspect: 1, detail: 1 };
    return { nx, ny, ...this.drawnSections, ...common, unit: pixel, sections: { layout: this.layout, cross } };
  }

  volumeImage(state, device, settled) {
    const array = this.need("volume"), { volume } = this.about;
    if (!array) return null;
    const [nz, ny, nx] = array.shape, channels = array.shape[3] ?? 1, [dz, dy, dx] = volume.spacing;
    if (this.spins(state)) return (this.caster ??= new RayCaster(device, array, volume)).image(state, settled);
    const common = { channels, ...coding(array), white: volume.white, detail: 1 };
    if (state.projection === "sections") return this.sections(state, array, device);
    if (state.projection === "plane") {
      const [k] = this.cross(state);
      return { ...slice(array, k, [ny, nx, channels]), ...common, base: [ny, nx], aspect: dy / dx, unit: dx };
    }
    array.projections ??= {};
    const axis = this.wantsRays(state) ? "max-z" : state.projection; // without WebGL: the page says so
    const image = (array.projections[axis] ??= projection(array.numbers, [nz, ny, nx, channels], axis));
    const sizes = { "max-z": [dy, dx], "max-y": [dz || dx, dx], "max-x": [dy, dz || dy] }[axis];
    return { ...image, ...common, base: [image.ny, image.nx], aspect: sizes[0] / sizes[1], unit: sizes[1] };
  }

  /** Depths in colours, hatched grey where the confidence is low. */
  depthImage(state) {
    const depth = this.need("depth"), confidence = this.need("confidence");
    if (!depth || !confidence) return null;
    if (this.about.depth.error) this.need("error");
    const key = `${state.map}/${state.trust}`;
    if (this.depthKey !== key) {
      this.depthKey = key;
      this.depthColours = coloured(depth, confidence, depthMap(state), state.trust);
    }
    const [ny, nx] = depth.shape, aspect = this.views ? this.views.lenslets.pitch[0] / this.views.lenslets.pitch[1] : 1;
    return { nx, ny, channels: 3, bits: 8, scale: 1, offset: 0, white: 255, numbers: this.depthColours, base: [ny, nx], aspect, detail: 1, plain: true, sharp: true };
  }

  /** The depths that the colours span. */
  depthRange() {
    const { depth, confidence } = this.arrays;
    return depth && confidence ? ends(depth, confidence).map((x) => depth.offset + depth.scale * x) : null;
  }

  depthSpan() {
    const range = this.depthRange();
    return range ? range[1] - range[0] : 0;
  }

  depthAt(y, x) {
    const { depth, confidence } = this.arrays;
    if (!depth || !confidence) return null;
    const [ny, nx] = depth.shape, k = Math.round(y) * nx + Math.round(x);
    if (y < -0.5 || x < -0.5 || y >= ny - 0.5 || x >= nx - 0.5) return null;
    const error = this.arrays.error;
    return {
      value: depth.offset + depth.scale * depth.numbers[k], confidence: confidence.numbers[k] / 255,
      error: error ? error.offset + error.scale * error.numbers[k] : null,
    };
  }
}

function bytesOf(about, what) {
  return what === "views" ? (about.views.channels * about.views.bits) / 8 + (about.views.masked ? 1 : 0) : 6;
}

export function depthMap(state) {
  return state.map === "grey" ? "turbo" : state.map;
}

function coding({ bits, scale, offset }) {
  return { bits, scale, offset };
}

/** Picture k of an array; always the same object for the same k, so that its texture is made once. */
function slice(array, k, [ny, nx, channels]) {
  array.slices ??= [];
  array.slices[k] ??= { nx, ny, numbers: array.numbers.subarray(k * ny * nx * channels, (k + 1) * ny * nx * channels) };
  return array.slices[k];
}

function projection(numbers, [nz, ny, nx, channels], kind) {
  const [rows, columns, depth] = { "max-z": [ny, nx, nz], "max-y": [nz, nx, ny], "max-x": [ny, nz, nx] }[kind];
  const at = { "max-z": (r, c, d) => (d * ny + r) * nx + c, "max-y": (r, c, d) => (r * ny + d) * nx + c, "max-x": (r, c, d) => (c * ny + r) * nx + d }[kind];
  const out = new numbers.constructor(rows * columns * channels);
  for (let r = 0; r < rows; r++) for (let c = 0; c < columns; c++) for (let k = 0; k < channels; k++) {
    let most = 0;
    for (let d = 0; d < depth; d++) { const x = numbers[at(r, c, d) * channels + k]; if (x > most) most = x; }
    out[(r * columns + c) * channels + k] = most;
  }
  return { nx: columns, ny: rows, numbers: out };
}

/** 1st and 99th percentile of the numbers of a depth map that are not mere guesses: a few wrong places would take all colours. */
function ends(depth, confidence) {
  if (!depth.range) {
    const sure = depth.numbers.filter((_, i) => confidence.numbers[i] > 0), sorted = (sure.length ? sure : depth.numbers.slice()).sort();
    depth.range = [0.01, 0.99].map((part) => sorted[Math.round(part * (sorted.length - 1))]);
  }
  return depth.range;
}

function coloured(depth, confidence, name, trust) {
  const map = cachedMap(name), n = depth.numbers.length, nx = depth.shape[1], out = new Uint8Array(3 * n);
  const [low, high] = ends(depth, confidence);
  for (let i = 0; i < n; i++) {
    if (confidence.numbers[i] < 255 * trust) {
      const grey = ((i % nx) + Math.floor(i / nx)) % 8 < 4 ? 116 : 134;
      out[3 * i] = out[3 * i + 1] = out[3 * i + 2] = grey;
      continue;
    }
    const part = (depth.numbers[i] - low) / Math.max(high - low, 1), k = 4 * Math.round(255 * Math.min(1, Math.max(0, part)));
    for (let c = 0; c < 3; c++) out[3 * i + c] = map[k + c];
  }
  return out;
}
